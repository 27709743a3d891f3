"""Conversion of OSCAR's SensorController: a sensor that follows the lanes of the town."""

from __future__ import annotations

from recipe_compiler.carla.draft import Data
from recipe_compiler.carla.forms.specs import ANGLES, Spec, Transform
from recipe_compiler.carla.handedness import Pose
from recipe_compiler.carla.report import Node
from recipe_compiler.carla.scene import Scene

_RESOLUTION = 2.0  # metres between waypoints, OSCAR's default
_MAX_SPEED = 100.0  # m/s, the limit of the language


def write(scene: Scene, spec: Spec, to: str) -> dict[str, Data]:
    """Return the motion of a sensor that OSCAR moves to the next waypoint at every picture.

    Args:
        scene: the scene.
        spec: the sensor, with a controller.
        to: the path of the sensor in the recipe.
    """
    assert spec.route is not None
    ledger, options = scene.reader.ledger, spec.route
    if not scene.follows_road(spec):
        for node in (options, None if spec.goal is None else spec.goal.node):
            ledger.ignored(node, "this sensor is attached to an actor, so it does not follow a road")
        return {}
    fps = scene.settings.fps
    node = options.get("sampling_resolution")
    resolution = scene.reader.number(node, 0.01, _MAX_SPEED / fps)
    speed = round((_RESOLUTION if resolution is None else resolution) * fps, 6)
    why = f"one waypoint at every picture, at {fps} frames per second"
    absent = f"a waypoint every {_RESOLUTION:g} metres is OSCAR's default"
    ledger.record(node, f"{to}.motion.route.speed", speed, why, absent)
    for key in ("lane_type", "num_waypoints"):
        ledger.ignored(options.get(key), "the route is along driving lanes, with random turns by seed and name")
    goal = spec.goal or Transform(options, {})
    for axis, number in goal.numbers.items():
        if axis in ("pitch", "roll"):
            value = getattr(goal.pose, axis)
            ledger.mapped(number.node, f"{to}.mount.{axis}", value, "the controller's angle, right-handed")
        elif axis == "yaw":
            ledger.ignored(number.node, "the sensor looks along the road")
        else:
            ledger.ignored(number.node, "the route continues along the road without an end")
    return {"route": {"road": True, "speed": min(speed, _MAX_SPEED)}}


def note_mount(scene: Scene, spec: Spec, pose: Pose, to: str) -> None:
    """Record the outcome of the transform of a sensor that follows a road."""
    ledger, elevation = scene.reader.ledger, elevation_of(spec)
    ledger.kept(elevation, f"{to}.z")
    for axis, number in spec.transform.numbers.items() if spec.transform is not None else ():
        if axis in ANGLES:
            ledger.ignored(number.node, "OSCAR replaces it with the direction of the road")
        elif axis == "z" and elevation is not None:
            ledger.ignored(number.node, "the elevation of the controller replaces it")
        else:
            why = "the nearest spawn point on a lane, after the shift" if axis != "z" else "the height of the route"
            ledger.mapped(number.node, f"{to}.{axis}", getattr(pose, axis), why)


def elevation_of(spec: Spec) -> Node | None:
    """Return the height of a route; None if it is absent or 0, which means the sensor's own height."""
    node = None if spec.route is None else spec.route.get("elevation")
    return None if node is None or not node.value.data else node
