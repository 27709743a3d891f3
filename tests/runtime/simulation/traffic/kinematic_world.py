"""A kinematic world for tests of traffic rules: vehicles and pedestrians on their paths, without a physics engine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Point, Pose, TownPlan
from recipe_compiler.ir.signals import light
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints, towns
from recipe_runtime.simulation.path import Path
from recipe_runtime.simulation.traffic.driver import Command, Driver
from recipe_runtime.simulation.traffic.junctions import JunctionControl
from recipe_runtime.simulation.traffic.road_map import RoadMap

from tests.runtime import actors

TICK = 0.1


def actor(
    name: str,
    blueprint: str = "vehicle.sedan.a",
    *,
    start: tuple[float, float, float],
    route: Sequence[tuple[float, float]] = (),
    speed: float | None = None,
    obeys: bool = True,
) -> ActorPlan:
    """Return the plan of an actor; `start` is x, y and yaw."""
    x, y, yaw = start
    return actors.actor(name, blueprint, Pose(x=x, y=y, yaw=yaw), *route, speed=speed, obeys=obeys)


class Dummy:
    """A body on a path: position, heading and speed."""

    def __init__(self, actor: ActorPlan) -> None:
        self.actor = actor
        start, shape = actor.start, actor.shape
        self.path = Path([(start.x, start.y), *((p.x, p.y) for p in actor.route)])
        self.radius = shape["width"] / 2 if "width" in shape else 0.13 * shape["height"]
        self.reach = shape["length"] / 2 if "width" in shape else self.radius
        self.x, self.y = start.x, start.y
        s, c = exact.sin_cos_deg(start.yaw)
        self.heading, self.velocity = (c, s), (0.0, 0.0)
        self.progress = self.offset = self.speed = 0.0
        self.present, self.waiting = True, False
        self.acceleration = 0.0
        self.stood = self.longest = 0.0  # seconds of continuous standing: now, and the maximum so far

    def place(self) -> None:
        """Set the body's pose from its progress and offset."""
        if not self.path.legs:
            return
        half = 0.3 * self.reach + 0.2
        (ax, ay), (bx, by) = self.path.at(self.progress - half), self.path.at(self.progress + half)
        size = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
        hx, hy = (bx - ax) / size, (by - ay) / size
        mx, my = self.path.at(self.progress)
        self.heading = (hx, hy)
        self.x, self.y = mx - self.offset * hy, my + self.offset * hx
        self.velocity = (self.speed * hx, self.speed * hy)

    def corners(self, shrink: float = 0.0) -> list[tuple[float, float]]:
        (hx, hy), a, b = self.heading, self.reach - shrink, self.radius - shrink
        return [(self.x + u * a * hx - v * b * hy, self.y + u * a * hy + v * b * hx)
                for u, v in ((1, 1), (1, -1), (-1, -1), (-1, 1))]  # fmt: skip


class Car(Dummy):
    """A vehicle with its driver."""

    halted = False

    def __init__(self, actor: ActorPlan, driver: Driver) -> None:
        super().__init__(actor)
        self.driver = driver
        self.offset = driver.base_offset
        self.place()


class KinematicWorld:
    """Vehicles and pedestrians of a town, at 10 ticks per second."""

    def __init__(self, town: TownPlan, plans: Sequence[ActorPlan], *, start: float = 0.0) -> None:
        self.road_map = RoadMap(town)
        self.junctions = JunctionControl(self.road_map)
        self.bodies = [
            Car(a, Driver(a, self.road_map, self.junctions)) if a.category == "vehicle" else Dummy(a) for a in plans
        ]
        self.cars = [body for body in self.bodies if isinstance(body, Car)]
        self.tick, self._start = 0, start
        self.on_red: list[tuple[str, float]] = []
        self.overlaps: set[tuple[str, str]] = set()
        self.decisions = 0

    @property
    def seconds(self) -> float:
        return self._start + TICK * self.tick

    def __getitem__(self, name: str) -> Car:
        return next(car for car in self.cars if car.actor.name == name)

    def walker(self, name: str) -> Dummy:
        return next(body for body in self.bodies if body.actor.name == name)

    def run(self, seconds: float, *, check: bool = True) -> None:
        for _ in range(round(seconds / TICK)):
            self.step()
            if check and self.tick % 5 == 0:
                self.find_overlaps()

    def step(self) -> None:
        t, bodies = self.seconds, self.bodies
        self.junctions.update(bodies, t)
        commands: list[tuple[Car, Command]] = []
        for car in self.cars:
            if car.present:
                reach = car.driver.horizon
                near = [
                    other
                    for other in bodies
                    if other is not car
                    and other.present
                    and abs(other.x - car.x) < reach
                    and abs(other.y - car.y) < reach
                ]
                commands.append((car, car.driver.decide(car, near, t)))
                self.decisions += 1
        for car, command in commands:
            before, car.waiting = car.progress, car.driver.waiting
            self._move(car, command)
            self._check_red(car, before, t)
        for body in bodies:
            if not isinstance(body, Car):
                self._walk(body)
            elif not body.present:
                self._enter(body)
            body.stood = body.stood + TICK if body.speed < 0.1 else 0.0
            body.longest = max(body.longest, body.stood)
        self.tick += 1

    def _move(self, body: Car, command: Command) -> None:
        a = max(-8.0, min(3.5, command.acceleration))
        speed = max(0.0, body.speed + a * TICK)
        body.acceleration = (speed - body.speed) / TICK
        body.progress += (body.speed + speed) / 2 * TICK
        body.speed = speed
        body.driver.lateral.advance(speed, TICK)
        body.offset = body.driver.lateral.line
        if body.actor.entry is not None and body.progress >= body.path.length:
            self._enter(body)
        body.place()

    def _enter(self, body: Car) -> None:
        """Let through traffic enter again when there is room."""
        entry = body.actor.entry
        assert entry is not None
        s, c = exact.sin_cos_deg(entry.yaw)
        for other in self.bodies:
            dx, dy = other.x - entry.x, other.y - entry.y
            along, aside = dx * c + dy * s, dy * c - dx * s
            if other is not body and other.present and -30.0 < along < 45.0 and abs(aside) < 2.6:
                body.present, body.progress, body.speed = False, body.path.length, body.actor.speed
                body.x, body.y = 1e5, 1e5
                return
        tail = [(p.x, p.y) for p in body.actor.route]
        body.path, body.progress, body.present = Path([(entry.x, entry.y), tail[-1]]), 0.0, True
        body.driver.lateral.stay(body.driver.lane_offset)
        body.offset = body.driver.line

    def _walk(self, body: Dummy) -> None:
        """Move a pedestrian along its route; at a kerb it waits for moving vehicles."""
        if not body.path.legs or body.progress >= body.path.length:
            body.speed, body.velocity = 0.0, (0.0, 0.0)
            return
        (hx, hy), ahead = body.path.tangent(body.progress), 0.0
        for other in self.bodies:
            far = max(abs(other.x - body.x), abs(other.y - body.y)) > 30.0
            if far or not isinstance(other, Car) or other.speed < 0.5:
                continue
            for k in (0.0, 0.5, 1.0, 1.5, 2.0):
                dx = body.x + hx * 1.4 * k - other.x - other.velocity[0] * k
                dy = body.y + hy * 1.4 * k - other.y - other.velocity[1] * k
                u, v = dx * other.heading[0] + dy * other.heading[1], dy * other.heading[0] - dx * other.heading[1]
                if abs(u) < other.reach + 0.8 and abs(v) < other.radius + 0.5:
                    ahead = 1.0
        on_road = self.road_map.limit(body.x, body.y) is not None
        body.speed = 0.0 if ahead and not on_road else body.actor.speed
        body.progress += body.speed * TICK
        body.place()

    def _check_red(self, body: Car, before: float, t: float) -> None:
        for crossing in body.driver.passage.crossings:
            if before + body.reach <= crossing.entry < body.progress + body.reach:
                signal = self.road_map.junctions[crossing.junction].arms[crossing.arm].signal
                if signal is not None and light(signal, t) == "red":
                    self.on_red.append((body.actor.name, t))

    def find_overlaps(self, deeper: float = 0.05) -> None:
        bodies = [car for car in self.cars if car.present]
        for n, a in enumerate(bodies):
            for b in bodies[:n]:
                far = a.reach + b.reach
                near = abs(a.x - b.x) < far and abs(a.y - b.y) < far
                if near and _overlap(a.corners(deeper), b.corners(deeper)):
                    self.overlaps.add((b.actor.name, a.actor.name))

    def mean_speed(self) -> float:
        moving = [car.speed for car in self.cars if car.present and car.actor.speed > 0]
        return sum(moving) / max(1, len(moving))


def _overlap(a: Sequence[tuple[float, float]], b: Sequence[tuple[float, float]]) -> bool:
    """Return the overlap of two rectangles by the separating axis theorem."""
    for p in (a, b):
        for k in (0, 1):
            nx, ny = p[k + 1][1] - p[k][1], p[k][0] - p[k + 1][0]
            one, two = ([x * nx + y * ny for x, y in q] for q in (a, b))
            if max(one) < min(two) or max(two) < min(one):
                return False
    return True


def town_traffic(
    name: str, vehicles: int, pedestrians: int, seconds: float, seed: int = 1, **params: object
) -> tuple[towns.Town, list[ActorPlan]]:
    """Return a town, and plans of traffic placed as by the compiler."""
    town = towns.build(name, seed, params)
    plans: list[ActorPlan] = []
    wanted: list[tuple[Literal["vehicle", "pedestrian"], int, str]] = [
        ("vehicle", vehicles, "vehicle.*"),
        ("pedestrian", pedestrians, "walker.*"),
    ]
    for category, count, glob in wanted:
        spots = list(
            town.spots[category][::2]
        )  # adjacent spawn points are closer to each other than the length of a long vehicle
        for n in range(count):
            stream = Stream(seed, "test", category, str(n))
            if not spots:
                break
            spot = spots.pop(stream.integer(0, len(spots) - 1))
            found = [b for b in blueprints.match(glob) if not b.id.startswith(town.barred)]
            blueprint = stream.choice(found)
            speed = blueprint.default_speed * stream.uniform(0.85, 1.15)
            speed *= 2.7 if name == "highway" and category == "vehicle" else 1.0
            route = town.route(category, spot, speed * seconds * 1.1 + 50.0, stream)
            entry = None
            if name == "highway" and category == "vehicle":
                sign = 1.0 if spot.yaw == 90 else -1.0
                limit = town.streets.bounds[1][1]
                route, entry = (Point(x=spot.x, y=sign * limit),), Pose(x=spot.x, y=-sign * limit, yaw=spot.yaw)
            name_of = f"{category}.{n}"
            plans.append(actors.actor(name_of, blueprint, spot, *route, speed=speed, instance=n + 1, entry=entry))
    return town, plans
