"""Drivers differ as their plans say: speeds, headways, gaps, and what they ignore."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.ir.plan import ActorPlan, TownPlan
from recipe_runtime.simulation.traffic.following import stopping_acceleration, style_of

from tests.runtime.simulation.traffic import kinematic_world, scenes
from tests.runtime.simulation.traffic.kinematic_world import KinematicWorld
from tests.runtime.simulation.traffic.scenes import FAR, GREEN, LINE, RED, East, North, through


def _driven(plan: ActorPlan, **driver: Any) -> ActorPlan:
    """Return the plan of a vehicle with a driver, if there is anything to say of it."""
    return ActorPlan.model_validate({**plan.document(), "driver": driver or None})


def _car(name: str, x: float, speed: float, **driver: Any) -> ActorPlan:
    """Return the plan of a car on the street."""
    return _driven(kinematic_world.actor(name, start=(x, -1.5, 0.0), route=[(790.0, -1.5)], speed=speed), **driver)


def _on_motorway(name: str, lane: int, y: float, speed: float, to: float = 480.0, **driver: Any) -> ActorPlan:
    """Return the plan of a car on the motorway."""
    x = scenes.lane(lane)
    return _driven(kinematic_world.actor(name, start=(x, y, 90.0), route=[(x, to)], speed=speed), **driver)


def _through(name: str, come: tuple[int, int], go: tuple[int, int], speed: float, **driver: Any) -> ActorPlan:
    start, route = through(come, go, 40.0)
    return _driven(kinematic_world.actor(name, start=start, route=route, speed=speed), **driver)


@pytest.mark.parametrize("factor", [0.7, 1.0, 1.3])
def test_the_desired_speed_is_relative_to_the_limit(factor: float) -> None:
    world = KinematicWorld(scenes.street(), [_car("a", 5.0, 30.0, limit_factor=factor)])
    world.run(30.0)
    assert world["a"].speed == pytest.approx(factor * 50 / 3.6, rel=0.01)


@pytest.mark.parametrize("headway", [0.5, 1.1, 2.0])
def test_followers_keep_the_equilibrium_gap_of_the_model(headway: float) -> None:
    """The gap of IDM+ behind a leader that is slower than the desired speed: s0 + v T."""
    world = KinematicWorld(scenes.street(), [_car("b", 60.0, 8.0), _car("a", 20.0, 30.0, headway=headway, gap=3.0)])
    world.run(70.0)
    a, b = world["a"], world["b"]
    expected = 3.0 + 8.0 * headway
    assert b.progress + 60.0 - 20.0 - a.progress - a.reach - b.reach == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("gap", [1.0, 2.0, 6.0])
def test_the_gap_is_kept_at_standstill(gap: float) -> None:
    leader = _on_motorway("b", 1, -300.0, 8.0, to=-200.0, changes_lanes=False)
    follower = _on_motorway("a", 1, -380.0, 10.0, gap=gap, changes_lanes=False)
    world = KinematicWorld(scenes.motorway(), [leader, follower])
    world.run(40.0)
    a, b = world["a"], world["b"]
    assert b.y - a.y - a.reach - b.reach == pytest.approx(gap, rel=0.25, abs=0.5)


def test_who_ignores_vehicles_drives_into_them() -> None:
    def overlaps(**driver: Any) -> bool:
        world = KinematicWorld(scenes.street(), [_car("b", 90.0, 0.0), _car("a", 20.0, 10.0, **driver)])
        world.run(10.0)
        return bool(world.overlaps)

    assert overlaps(sees_vehicles=False) and not overlaps(sees_vehicles=True)


def test_who_ignores_pedestrians_does_not_stop_for_them() -> None:
    person = kinematic_world.actor("p", "walker.pedestrian.0001", start=(90.0, -1.5, 90.0), speed=0.0)

    def passes(**driver: Any) -> bool:
        world = KinematicWorld(scenes.street(), [person, _car("a", 20.0, 10.0, **driver)])
        world.run(12.0)
        return world["a"].x > 92.0

    assert passes(sees_walkers=False) and not passes(sees_walkers=True)


def test_who_ignores_signs_does_not_stop_at_them() -> None:
    def slowest(**driver: Any) -> float:
        world = KinematicWorld(scenes.crossing(stop=[East]), [_through("a", East, East, 8.0, **driver)])
        speeds = []
        while world["a"].x < 10.0 and world.tick < 300:
            world.step()
            if world["a"].x > -LINE - 15.0:
                speeds.append(world["a"].speed)
        return min(speeds)

    assert slowest(obeys_signs=True) < 0.2 and slowest(obeys_signs=False) > 5.0


def test_who_ignores_vehicles_still_obeys_lights() -> None:
    town = scenes.crossing(lights={East: RED, North: GREEN})
    world = KinematicWorld(town, [_through("a", East, East, 8.0, sees_vehicles=False)])
    world.run(20.0)
    assert world["a"].speed < 0.1 and not world.on_red


def _lanes_used(**driver: Any) -> set[int]:
    """Return the lanes of a fast car behind a slow one, to the left of the lane where it starts."""
    slow, fast = _on_motorway("b", 1, -300.0, 15.0), _on_motorway("a", 1, -400.0, 30.0, **driver)
    world, used = KinematicWorld(scenes.motorway(), [slow, fast]), set()
    for _ in range(300):
        world.step()
        used.add(round(world["a"].offset / 3.6))
    return used


def test_without_lane_changes_a_vehicle_stays_behind() -> None:
    assert _lanes_used(changes_lanes=False) == {0}
    assert len(_lanes_used(changes_lanes=True)) > 1


def test_who_keeps_right_by_rule_accepts_more_for_the_right_lane() -> None:
    """A vehicle ahead in the right lane is slightly slower."""

    def rightmost(**driver: Any) -> int:
        slow, fast = _on_motorway("b", 2, -246.0, 23.5), _on_motorway("a", 1, -300.0, 25.0, **driver)
        world, lanes = KinematicWorld(scenes.motorway(), [slow, fast]), set()
        fast_car, slow_car = world["a"], world["b"]
        fast_car.speed, slow_car.speed = 25.0, 23.5
        for _ in range(100):
            world.step()
            lanes.add(round(fast_car.offset / 3.6))
        return min(lanes)

    assert (rightmost(keeps_right=False), rightmost(keeps_right=True)) == (0, -1)


def _hardest(town: TownPlan, plan: ActorPlan, seconds: float) -> tuple[float, KinematicWorld]:
    world, hardest = KinematicWorld(town, [plan]), 0.0
    for _ in range(round(seconds / kinematic_world.TICK)):
        world.step()
        hardest = max(hardest, -world.cars[0].acceleration)
    return hardest, world


@pytest.mark.parametrize("kind", ["vehicle.sedan.a", "vehicle.bus.city", "vehicle.bicycle.a"])
@pytest.mark.parametrize("speed", [3.0, 6.0, 9.0, 12.0])
def test_a_red_light_is_approached_with_comfortable_braking(kind: str, speed: float) -> None:
    start, route = through(East, East, FAR - LINE - 20.0)
    plan = _driven(kinematic_world.actor("a", kind, start=start, route=route, speed=speed), limit_factor=1.4)
    hardest, world = _hardest(scenes.crossing(lights={East: RED}), plan, 90.0)
    front = world["a"].x + world["a"].reach
    assert hardest <= 3.0 and not world.on_red
    assert -LINE - 1.5 < front <= -LINE


@pytest.mark.parametrize("onset", [18.0 + 0.25 * n for n in range(12)])
def test_a_light_that_turns_amber_needs_no_hard_braking(onset: float) -> None:
    """Whenever it changes: the vehicle stops with at most 3 m/s2, or passes before red."""
    signal = {"cycle": 1000.0, "green_from": 0.0, "green": onset, "amber": 3.0}
    start, route = through(East, East, FAR - LINE - 20.0)
    plan = _driven(kinematic_world.actor("a", start=start, route=route, speed=11.0), limit_factor=1.4)
    hardest, world = _hardest(scenes.crossing(lights={East: signal}), plan, 60.0)
    assert hardest <= 3.0 and not world.on_red


@pytest.mark.parametrize("speed", [2.0, 5.0, 10.0])
@pytest.mark.parametrize("braking", [0.5, 1.5, 2.5])
def test_a_stop_brakes_hardly_more_than_it_has_to(speed: float, braking: float) -> None:
    """From any speed and distance, a stop takes place before the end, with the braking of a uniform stop."""
    style = style_of({"body": 0.0})
    distance = speed * speed / (2.0 * braking) + 0.3
    hardest, way, v = 0.0, 0.0, speed
    for _ in range(400):
        a = stopping_acceleration(v, 1.0, distance - way, 0.0, style, 0.7)
        after = max(0.0, v + 0.1 * a)
        hardest, way, v = max(hardest, -a), way + 0.05 * (v + after), after
    assert way < distance and v < 0.05
    assert hardest <= max(style.braking, braking) + 0.4
