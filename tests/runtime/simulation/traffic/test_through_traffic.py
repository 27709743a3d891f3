"""Entry of through traffic: its speed against a simulation of car following, and whom it sees."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir.plan import ActorPlan, Clock, Pose, ScenePlan
from recipe_compiler.library import blueprints
from recipe_runtime.simulation.loop import Simulation
from recipe_runtime.simulation.traffic.following import following_acceleration, free_acceleration, style_of
from recipe_runtime.simulation.traffic.through_traffic import speed_behind
from recipe_runtime.simulation.vehicle import VehicleAgent

from tests.runtime.simulation.traffic.kinematic_world import actor
from tests.runtime.simulation.traffic.scenes import lane, motorway

STYLES = {glob: style_of(blueprints.match(glob)[0].shape) for glob in ("vehicle.sedan.a", "vehicle.truck.box")}


def _hardest(speed: float, gap: float, leader: float, desired: float, kind: str, seconds: float = 60.0) -> float:
    """Follow a leader of constant speed, and return the hardest braking and the smallest gap."""
    style, hardest = STYLES[kind], 0.0
    for _ in range(round(seconds / 0.05)):
        free = free_acceleration(speed, desired, style)
        a = following_acceleration(speed, free, gap, leader, style, style.gap)
        hardest = max(hardest, -a)
        before, speed = speed, max(0.0, speed + a * 0.05)
        gap += (leader - 0.5 * (before + speed)) * 0.05
        assert gap > 0.0
    return hardest


@given(
    gap=st.floats(5.0, 200.0),
    leader=st.floats(0.0, 35.0),
    desired=st.floats(10.0, 40.0),
    kind=st.sampled_from(sorted(STYLES)),
)
def test_the_speed_on_entry_is_the_greatest_without_hard_braking(
    gap: float, leader: float, desired: float, kind: str
) -> None:
    speed = speed_behind(gap, leader, desired, STYLES[kind])
    assert 0.0 <= speed <= desired
    assert _hardest(speed, gap, leader, desired, kind) < 3.0
    if speed < desired - 0.5:
        assert _hardest(min(desired, speed + 0.5), gap, leader, desired, kind, 0.05) > 1.0


def _through(name: str, number: int, y: float, speed: float) -> ActorPlan:
    x = lane(number)
    plan = actor(name, start=(x, y, 90.0), route=[(x, 780.0)], speed=speed)
    return plan.model_copy(update={"entry": Pose(x=x, y=-700.0, yaw=90.0)})


@pytest.mark.parametrize(("changes", "enters"), [(False, True), (True, False)])
def test_a_vehicle_that_changes_into_the_lane_is_seen(changes: bool, enters: bool) -> None:
    """It is in the next lane, 10 m ahead of the entry, and slow."""
    plans = [_through("car", 2, 700.0, 30.0), actor("slow", start=(lane(1), -685.0, 90.0), route=[(lane(1), 780.0)])]
    made = Simulation(ScenePlan(clock=Clock(fps=10, frames=1, physics=240), town=motorway(), actors=tuple(plans)))
    car, slow = made.agents
    assert isinstance(car, VehicleAgent) and isinstance(slow, VehicleAgent)
    car.leave()
    made.advance()
    assert car.present
    car.leave()
    if changes:
        slow.driver.lateral.move_to(-3.6)
    for _ in range(25):
        made.advance()
    assert car.present == enters
    made.close()


def test_a_vehicle_enters_in_the_lane_in_which_it_has_left() -> None:
    plans = [_through("car", 2, 0.0, 30.0), _through("truck", 2, 60.0, 15.0)]
    made = Simulation(ScenePlan(clock=Clock(fps=10, frames=1, physics=240), town=motorway(), actors=tuple(plans)))
    car = made.agents[0]
    assert isinstance(car, VehicleAgent)
    while car.offset < 3.5 and made.seconds < 30.0:
        made.advance()
    car.leave()
    while not car.present:
        made.advance()
    assert (car.x, car.y, car.offset) == pytest.approx((lane(1), -700.0, 3.6), abs=1e-3)
    assert car.driver.line == pytest.approx(3.6)
    until = made.seconds + 3.0
    while made.seconds < until:
        made.advance()
        assert car.offset == pytest.approx(3.6, abs=0.05)
    made.close()
