"""Warns of values that are valid and improbable: running at 40 m/s, a field of view in radians, a camera in a car."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import ActorPlan, Pose, RigPlan
from recipe_compiler.ir.weather import PARAMETERS
from recipe_compiler.source.yaml_reader import Value

# Percentages, but not those for which CARLA itself has values up to 1.
_PERCENT = [n for n, p in PARAMETERS.items() if p.high == 100 and not (0 < p.engine <= 1 or 0 < p.usual <= 1)]
FASTEST_RUNNER = 12.5  # m/s
_DEGREES = 57.29577951308232  # of a radian
NARROWEST = 5.0  # degrees; smaller fields of view are telescopes, or radians
_CABINS = {"van": 0.22, "bus": 0.42, "truck": 0.42}  # how far it reaches ahead of the middle, per length of the body
_CABIN = 0.14  # the same, of other bodies: well behind any windscreen
_HOOD = 0.5  # its height, as a fraction of the whole


def of_speeds(base: Value, actors: Iterable[ActorPlan]) -> Iterator[Problem]:
    """Yield warnings for pedestrians that are faster than any runner."""
    for actor in actors:
        if actor.category == "pedestrian" and actor.speed > FASTEST_RUNNER:
            message = f"actors.{actor.name}.speed: no pedestrian runs at {actor.speed:g} m/s"
            place = base.place_of("actors", actor.name, "speed")
            yield Problem(message, place, "walking is 1 to 2 m/s, running is 3 to 10 m/s", Code.IMPLAUSIBLE)


def of_weather(root: Value) -> Iterator[Problem]:
    """Yield warnings for percentages of weather between 0 and 1, as base and deltas have them; draws are left out."""
    base, deltas = root.get("base"), root.get("deltas")
    layers = [] if base is None else [base]
    layers += [delta for values in deltas.map.values() for delta in values.map.values()] if deltas is not None else []
    for layer in layers:
        for name in _PERCENT:
            value = layer.get("weather", name)
            if value is not None and isinstance(value.data, float) and 0.0 < value.data < 1.0:
                message = f"weather.{name}: {value.data:g} is very little: CARLA's scale is 0 to 100"
                remedy = f"write {value.data * 100.0:g} if it is a fraction of 1"
                yield Problem(message, value.place, remedy, Code.IMPLAUSIBLE)


def of_views(base: Value, rig: RigPlan, actors: Iterable[ActorPlan], frames: int) -> Iterator[Problem]:
    """Yield warnings for cameras inside their carriers, with one frame, or with a very small field of view.

    Args:
        base: the recipe's base, for the places of its values.
        rig: the sensors and their poses.
        actors: the actors of the scene.
        frames: the number of frames of the clip.
    """
    carriers = {actor.name: actor for actor in actors}
    for sensor in rig.sensors:
        fov, carrier = sensor.camera.fov, carriers.get(sensor.on or "")
        if fov < NARROWEST:
            message = f"sensors.{sensor.name}.camera.fov: {fov:g} degrees is a very small field of view"
            place = base.place_of("sensors", sensor.name, "camera", "fov")
            remedy = f"write {fov * _DEGREES:.1f} if it is in radians" if fov <= math.pi else "write a larger one"
            yield Problem(message, place, remedy, Code.IMPLAUSIBLE)
        if sensor.interval >= frames > 1:
            message = f"sensors.{sensor.name}.tick: the clip is over before a second picture"
            place = base.place_of("sensors", sensor.name, "tick")
            yield Problem(message, place, "write the seconds from one picture to the next", Code.IMPLAUSIBLE)
        if carrier is not None and sensor.arm is None and any(_is_inside(carrier, pose) for pose in sensor.poses[:1]):
            message = f"sensors.{sensor.name}: it is inside {carrier.name}, the actor that it is mounted on"
            place = base.place_of("sensors", sensor.name, "mount")
            yield Problem(message, place, _remedy(carrier), Code.PLACEMENT)


def _is_inside(actor: ActorPlan, pose: Pose) -> bool:
    """Whether a pose in an actor's frame is inside its body. Poses near the surface count as outside."""
    shape = actor.shape
    if actor.category == "pedestrian":
        return abs(pose.x) < 0.1 and abs(pose.y) < 0.15 and 0.0 < pose.z < shape["height"]
    if "rider" in shape:
        return abs(pose.x) < 0.2 and abs(pose.y) < 0.12 and 0.4 < pose.z < 0.9 * shape["height"]
    if abs(pose.y) > 0.4 * shape["width"] or not shape["clearance"] < pose.z < 0.93 * shape["height"]:
        return False
    front = _CABINS.get(actor.blueprint.split(".")[1], _CABIN) * shape["length"]
    is_below_hood = pose.z < _HOOD * shape["height"] and pose.x < 0.42 * shape["length"]
    return -0.4 * shape["length"] < pose.x and (pose.x < front or is_below_hood)


def _remedy(carrier: ActorPlan) -> str:
    if carrier.category == "pedestrian":
        return "move the mount ahead of the face, such as x: 0.3"
    return f"`recipe blueprints {carrier.blueprint}` prints a mount that sees the road, as dashcam"
