"""Drivers and the props of a recipe: vehicles stop behind a prop in their lane, and pass it."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.plan import Clock, Pose, PropPlan, ScenePlan, TownPlan
from recipe_runtime.simulation.loop import Simulation

from tests.runtime.simulation.test_collisions import actor, run
from tests.runtime.simulation.traffic.scenes import lane, motorway, street


def crate(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> PropPlan:
    return PropPlan(
        name="crate", mesh=None, pose=Pose(x=x, y=y, z=z, yaw=yaw), tag=20, low=(-0.4, -0.9, 0.0), high=(0.4, 0.9, 1.2)
    )


def made(town: TownPlan, prop: PropPlan, *actors: object) -> Simulation:
    return Simulation(ScenePlan(clock=Clock(fps=10, frames=1, physics=240), town=town, actors=actors, props=(prop,)))


@pytest.mark.parametrize("yaw", [0.0, 90.0, 200.0])
def test_a_prop_in_the_lane_is_passed(yaw: float) -> None:
    """Regression: drivers considered actors only, and drove against props."""
    world = made(street(), crate(80.0, -1.5, yaw), actor("hero", "vehicle.sedan.a", Pose(x=10, y=-1.5), (300, -1.5)))
    run(world, 30.0)
    assert world.agents[0].x > 110.0
    assert world.agents[0].y == pytest.approx(-1.5, abs=0.3)
    assert not world.contacts.events()
    world.close()


@pytest.mark.slow
def test_oncoming_traffic_goes_first() -> None:
    hero = actor("hero", "vehicle.sedan.a", Pose(x=30, y=-1.5), (300, -1.5))
    others = [actor(f"other{n}", "vehicle.sedan.a", Pose(x=130 + 14 * n, y=1.5, yaw=180), (-50, 1.5)) for n in range(4)]
    world = made(street(), crate(80.0, -1.5), hero, *others)
    run(world, 40.0)
    assert world.agents[0].x > 110.0
    assert not world.contacts.events()
    world.close()


@pytest.mark.slow
def test_a_prop_on_a_motorway_makes_vehicles_change_lanes() -> None:
    x = lane(0)
    hero = actor("hero", "vehicle.sedan.a", Pose(x=x, y=-200, yaw=90), (x, 400), speed=20.0)
    world = made(motorway(), crate(x, 0.0), hero)
    run(world, 25.0)
    assert world.agents[0].y > 50.0
    assert not world.contacts.events()
    world.close()


def test_a_prop_above_the_road_is_no_obstacle() -> None:
    hero = actor("hero", "vehicle.sedan.a", Pose(x=10, y=-1.5), (300, -1.5))
    world = made(street(), crate(80.0, -1.5, z=5.0), hero)
    run(world, 14.0)
    assert world.agents[0].x > 95.0
    assert world.agents[0].y == pytest.approx(-1.5, abs=0.05)
    world.close()
