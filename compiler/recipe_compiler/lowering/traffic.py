"""Choices of seeded traffic: how many actors, which blueprints, and which starts a sensor is likely to see.

A start is the position of an actor when the simulation begins, which is the warm-up before frame 0. Whether a sensor
sees an actor is therefore estimated along the route that it would take from there.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Point, Pose
from recipe_compiler.ir.semantic_tags import Category
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints, towns
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering.sensors import arms
from recipe_compiler.schema import scene
from recipe_compiler.schema.camera import Sensor
from recipe_compiler.schema.fields import TRAFFIC_LIMIT
from recipe_compiler.schema.recipe import Base

WARMUP = 10.0  # seconds, where a recipe with moving traffic gives none
_GLOBS = {"vehicle": "vehicle.*", "pedestrian": "walker.pedestrian.*"}
_MEAN_PACE = 0.6  # mean speed of traffic as a part of its desired speed
_NEAR = 4.0  # metres; a nearer actor is no clear sight of a sensor
_FAR = 60.0  # metres; nor is one farther away


@functools.lru_cache(maxsize=8)
def built(name: str, seed: int, parameters: str) -> Town:
    """Return a town; `parameters` are its own, as JSON."""
    return towns.build(name, seed, json.loads(parameters))


@functools.lru_cache(maxsize=10_000)
def _metres(name: str, seed: int, parameters: str) -> tuple[float, float]:
    """Return the lengths of all lanes and of all sidewalks of a town, which outlast it in memory."""
    town = built(name, seed, parameters)
    return town.lane_metres, town.sidewalk_metres


def counts(base: Base) -> dict[Category, int]:
    """Return the numbers of moving vehicles and of pedestrians.

    A density is per kilometre of lane or of sidewalk, at most the most traffic that a recipe may have.
    """
    given, density = base.traffic, base.traffic.density
    if density is None:
        return {"vehicle": given.vehicles, "pedestrian": given.pedestrians}
    spec = base.town
    lanes, sidewalks = _metres(spec.name, spec.seed, json.dumps(spec.model_extra or {}, sort_keys=True))
    vehicles = given.vehicles or math.floor(density.vehicles * lanes / 1000 + 0.5)
    pedestrians = given.pedestrians or math.floor(density.pedestrians * sidewalks / 1000 + 0.5)
    return {"vehicle": min(TRAFFIC_LIMIT, vehicles), "pedestrian": min(TRAFFIC_LIMIT, pedestrians)}


def warmup(base: Base) -> float:
    """Return the seconds that are simulated before frame 0."""
    if base.clock.warmup is not None:
        return base.clock.warmup
    given = base.traffic
    return WARMUP if given.vehicles or given.pedestrians or given.density is not None else 0.0


def blueprint(
    category: Category, traffic: scene.Traffic, town: Town, stream: Stream, own: Sequence[Blueprint] = ()
) -> Blueprint:
    """Draw the blueprint of an actor of the traffic.

    The weight of a glob in `traffic.mix` is shared by the blueprints that it matches. A mix without any blueprint of
    the category, or whose blueprints the town bars, is as if it were absent. `own` are the blueprints of the recipe.
    """
    allowed = [b for b in blueprints.match(_GLOBS[category], own) if not b.id.startswith(town.barred)]
    weights = _weights(allowed, traffic, own)
    if not weights:
        return stream.choice(allowed)
    left = stream.unit() * sum(weight for _, weight in weights)
    for chosen, weight in weights:
        left -= weight
        if left < 0.0:
            return chosen
    return weights[-1][0]


def _weights(
    allowed: Sequence[Blueprint], traffic: scene.Traffic, own: Sequence[Blueprint]
) -> list[tuple[Blueprint, float]]:
    found: dict[str, float] = {}
    names = {b.id for b in allowed}
    for glob, weight in traffic.mix.items():
        matches = [b.id for b in blueprints.match(glob, own) if b.id in names]
        for name in matches:
            found[name] = found.get(name, 0.0) + weight / len(matches)
    return [(b, found[b.id]) for b in allowed if b.id in found]


@dataclass(frozen=True)
class _Look:
    """Where a camera is at a time, in the world frame: metres and the unit vector of its optical axis."""

    seconds: float
    x: float
    y: float
    forward: tuple[float, float]


class SensorView:
    """What a sensor sees of the ground in the course of a clip, without regard to what hides it."""

    def __init__(self, looks: Sequence[_Look], half_angle: float) -> None:
        self._looks = looks
        self._cosine = exact.cos_deg(half_angle)

    @classmethod
    def of(cls, base: Base, sensor: Sensor, carrier: tuple[Pose, Sequence[Point], float] | None) -> SensorView:
        """Return the view of a sensor.

        Args:
            base: The recipe's base.
            sensor: The sensor.
            carrier: Start, route and speed (m/s) of the actor that it is mounted on; None for the world.
        """
        mount, seconds = arms.mount_of(sensor), base.clock.frames / base.clock.fps
        looks = []
        for quarter in range(5):
            at = seconds * quarter / 4
            x, y, yaw = 0.0, 0.0, 0.0
            if carrier is not None:
                start, route, speed = carrier
                x, y, yaw = _along(start, route, _MEAN_PACE * speed * at)
            sine, cosine = exact.sin_cos_deg(yaw)
            world_x, world_y = x + cosine * mount.x - sine * mount.y, y + sine * mount.x + cosine * mount.y
            ahead = exact.sin_cos_deg(yaw + arms.yaw_of(sensor))
            looks.append(_Look(at, world_x, world_y, (ahead[1], ahead[0])))
        return cls(looks, min(85.0, sensor.camera.fov / 2))

    def score(self, start: Pose, route: Sequence[Point], speed: float, warmup: float) -> float:
        """Return how well an actor is likely to be seen: higher is better.

        Args:
            start: Where it begins, `warmup` seconds before frame 0.
            route: Its waypoints after the start.
            speed: Its desired speed, m/s.
            warmup: Seconds.
        """
        total = 0.0
        for look in self._looks:
            x, y, _ = _along(start, route, _MEAN_PACE * speed * (look.seconds + warmup))
            dx, dy = x - look.x, y - look.y
            distance = math.sqrt(dx * dx + dy * dy)
            ahead = dx * look.forward[0] + dy * look.forward[1]
            seen = _NEAR < distance < _FAR and ahead > self._cosine * distance
            total += (1.0 if seen else 0.0) + 0.2 / (1.0 + distance / _FAR)
        return total


def _along(start: Pose, route: Sequence[Point], metres: float) -> tuple[float, float, float]:
    """Return x, y and yaw (degrees) after some metres of a route."""
    x, y, yaw = start.x, start.y, start.yaw
    for point in route:
        dx, dy = point.x - x, point.y - y
        step = math.sqrt(dx * dx + dy * dy)
        if step < 1e-6:
            continue
        yaw = exact.atan2_deg(dy, dx)
        if step >= metres:
            return x + dx * metres / step, y + dy * metres / step, yaw
        x, y, metres = point.x, point.y, metres - step
    return x, y, yaw
