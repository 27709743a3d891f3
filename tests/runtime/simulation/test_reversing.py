"""Reversing: away from an obstacle in contact, and behind a standing vehicle until there is room to pass it."""

from __future__ import annotations

from recipe_compiler.ir.plan import Clock, Element, Pose, ScenePlan, TownPlan
from recipe_runtime.simulation.loop import Simulation
from recipe_runtime.simulation.traffic.reversing import REVERSE_SPEED

from tests.runtime.simulation.test_collisions import actor, run, vehicle, wall
from tests.runtime.simulation.traffic.scenes import street

LANE = -1.5  # y of the lane to the east


def made(*actors: object, elements: tuple[Element, ...] = ()) -> Simulation:
    town = street()
    town = TownPlan(name="street", elements=(*town.elements, *elements))
    return Simulation(ScenePlan(clock=Clock(fps=10, frames=1, physics=240), town=town, actors=actors))


def test_a_vehicle_close_behind_a_breakdown_reverses_and_passes() -> None:
    broken = actor("broken", "vehicle.sedan.a", Pose(x=40, y=LANE), speed=0.0)
    behind = actor("behind", "vehicle.sedan.a", Pose(x=33.5, y=LANE), (300, LANE))
    world = made(broken, behind)
    slowest, places = 0.0, []
    for _ in range(450):
        run(world, 0.1)
        slowest = min(slowest, world.agents[1].speed)
        places.append(world.agents[1].x)
    assert -1.05 * REVERSE_SPEED < slowest < -0.5
    assert 33.5 - min(places) < 11.0
    assert places[-1] > 60.0
    assert not world.contacts.events()
    world.close()


def test_a_vehicle_does_not_reverse_into_the_one_behind() -> None:
    broken = actor("broken", "vehicle.sedan.a", Pose(x=40, y=LANE), speed=0.0)
    behind = actor("behind", "vehicle.sedan.a", Pose(x=33.5, y=LANE), (300, LANE))
    third = actor("third", "vehicle.sedan.a", Pose(x=27.0, y=LANE), speed=0.0)
    world = made(broken, behind, third)
    run(world, 40.0)
    assert not world.contacts.events()
    world.close()


def test_a_vehicle_reverses_from_a_wall() -> None:
    """Regression: it pushed against the wall forever."""
    world = made(actor("hero", "vehicle.sedan.a", Pose(x=20, y=LANE), (300, LANE)), elements=(wall(40.0),))
    run(world, 8.0)
    hit = vehicle(world).x
    assert hit > 36.0
    farthest = hit
    for _ in range(200):
        run(world, 0.1)
        farthest = min(farthest, vehicle(world).x)
    assert 2.0 < hit - farthest < 3.6
    world.close()
