"""Walking of pedestrians: bounded turns, pauses, pairs, avoidance, and crossing of roads."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.ground.obstacles import Obstacle, ObstacleMap
from recipe_compiler.ir.plan import ActorPlan, Clock, Element, Pause, Pose, ScenePlan, TownPlan
from recipe_compiler.ir.signals import may_walk
from recipe_compiler.library import blueprints, towns
from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.simulation.path import Path
from recipe_runtime.simulation.terrain import Ground
from recipe_runtime.simulation.traffic.road_map import RoadMap
from recipe_runtime.simulation.walking.avoidance import Disc, Scene, choose
from recipe_runtime.simulation.walking.crossings import Crossing, Crossings
from recipe_runtime.simulation.walking.surroundings import Surroundings

from tests.runtime.actors import actor
from tests.runtime.simulation.in_process import simulate

Array = NDArray[np.float64]
Way = tuple[tuple[float, float], ...]
TOWN = towns.build("downtown", 0, {"blocks": [1, 1]})
BLUEPRINT = blueprints.match("walker.pedestrian.0001")[0]
FPS = 10


def walker(name: str, way: Way, speed: float = 1.4, **more: object) -> ActorPlan:
    (x, y), (ax, ay) = way[0], way[1] if len(way) > 1 else (way[0][0] + 1.0, way[0][1])
    start = Pose(x=x, y=y, z=TOWN.ground(x, y), yaw=math.degrees(math.atan2(ay - y, ax - x)))
    return actor(name, BLUEPRINT, start, *way[1:], speed=speed, **more)


def scene(*actors: ActorPlan, seconds: float) -> ScenePlan:
    return ScenePlan(clock=Clock(fps=FPS, frames=int(seconds * FPS), physics=240), town=TOWN.plan, actors=actors)


def moved(*actors: ActorPlan, seconds: float) -> Trace:
    return simulate(scene(*actors, seconds=seconds))


def track(trace: Trace, name: str) -> Array:
    return trace.positions[:, trace.base_part(name), :2].astype(np.float64) / METRE


def speeds(trace: Trace, name: str) -> Array:
    velocity = trace.linear[:, trace.actors.index(name), :2].astype(np.float64) / METRE
    return np.asarray(np.hypot(velocity[:, 0], velocity[:, 1]))


def turns(trace: Trace, name: str) -> Array:
    rates = np.abs(trace.angular[:, trace.actors.index(name), 2].astype(np.float64)) / METRE
    return np.asarray(np.degrees(rates))


ZIGZAG: Way = ((-5.0, -12.0), (-5.0, -4.0), (-7.0, -4.0), (-5.0, -9.0), (-5.0, 4.0))


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "most"), [(1.4, 120.0), (3.0, 90.0)])
def test_turn_rates_and_accelerations_are_plausible(speed: float, most: float) -> None:
    """Regression: a pedestrian turned at 344 degrees per second."""
    trace = moved(walker("hero", ZIGZAG, speed), seconds=28.0)
    pace, turn = speeds(trace, "hero"), turns(trace, "hero")
    assert turn.max() <= 180.0
    assert turn[pace > 0.9 * speed].max() <= most
    velocity = trace.linear[:, 0, :2].astype(np.float64) / METRE
    assert np.hypot(*np.diff(velocity, axis=0).T).max() * FPS <= 3.5
    assert track(trace, "hero")[-1] == pytest.approx((-5.0, 4.0), abs=0.05)


@pytest.mark.slow
def test_a_pause_is_a_stop_at_its_waypoint_for_its_duration() -> None:
    hero = walker("hero", ((-5.0, -8.0), (-5.0, -3.0), (-5.0, 2.0)), pauses=(Pause(waypoint=0, seconds=4.0),))
    trace = moved(hero, seconds=16.0)
    still = np.flatnonzero(speeds(trace, "hero")[:120] < 0.05)
    assert len(still[still > 5]) / FPS == pytest.approx(4.0, abs=0.5)
    assert track(trace, "hero")[still[-1]] == pytest.approx((-5.0, -3.0), abs=0.3)
    assert track(trace, "hero")[-1] == pytest.approx((-5.0, 2.0), abs=0.1)


@pytest.mark.slow
def test_a_companion_keeps_beside_its_leader_round_corners() -> None:
    way: Way = ((-6.0, -12.0), (-6.0, 0.0), (-4.5, 8.0), (-6.5, 16.0))
    leader = walker("leader", way)
    beside = walker("beside", ((-5.3, -12.0), *way[1:]), companion="leader")
    trace = moved(leader, beside, seconds=18.0)
    apart = np.hypot(*(track(trace, "leader") - track(trace, "beside")).T)
    assert apart.min() > 0.45
    assert apart.max() < 1.3
    assert np.abs(apart[40:] - 0.7).mean() < 0.2


@pytest.mark.slow
def test_a_crowd_on_one_line_passes_without_touching() -> None:
    actors = [walker(f"up{n}", ((-6.0, -14.0 + 2.0 * n), (-6.0, 14.0 + 2.0 * n))) for n in range(4)]
    actors += [walker(f"down{n}", ((-6.0, 10.0 + 2.0 * n), (-6.0, -14.0 - 2.0 * n)), 1.2) for n in range(4)]
    trace = moved(*actors, seconds=32.0)
    for n, one in enumerate(actors):
        for other in actors[:n]:
            apart = np.hypot(*(track(trace, one.name) - track(trace, other.name)).T)
            assert apart.min() > 2 * 0.13 * BLUEPRINT.shape["height"] - 0.05
        assert np.hypot(*(track(trace, one.name)[-1] - (one.route[-1].x, one.route[-1].y))) < 1.3


@pytest.mark.slow
def test_two_pedestrians_who_meet_at_a_standing_vehicle_pass_it() -> None:
    """Routes are planned around standing vehicles; one that stops on a route later must not block it forever."""
    van = blueprints.match("vehicle.van.a")[0]
    standing = walker("van", ((-6.0, 0.0),), 0.0).model_copy(
        update={"category": "vehicle", "blueprint": van.id, "shape": van.shape, "tag": van.tag}
    )
    trace = moved(walker("hero", ((-6.0, -8.0), (-6.0, 8.0))), standing, seconds=30.0)
    assert track(trace, "hero")[-1] == pytest.approx((-6.0, 8.0), abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [2.0, 4.0])
def test_a_pedestrian_in_a_dead_end_turns_back(depth: float) -> None:
    """Regression: avoidance turns by at most 135 degrees, so a pedestrian stood in a corner forever."""
    hero = walker("hero", ((0.0, 0.0), (12.0, 0.0)))
    shape = {"extent": 1.0}
    fences = [
        Element(name=name, kind="fence", pose=Pose(x=x, y=y, yaw=yaw), size=(length, 0.1, 1.2), shape=shape)
        for name, x, y, yaw, length in (
            ("end", 4.0, 0.0, 90.0, 3.0),
            ("left", 4.0 - depth / 2, 1.5, 0.0, depth),
            ("right", 4.0 - depth / 2, -1.5, 0.0, depth),
        )
    ]
    plan = scene(hero, seconds=60.0).model_copy(update={"town": TownPlan(name="flat", elements=tuple(fences))})
    trace = simulate(plan)
    assert track(trace, "hero")[-1] == pytest.approx((12.0, 0.0), abs=0.2)


@pytest.mark.slow
@given(
    people=st.lists(
        st.tuples(st.floats(-6, 6), st.floats(-6, 6), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)), max_size=8
    ),
    speed=st.floats(0.3, 3.2),
    blocked=st.booleans(),
    side=st.sampled_from([-1, 0, 1]),
)
@settings(max_examples=150, deadline=None)
def test_the_chosen_velocity_is_free_of_collisions_for_half_a_second(
    people: list[tuple[float, float, float, float]], speed: float, blocked: bool, side: int
) -> None:
    discs: list[Disc] = [(x, y, vx, vy, x * x + y * y - 0.36) for x, y, vx, vy in people if x * x + y * y > 0.5]
    choice = choose(Scene(0.0, 0.0, discs, [], [], 1.8), (1.0, 0.0), speed, 10.0, side, blocked)
    assert 0.0 <= choice.speed <= speed
    assert math.hypot(choice.ux, choice.uy) == pytest.approx(1.0)
    for x, y, vx, vy, _ in discs:
        if vx == vy == 0.0:
            ahead = (choice.ux * choice.speed * 0.4, choice.uy * choice.speed * 0.4)
            assert math.hypot(x - ahead[0], y - ahead[1]) > 0.55


def test_a_lone_pedestrian_walks_straight_and_around_a_lamp() -> None:
    free = choose(Scene(0.0, 0.0, [], [], [], 1.8), (0.6, 0.8), 1.4, 10.0, 0, blocked=False)
    assert (free.ux, free.uy, free.speed, free.side) == (0.6, 0.8, 1.4, 0)
    wall = Obstacle("lamp", "lamp", 0.8, 0.0, 1.0, 0.0, 0.1, 0.1)
    turned = choose(Scene(0.0, 0.0, [], [], [(wall, 0.28)], 1.8), (1.0, 0.0), 1.4, 10.0, 0, blocked=False)
    assert abs(turned.uy) > 0.3


@cache
def surroundings(lights: bool = True) -> Surroundings:
    plan = scene(seconds=1.0)
    town = (
        TOWN.plan
        if lights
        else TOWN.plan.model_copy(
            update={"elements": tuple(e for e in TOWN.plan.elements if e.kind not in ("traffic_light", "sign"))}
        )
    )
    plan = plan.model_copy(update={"town": town})
    return Surroundings(plan, Ground(town), RoadMap(town))


def crossing_of(way: Way, lights: bool = True) -> tuple[Crossings, Crossing]:
    crossings = Crossings(Path(way), surroundings(lights))
    found = crossings.next(0.0)
    assert found is not None
    return crossings, found


NORTH = next(e for e in TOWN.plan.elements if e.kind == "junction" and abs(e.pose.x) < 0.1 and e.pose.y > 0)


def test_a_crossing_is_the_part_of_a_route_on_the_road() -> None:
    """The main street is 6 m wide, without parking bays."""
    _, found = crossing_of(((-6.0, 0.0), (6.0, 0.0)))
    assert found.start == pytest.approx(3.0, abs=0.3)
    assert found.end == pytest.approx(9.0, abs=0.3)
    assert found.junction is None
    assert found.signal is None
    assert Crossings(Path(((-6.0, -20.0), (-6.0, 20.0))), surroundings()).next(0.0) is None


def test_a_crossing_has_the_light_of_the_road_that_it_crosses() -> None:
    """Pedestrians cross the main street while its vehicles have red."""
    y = NORTH.pose.y - NORTH.shape["over_y"]
    _, over_main = crossing_of(((-6.0, y), (6.0, y)))
    x = NORTH.shape["over_x"]
    _, over_side = crossing_of(((x, y - 3.0), (x, NORTH.pose.y + 12.0)))
    assert over_main.signal is not None
    assert over_side.signal is not None
    lights = {e.name: e for e in TOWN.plan.elements if e.kind == "traffic_light"}
    facing_main = [e for e in lights.values() if abs(math.sin(math.radians(e.pose.yaw))) > 0.9]
    here = [e for e in facing_main if abs(e.pose.y - NORTH.pose.y) < 20.0]
    assert over_main.signal in [e.shape for e in here]
    assert over_side.signal not in [e.shape for e in here]
    times = [0.5 * n for n in range(int(2 * over_main.signal["cycle"]))]
    assert not any(may_walk(over_main.signal, t) and may_walk(over_side.signal, t) for t in times)


def test_an_obedient_pedestrian_enters_only_on_walk() -> None:
    y = NORTH.pose.y - NORTH.shape["over_y"]
    crossings, found = crossing_of(((-6.0, y), (6.0, y)))
    assert found.signal is not None
    for seconds in range(44):
        assert crossings.may_enter(found, 1.4, [], True, seconds) == may_walk(found.signal, seconds)
        assert crossings.may_enter(found, 1.4, [], False, seconds)


@pytest.mark.slow
def test_a_pedestrian_waits_for_the_light_at_the_kerb() -> None:
    y = NORTH.pose.y - NORTH.shape["over_y"]
    hero = walker("hero", ((-4.5, y), (5.0, y)))
    _, found = crossing_of(((-4.5, y), (5.0, y)))
    assert found.signal is not None
    trace = moved(hero, seconds=58.0)
    x = track(trace, "hero")[:, 0]
    entered = int(np.flatnonzero(x > -2.9)[0])
    assert may_walk(found.signal, entered / FPS - 0.6)
    assert x[-1] == pytest.approx(5.0, abs=0.1)
    middle = (x > -2.5) & (x < 2.5)
    assert speeds(trace, "hero")[middle].min() > 1.0  # no stop on the road


@pytest.mark.slow
def test_the_walking_planner_knows_all_solid_objects_of_the_engine() -> None:
    """Otherwise, routes would lead through solid objects."""
    bullet = pytest.importorskip("recipe_runtime.simulation.bullet")
    for name in towns.NAMES:
        town = towns.build(name, 0, {})
        plan = scene(seconds=1.0).model_copy(update={"town": town.plan})
        world = bullet.World(plan.town, 240, ())
        known = {o.name for o in map(Obstacle.of_element, town.plan.elements) if o is not None}
        assert set(world.names.values()) == known
        world.close()
    assert ObstacleMap([]).at(0.0, 0.0) is None
