"""Collisions: which bodies are pushed or stop, and that none is lifted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial

import pytest
from recipe_compiler.ir.plan import ActorPlan, Clock, Element, Pose, ScenePlan, TownPlan
from recipe_runtime.simulation.loop import Simulation
from recipe_runtime.simulation.traffic.driver import Command
from recipe_runtime.simulation.vehicle import VehicleAgent

from tests.runtime import actors

actor = partial(actors.actor, speed=8.0)


@contextmanager
def simulation(*cast: ActorPlan, elements: Sequence[Element] = (), physics: int = 240) -> Iterator[Simulation]:
    town = TownPlan(name="flat", elements=tuple(elements))
    made = Simulation(ScenePlan(clock=Clock(fps=10, frames=1, physics=physics), town=town, actors=cast))
    yield made
    made.close()


def vehicle(made: Simulation, number: int = 0) -> VehicleAgent:
    found = made.agents[number]
    assert isinstance(found, VehicleAgent)
    return found


def blind(monkeypatch: pytest.MonkeyPatch, made: Simulation, acceleration: float = 3.0) -> None:
    """Give all drivers the same wish, whatever is ahead."""
    for agent in made.agents:
        if isinstance(agent, VehicleAgent):
            monkeypatch.setattr(agent.driver, "decide", lambda *_: Command(acceleration))


def run(made: Simulation, seconds: float) -> None:
    end = made.seconds + seconds
    while made.seconds < end - 1e-9:
        made.advance()


@pytest.mark.parametrize(
    ("glob", "apart", "most"), [("vehicle.truck.box", 1.2, 0.001), ("vehicle.sedan.a", 0.6, 0.005)]
)
def test_pedestrians_move_no_standing_vehicle(glob: str, apart: float, most: float) -> None:
    """Tyres resist the push of three people of 75 kg for 20 s; only the first impact moves the vehicle."""
    standing = actor("standing", glob, Pose())
    walkers = [
        actor(f"walker{k}", "walker.pedestrian.0001", Pose(x=apart * k, y=-4, yaw=90), (apart * k, 0), speed=1.4)
        for k in (-1, 0, 1)
    ]
    with simulation(standing, *walkers) as made:
        for _ in range(200):
            run(made, 0.1)
            assert math.hypot(made.agents[0].x, made.agents[0].y) < most
            assert abs(made.agents[0].heading[1]) < most
            assert made.agents[0].z == 0.0
        assert "standing" in {event.first for event in made.contacts.events()}


def wall(x: float) -> Element:
    return Element(name="wall", kind="wall", pose=Pose(x=x, yaw=180), size=(0.3, 20.0, 2.0))


def guardrail(x: float) -> Element:
    return Element(name="wall", kind="guardrail", pose=Pose(x=x, yaw=90), size=(20.0, 0.3, 0.7))


@pytest.mark.parametrize("obstacle", [wall(30.0), guardrail(30.0)])
@pytest.mark.parametrize("glob", ["vehicle.sedan.a", "vehicle.suv.b", "vehicle.bus.city", "vehicle.motorcycle.a"])
def test_a_vehicle_that_hits_a_wall_stops_and_is_not_lifted(
    monkeypatch: pytest.MonkeyPatch, glob: str, obstacle: Element
) -> None:
    with simulation(actor("car", glob, Pose(), (80, 0)), elements=[obstacle]) as made:
        blind(monkeypatch, made)
        heights = []
        for _ in range(150):
            run(made, 0.1)
            heights.append(made.agents[0].z)
        car = made.agents[0]
        assert car.x + car.reach == pytest.approx(29.85, abs=0.2)
        assert car.speed == pytest.approx(0.0, abs=0.05)
        assert max(map(abs, heights)) == 0.0
        events = made.contacts.events()
        assert {(e.first, e.second) for e in events} == {("wall", "car")}
        assert events[0].impulse > 4.0 * car.mass


def test_a_head_on_crash_preserves_momentum_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    car = actor("car", "vehicle.sedan.a", Pose(), (80, 0))
    truck = actor("truck", "vehicle.truck.box", Pose(x=60, yaw=180), (-20, 0))
    with simulation(car, truck) as made:
        blind(monkeypatch, made, 1.5)
        light, heavy = vehicle(made, 0), vehicle(made, 1)
        while not made.contacts.events():
            before = light.mass * light.velocity[0] + heavy.mass * heavy.velocity[0]
            made.advance()
        run(made, 0.1)
        after = light.mass * light.velocity[0] + heavy.mass * heavy.velocity[0]
        tyres = (light.mass + heavy.mass) * 7.9 * 0.2
        assert abs(after - before) < tyres
        assert light.velocity[0] < -2.0  # the truck pushes the car back
        run(made, 7.0)
        assert [round(agent.speed, 9) for agent in made.agents] == [0.0, 0.0]
        [event] = [e for e in made.contacts.events() if e.impulse > 5000.0]
        assert (event.first, event.second) == ("car", "truck")
        assert 0 < event.start <= event.end < 240 * 10
        gap = math.hypot(light.x - heavy.x, light.y - heavy.y)
        assert gap > light.reach + heavy.reach - 0.05


@pytest.mark.parametrize(("vx", "vy", "turn"), [(0.0, 3.0, 1.0), (3.0, 0.0, 0.0), (-2.0, 2.0, -2.0)])
def test_tyres_stop_a_pushed_vehicle(vx: float, vy: float, turn: float) -> None:
    with simulation(actor("car", "vehicle.sedan.a", Pose(), speed=5.0)) as made:
        car = vehicle(made)
        made.world.set_velocity(car.body, vx, vy, turn)
        car.read(0.01)
        run(made, 3.0)
        assert (car.velocity, car.yaw_rate) == ((0.0, 0.0), 0.0)
        slid = math.hypot(car.x, car.y)
        speed = math.hypot(vx, vy)
        assert speed * speed / 2 / 8.5 < slid < speed * speed / 2 / 4.5


def test_the_result_depends_little_on_the_time_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """A crash and a drive with 60 and 240 physics steps per second agree within a few centimetres."""
    ends = []
    for physics in (60, 240):
        car = actor("car", "vehicle.sedan.a", Pose(y=30), (40, 30), (50, 40), (50, 90))
        crash = actor("crash", "vehicle.sedan.a", Pose(), (80, 0))
        with simulation(car, crash, elements=[wall(30.0)], physics=physics) as made:
            monkeypatch.setattr(vehicle(made, 1).driver, "decide", lambda *_: Command(3.0))
            run(made, 12.0)
            ends.append([(agent.x, agent.y) for agent in made.agents])
    for (ax, ay), (bx, by) in zip(*ends, strict=True):
        assert math.hypot(ax - bx, ay - by) < 0.3


def test_a_pedestrian_who_is_hit_stops_and_so_does_the_car(monkeypatch: pytest.MonkeyPatch) -> None:
    car = actor("car", "vehicle.sedan.a", Pose(), (80, 0))
    walker = actor("walker", "walker.pedestrian.0001", Pose(x=30, y=0.3), speed=1.4)
    with simulation(car, walker) as made:
        blind(monkeypatch, made)
        run(made, 12.0)
        assert made.agents[0].speed == 0.0
        assert math.hypot(*made.agents[1].velocity) < 0.01
        assert [(e.first, e.second) for e in made.contacts.events()][:1] == [("car", "walker")]


def test_low_and_high_objects_are_no_obstacles(monkeypatch: pytest.MonkeyPatch) -> None:
    kerb = Element(name="low", kind="bench", pose=Pose(x=15), size=(0.5, 5.0, 0.1))
    sign = Element(name="high", kind="guardrail", pose=Pose(x=20, z=4.0), size=(0.5, 5.0, 1.0))
    with simulation(actor("car", "vehicle.sedan.a", Pose(), (80, 0)), elements=[kerb, sign]) as made:
        blind(monkeypatch, made)
        run(made, 8.0)
        assert made.agents[0].x > 40.0
        assert made.contacts.events() == []
