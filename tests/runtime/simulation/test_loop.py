"""The simulation loop: warm-up, held actors, through traffic, and frames without effect on the motion."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.plan import ActorPlan, Clock, Element, Pose, ScenePlan, TownPlan
from recipe_compiler.library import towns
from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.simulation.neighbours import NeighbourGrid
from recipe_runtime.simulation.terrain import Ground

from tests.runtime.simulation.in_process import simulate
from tests.runtime.simulation.test_collisions import actor, run, simulation

FLAT = TownPlan(name="flat", elements=())
CAR = actor("car", "vehicle.sedan.a", Pose(), (30, 0), (40, 10), (40, 60))
BICYCLE = actor("bicycle", "vehicle.bicycle.a", Pose(x=-10, y=5), (60, 5), speed=4.0)
WALKER = actor("walker", "walker.pedestrian.0001", Pose(x=5, y=-6, yaw=90), (5, -2), (15, -6), speed=1.4)


def scene(*actors: ActorPlan, fps: int = 30, frames: int = 30, warmup: float = 0.0, physics: int = 240) -> ScenePlan:
    return ScenePlan(clock=Clock(fps=fps, frames=frames, physics=physics, warmup=warmup), town=FLAT, actors=actors)


@pytest.mark.slow
def test_the_frame_rate_does_not_affect_the_motion() -> None:
    """States at common times are equal bit for bit, though 24 frames per second fall between control ticks."""
    slow, odd = (
        simulate(scene(CAR, BICYCLE, WALKER, fps=2, frames=5)),
        simulate(scene(CAR, BICYCLE, WALKER, fps=24, frames=49)),
    )
    for name in ("positions", "rotations", "linear", "angular"):
        assert (getattr(odd, name)[::12] == getattr(slow, name)).all(), name


@pytest.mark.slow
def test_motion_between_control_ticks_is_even() -> None:
    trace = simulate(scene(CAR, WALKER, fps=80, frames=161))
    for name in ("car", "walker"):
        x = trace.positions[80:, trace.base_part(name)] / METRE
        way = np.sqrt((np.diff(x[:, :2], axis=0) ** 2).sum(axis=1)) * 80
        assert np.abs(np.diff(way)).max() < 0.12


@pytest.mark.slow
@pytest.mark.parametrize(("warmup", "frames"), [(0.0, 1), (0.31, 7)])
def test_a_longer_clip_begins_with_the_shorter_one(frames: int, warmup: float) -> None:
    whole = scene(CAR, BICYCLE, WALKER, fps=24, frames=12, warmup=warmup)
    long, short = simulate(whole), simulate(whole.first(frames))
    assert short.prefix_digests([frames]) == long.prefix_digests([frames])


def start(trace: Trace, name: str) -> tuple[list[float], float]:
    position = trace.positions[0, trace.base_part(name), :2] / METRE
    speed = float(np.hypot(*trace.linear[0, trace.actors.index(name), :2])) / METRE
    return position.tolist(), speed


@pytest.mark.slow
@pytest.mark.parametrize("plan", [CAR, BICYCLE, WALKER])
def test_held_actors_wait_until_frame_0_and_start_at_their_speed(plan: ActorPlan) -> None:
    other = actor("other", "vehicle.sedan.a", Pose(x=-60, y=-30), (300, -30))
    held = plan.model_copy(update={"held": True})
    trace = simulate(scene(held, other, frames=2, warmup=4.0))
    place, speed = start(trace, plan.name)
    assert place == [plan.start.x, plan.start.y]
    assert speed == pytest.approx(plan.speed, abs=1e-5)
    assert start(trace, "other")[1] > 5.0
    trace = simulate(scene(held, frames=2))
    place, speed = start(trace, plan.name)
    assert speed == 0.0  # without a warm-up, all actors start from rest
    aside = 0.022 * plan.shape["height"] if plan.category == "pedestrian" else 0.0  # the hips, over one leg
    assert np.hypot(place[0] - plan.start.x, place[1] - plan.start.y) <= aside


def test_through_traffic_leaves_and_enters_when_there_is_room() -> None:
    through = actor("through", "vehicle.sedan.a", Pose(), (50, 0)).model_copy(update={"entry": Pose(x=-100)})
    blocker = actor("blocker", "vehicle.sedan.a", Pose(x=-80, y=-1, yaw=90), (-80, -0.5), (-80, 200), speed=4.0)
    with simulation(through, blocker) as made:
        car, other = made.agents
        other.held = True
        while car.present and made.seconds < 20.0:
            run(made, 0.1)
        assert car.speed == 0.0 and not car.present
        assert car.z < -900.0
        run(made, 3.0)
        assert not car.present  # an obstacle is in the lane
        other.leave()
        run(made, 0.3)
        assert car.present
        assert -100.0 <= car.x < -95.0 and car.y == 0.0
        assert car.speed == pytest.approx(8.0, abs=0.5)
        run(made, 5.0)
        assert car.x > -70.0 and abs(car.y) < 0.05


@pytest.mark.slow
@given(
    places=st.lists(st.tuples(st.floats(-200, 200), st.floats(-200, 200)), min_size=1, max_size=12),
    distance=st.floats(0.5, 150),
)
@settings(max_examples=20, deadline=None)
def test_neighbours_are_those_within_reach_in_plan_order(places: list[tuple[float, float]], distance: float) -> None:
    plans = [actor(f"a{n}", "walker.pedestrian.0001", Pose(x=x, y=y)) for n, (x, y) in enumerate(places)]
    with simulation(*plans) as made:
        made.agents[0].leave()
        grid = NeighbourGrid(made.agents)
        for x, y in places[:3]:
            near = [a for a in made.agents[1:] if abs(a.x - x) <= distance and abs(a.y - y) <= distance]
            assert grid.within(x, y, distance) == near


@cache
def _town_and_ground() -> tuple[list[Element], Ground]:
    town = towns.build("downtown", 0, {"blocks": [2, 2]}).plan
    return [e for e in town.elements if e.kind == "sidewalk"], Ground(town)


@pytest.mark.slow
@given(x=st.floats(-150, 150), y=st.floats(-150, 150))
@settings(max_examples=200, deadline=None)
def test_the_height_of_the_ground_includes_all_sidewalks(x: float, y: float) -> None:
    """The grid lookup equals a search of all sidewalks."""
    sidewalks, ground = _town_and_ground()
    height = 0.0
    for element in sidewalks:
        (half_x, half_y), radius = (element.size[0] / 2, element.size[1] / 2), element.shape["radius"]
        dx, dy = abs(x - element.pose.x) - half_x, abs(y - element.pose.y) - half_y
        corner = np.hypot(max(dx + radius, 0.0), max(dy + radius, 0.0))
        if max(dx, dy) <= 0.0 and corner <= radius:
            height = element.pose.z + element.size[2]
    assert ground.height(x, y) == height
