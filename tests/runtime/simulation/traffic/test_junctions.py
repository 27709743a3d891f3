"""Junctions: priority, stopping, and that conflicting movements are never inside at the same time."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.plan import ActorPlan
from recipe_runtime.simulation.traffic.road_map import RoadMap

from tests.runtime.simulation.traffic.kinematic_world import Car, KinematicWorld, actor
from tests.runtime.simulation.traffic.scenes import (
    GREEN,
    LINE,
    RED,
    East,
    North,
    South,
    West,
    crossing,
    lane,
    motorway,
    street,
    through,
)

SIGNED = (East, West)
LIGHTS = {East: RED, West: RED, North: GREEN, South: GREEN}


def _vehicle(
    name: str,
    come: tuple[int, int],
    go: tuple[int, int],
    back: float = 30.0,
    kind: str = "sedan.a",
    *,
    speed: float | None = None,
    obeys: bool = True,
) -> ActorPlan:
    start, route = through(come, go, back)
    return actor(name, f"vehicle.{kind}", start=start, route=route, speed=speed, obeys=obeys)


def _gone(body: Car) -> bool:
    """Return whether a vehicle has left the crossing."""
    passage = body.driver.passage
    return passage.left == len(passage.crossings) == 1


def _entered(world: KinematicWorld, name: str, limit: float = 60.0) -> float:
    """Run until a vehicle's front has passed its stop line, and return the time."""
    while not world[name].driver.passage.entered:
        assert world.seconds < limit, f"{name} never enters: {world[name].driver.passage.reason}"
        world.step()
    return world.seconds


def test_the_map_has_the_junctions_and_signs_of_the_town() -> None:
    roads = RoadMap(crossing(stop=(East,), lights={North: GREEN}))
    arms = roads.junctions[0].arms
    assert [arm.control for arm in arms] == ["stop", "light", "priority", "priority"]
    assert [arm.line for arm in arms] == pytest.approx([LINE] * 4)
    assert roads.limit(50.0, -1.5) == pytest.approx(30.0 / 3.6)
    assert roads.limit(50.0, 50.0) is None
    assert RoadMap(street()).junctions == []


def test_the_map_has_the_lanes_of_a_motorway() -> None:
    roads = RoadMap(motorway())
    lanes = [roads.lanes(lane(n), 0.0) for n in range(3)]
    assert [(x.left, x.right) for x in lanes if x] == [(0, 2), (1, 1), (2, 0)]  # counted from the median
    assert roads.lanes(-lane(0), 0.0) == lanes[0]


@pytest.mark.parametrize("kinds", [("sedan.a", "sedan.a"), ("bus.city", "truck.box"), ("bicycle.a", "van.a")])
def test_two_vehicles_at_a_crossing_pass_one_after_the_other(kinds: tuple[str, str]) -> None:
    world = KinematicWorld(
        crossing(), [_vehicle("a", North, North, 30.0, kinds[0]), _vehicle("b", East, East, 30.0, kinds[1])]
    )
    world.run(60.0)
    assert not world.overlaps
    assert _gone(world["a"]) and _gone(world["b"])


def test_vehicles_without_conflict_pass_together() -> None:
    world = KinematicWorld(crossing(), [_vehicle("a", North, North), _vehicle("b", South, South)])
    world.run(15.0)
    assert _gone(world["a"]) and _gone(world["b"])
    assert world["a"].longest == world["b"].longest == 0.0 or world["a"].longest < 0.3


def test_without_signs_the_vehicle_from_the_right_goes_first() -> None:
    world = KinematicWorld(crossing(), [_vehicle("south", North, North), _vehicle("east", West, West)])
    _entered(world, "east")
    assert not world["south"].driver.passage.entered
    world.run(20.0)
    assert _gone(world["south"]) and not world.overlaps


def test_every_vehicle_stops_at_a_stop_sign() -> None:
    world = KinematicWorld(crossing(stop=SIGNED), [_vehicle("a", East, East)])
    _entered(world, "a")
    assert world["a"].longest > 0.05


def test_the_priority_road_goes_first_and_does_not_brake() -> None:
    plans = [_vehicle("side", East, East, 12.0), _vehicle("main", North, North, 40.0)]
    world = KinematicWorld(crossing(stop=SIGNED), plans)
    slowest = 9.0
    while not world["main"].driver.passage.entered:
        world.step()
        if world.seconds > 5.0:
            slowest = min(slowest, world["main"].speed)
    assert not world["side"].driver.passage.entered
    assert slowest > 7.0
    world.run(30.0)
    assert _gone(world["side"]) and not world.overlaps


@pytest.mark.slow
def test_no_vehicle_waits_forever_at_a_priority_road() -> None:
    """The starvation bound: an endless queue of priority traffic lets a vehicle in."""
    column = [_vehicle(f"main.{n}", North, North, 10.0 + 17.0 * n, speed=7.0) for n in range(11)]
    column += [_vehicle(f"back.{n}", South, South, 18.0 + 17.0 * n, speed=7.0) for n in range(11)]
    world = KinematicWorld(crossing(stop=SIGNED), [*column, _vehicle("side", East, North, 8.0)])
    assert _entered(world, "side", 40.0) < 40.0
    world.run(15.0)
    assert not world.overlaps


def test_a_left_turn_yields_to_oncoming_traffic() -> None:
    plans = [_vehicle("left", North, West, 20.0), _vehicle("oncoming", South, South, 26.0)]
    world = KinematicWorld(crossing(), plans)
    _entered(world, "oncoming")
    assert not world["left"].driver.passage.entered
    world.run(20.0)
    assert _gone(world["left"]) and not world.overlaps


def test_red_lights_are_obeyed() -> None:
    world = KinematicWorld(crossing(lights=LIGHTS), [_vehicle("a", East, East), _vehicle("b", North, North)])
    world.run(40.0)
    assert not world["a"].driver.passage.entered
    assert _gone(world["b"])
    front = world["a"].x + world["a"].reach
    assert -LINE - 2.0 < front <= -LINE
    assert not world.on_red


def test_a_driver_who_ignores_lights_passes_red_without_a_collision() -> None:
    plans = [
        _vehicle("a", East, East, obeys=False),
        *(_vehicle(f"b{n}", North, North, 20.0 + 9.0 * n) for n in range(4)),
    ]
    world = KinematicWorld(crossing(lights=LIGHTS), plans)
    world.run(40.0)
    assert _gone(world["a"]) and [name for name, _ in world.on_red] == ["a"]
    assert not world.overlaps


@pytest.mark.parametrize("back", [5.0, 12.0, 20.0, 26.0, 33.0, 45.0])
def test_a_vehicle_that_can_stop_does_so_on_amber(back: float) -> None:
    """When green ends, an approaching vehicle passes on green or amber or stops at the line; it never passes on red."""
    times = {"cycle": 60.0, "green_from": 54.0, "green": 9.0, "amber": 3.0}  # amber from 3 to 6 s
    world = KinematicWorld(crossing(lights={East: times}), [_vehicle("a", East, East, back)])
    world["a"].speed = 8.0
    world.run(30.0)
    assert not world.on_red
    assert world["a"].driver.passage.entered or world["a"].speed == pytest.approx(0.0, abs=0.05)
    world.run(60.0)
    assert _gone(world["a"])


def test_no_vehicle_enters_without_room_behind_the_junction() -> None:
    parked = actor("parked", start=(LINE + 3.0, -1.5, 0.0), speed=0.0)
    world = KinematicWorld(crossing(), [parked, _vehicle("a", East, East), _vehicle("b", North, North, 45.0)])
    world.run(30.0)
    assert not world["a"].driver.passage.entered and world["a"].driver.passage.reason == "room"
    assert _gone(world["b"])  # the junction is free for others


def test_a_vehicle_that_cannot_go_returns_its_permission() -> None:
    """A vehicle that stands before its stop line with a permission must not block the junction."""
    world = KinematicWorld(crossing(), [_vehicle("a", East, East, 4.0), _vehicle("b", North, North, 45.0)])
    world.step()
    for _ in range(400):
        world["a"].speed = 0.0
        world["a"].progress = 0.0
        world.step()
    assert _gone(world["b"])


@pytest.mark.parametrize("turn", [North, South])
def test_a_turning_bus_does_not_touch_waiting_vehicles(turn: tuple[int, int]) -> None:
    """The swept path of the bus, steered as in the simulation, avoids all waiting positions."""
    plans = [_vehicle("bus", East, turn, 30.0, "bus.city")]
    plans += [_vehicle(f"wait.{n}", d, d, 20.0) for n, d in enumerate((North, South, West))]
    lights = {North: RED, South: RED, West: RED, East: GREEN}
    world = KinematicWorld(crossing(lights=lights), plans)
    least = 100.0
    for _ in range(600):
        world.step()
        passage = world["bus"].driver.passage
        if passage.left < passage.entered:
            c = passage.crossings[0]
            row = round(world["bus"].progress - c.entry - c.movement.start)
            if 0 <= row < len(c.movement.x):
                for x, y in zip(c.movement.x[row], c.movement.y[row], strict=True):
                    for n in range(3):
                        corners = world[f"wait.{n}"].corners()
                        gap = min(((u - x) ** 2 + (v - y) ** 2) ** 0.5 for u, v in corners)
                        least = min(least, gap - c.movement.radius)
    assert _gone(world["bus"]) and not world.overlaps and not world.on_red
    assert least > 0.2


def test_no_vehicle_turns_into_one_beyond_its_waiting_position() -> None:
    """Regression: a car without permission stood at the painted line, on the swept path of a bus, and they collided."""
    reach = actor("any", start=(0.0, 0.0, 0.0)).shape["length"] / 2
    plans = [_vehicle("bus", East, South, 30.0, "bus.city"), _vehicle("over", North, North, reach + 0.3)]
    world = KinematicWorld(crossing(lights={North: RED, East: GREEN}), plans)
    world.run(25.0)
    bus, over = world["bus"].driver.passage, world["over"].driver.passage
    assert not bus.entered and bus.reason == "blocked" and over.obstructs
    world["over"].progress -= 8.0
    world.run(20.0)
    assert _gone(world["bus"]) and not over.obstructs and not world.overlaps


def test_a_bus_turning_right_needs_more_space_than_a_car() -> None:
    plans = [_vehicle("bus", North, East, 20.0, "bus.city"), _vehicle("car", North, East, 50.0)]
    world = KinematicWorld(crossing(), plans)
    world.step()
    bus, car = (world[name].driver.passage.crossings[0].movement for name in ("bus", "car"))
    assert bus.turn == car.turn == "right"
    assert bus.reach_into((-1.0, 0.0), (0.3, 2.7)) > car.reach_into((-1.0, 0.0), (0.3, 2.7)) + 1.0


DIRECTIONS = (East, North, West, South)
KINDS = ("sedan.a", "bus.city", "truck.box", "bicycle.a", "motorcycle.a", "van.a")


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 3), st.integers(-1, 1), st.sampled_from(KINDS), st.floats(6.0, 40.0)),
        min_size=2,
        max_size=6,
        unique_by=lambda v: v[0],
    ),
    st.sampled_from(["none", "signs", "lights"]),
)
def test_conflicting_movements_are_never_inside_together(
    vehicles: list[tuple[int, int, str, float]], control: str
) -> None:
    town = {
        "none": crossing(),
        "signs": crossing(stop=SIGNED),
        "lights": crossing(lights=dict.fromkeys(DIRECTIONS, GREEN)),
    }[control]
    plans = [
        _vehicle(f"v{n}", DIRECTIONS[arm], DIRECTIONS[(arm + turn) % 4], back, kind)
        for n, (arm, turn, kind, back) in enumerate(vehicles)
    ]
    world = KinematicWorld(town, plans)
    for _ in range(900):
        world.step()
        inside = [b for b in world.cars if b.driver.passage.left < b.driver.passage.entered]
        for n, a in enumerate(inside):
            for b in inside[:n]:
                one, two = a.driver.passage.crossings[0], b.driver.passage.crossings[0]
                meet = world.junctions.overlap(one.movement, two.movement)
                both_past = meet is None or (
                    a.progress - one.entry > meet.last or b.progress - two.entry > meet.other_last
                )
                assert both_past, (a.actor.name, b.actor.name)
        if world.tick % 5 == 0:
            world.find_overlaps()
    assert not world.overlaps
    assert all(_gone(b) for b in world.cars), [b.driver.passage.reason for b in world.cars]


def test_gaps_in_a_standing_queue_are_no_room() -> None:
    """Five cars stand up to the junction, and a sixth must not enter."""
    places = [LINE + 4.0 + 7.0 * n for n in range(5)]  # the rear of the last one is 1.7 m behind the junction
    queue = [actor(f"q{n}", start=(x, -1.5, 0.0), route=[(190.0, -1.5)]) for n, x in enumerate(places)]
    walker = actor("walker", "walker.pedestrian.0001", start=(places[-1] + 5.0, -1.5, 90.0))
    world = KinematicWorld(crossing(), [*queue, walker, _vehicle("a", East, East), _vehicle("b", North, North, 50.0)])
    world.run(20.0)
    assert not world["a"].driver.passage.entered and world["a"].driver.passage.reason == "room"
    assert _gone(world["b"]) and not world.overlaps


@pytest.mark.parametrize("back", [24.0, 36.0, 48.0, 60.0])
def test_no_vehicle_leaves_a_junction_towards_an_overtaking_one(back: float) -> None:
    """Both would block each other in one lane forever."""
    bike = _vehicle("bike", East, East, 80.0, "bicycle.child")
    plans = [bike, _vehicle("truck", East, East, 95.0, "truck.box"), _vehicle("bus", North, West, back, "bus.city")]
    world = KinematicWorld(crossing(), plans)
    together = overtaken = 0
    for _ in range(600):
        world.step()
        truck, bus = world["truck"].driver, world["bus"].driver.passage
        overtaken += truck.overtakes
        together += truck.overtakes and bus.left < bus.entered and not truck.passage.entered
    assert together == 0 and overtaken > 0 and not world.overlaps
    assert _gone(world["truck"]) and _gone(world["bus"])
