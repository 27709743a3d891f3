"""Computes the pose of a sensor at every frame from its mount, linear motion or route, rotation and jitter.

Jitter is drawn independently for every sensor, frame and axis, uniformly between -m and m, from streams keyed by name,
and does not accumulate. Adding frames or sensors therefore changes no existing pose.
"""

from __future__ import annotations

import math

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element, Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering.sensors.arms import mount_of
from recipe_compiler.lowering.sensors.path import Path
from recipe_compiler.schema.camera import Mount, Sensor
from recipe_compiler.schema.motion import Jitter, Linear, Rotation, Route


class NoRoadError(ValueError):
    """The start of a route along a road is not on one, or the road ends there."""


_ROADS = ("carriageway", "junction", "road")
_AXES = ("x", "y", "z", "yaw", "pitch", "roll")


def poses(name: str, sensor: Sensor, *, seed: int, fps: int, frames: int, town: Town | None = None) -> tuple[Pose, ...]:
    """Return the poses of a sensor in the frame of its mount, or of its arm.

    Args:
        name: the sensor's name, the key of its jitter.
        sensor: the sensor.
        seed: the variant's seed.
        fps: frames per second.
        frames: the number of frames.
        town: the town; only used for routes along its roads.

    Returns:
        One pose if all are equal, else one per frame.

    Raises:
        NoRoadError: the route follows a road, and the mount is not on one.
    """
    motion = sensor.motion
    travel = None if motion.route is None else _Travel(name, sensor, motion.route, seed, (fps, frames), town)
    moves = [
        motion.linear is not None,
        travel is not None,
        motion.rotation is not None,
        motion.jitter is not None and any(getattr(motion.jitter, axis) for axis in _AXES),
    ]
    count = frames if any(moves) else 1
    result = tuple(_pose(name, sensor, frame, frame / fps, seed, travel) for frame in range(count))
    return result[:1] if all(pose == result[0] for pose in result) else result


def _pose(name: str, sensor: Sensor, frame: int, time: float, seed: int, travel: _Travel | None) -> Pose:
    mount, motion = mount_of(sensor), sensor.motion
    values = {axis: getattr(mount, axis) for axis in _AXES}
    if motion.linear is not None:
        values.update(_along(mount, motion.linear, time))
    if travel is not None:
        values.update(travel.at(frame))
    if motion.rotation is not None:
        for axis, angle in _swept(motion.rotation, time).items():
            values[axis] += angle
    if motion.jitter is not None:
        for axis, offset in _shaken(name, motion.jitter, frame, seed).items():
            values[axis] += offset
    return Pose(**values)


class _Travel:
    """The position and yaw of a sensor along its route."""

    def __init__(
        self, name: str, sensor: Sensor, route: Route, seed: int, clip: tuple[int, int], town: Town | None
    ) -> None:
        mount, (fps, frames) = sensor.mount, clip
        self._yaw, self._turns = mount.yaw, route.heading == "along"
        start = mount.x, mount.y, mount.z
        if route.road and town is not None and route.speed is not None:
            stream, length = Stream(seed, "sensor", name, "route"), route.speed * frames / fps
            at = Pose(x=mount.x, y=mount.y, yaw=mount.yaw)
            points = [(point.x, point.y, mount.z) for point in town.route("vehicle", at, length, stream)]
            if not points or not any(_is_on(element, at) for element in town.plan.elements):
                raise NoRoadError
            self._yaw = 0.0  # the mount's is the direction in which it sets out
        else:
            points = route.waypoints(start)
        self._path = Path([start, *points], route.radius, closed=route.loop)
        last = frames if route.loop else max(1, frames - 1)
        self._step = self._path.length / last if route.speed is None else route.speed / fps

    def at(self, frame: int) -> dict[str, float]:
        place = self._path.at(self._step * frame)
        turned = {"yaw": self._yaw + place.yaw} if self._turns else {}
        return {"x": place.x, "y": place.y, "z": place.z, **turned}


def _is_on(element: Element, pose: Pose) -> bool:
    """Whether a pose is over an element of the town, if that is a part of a road."""
    if element.kind not in _ROADS:
        return False
    s, c = exact.sin_cos_deg(element.pose.yaw)
    dx, dy = pose.x - element.pose.x, pose.y - element.pose.y
    return abs(c * dx + s * dy) <= element.size[0] / 2 and abs(c * dy - s * dx) <= element.size[1] / 2


def _along(mount: Mount, linear: Linear, time: float) -> dict[str, float]:
    start = {axis: getattr(mount, axis) for axis in "xyz"}
    end = {axis: start[axis] if (value := getattr(linear.to, axis)) is None else value for axis in "xyz"}
    steps = [end[axis] - start[axis] for axis in "xyz"]
    length = math.sqrt(sum(step * step for step in steps))
    part = min(1.0, linear.speed * time / length) if length > 0 else 1.0
    return {axis: start[axis] + (end[axis] - start[axis]) * part for axis in "xyz"}


def _swept(rotation: Rotation, time: float) -> dict[str, float]:
    wave = exact.sin_deg(360.0 * math.fmod(time, rotation.period) / rotation.period)
    ranges = {axis: getattr(rotation, axis) for axis in ("yaw", "pitch", "roll")}
    return {
        axis: (span[0] + span[1]) / 2 + (span[1] - span[0]) / 2 * wave
        for axis, span in ranges.items()
        if span is not None
    }


def _shaken(name: str, jitter: Jitter, frame: int, seed: int) -> dict[str, float]:
    return {
        axis: Stream(seed, "sensor", name, "jitter", str(frame), axis).uniform(-limit, limit)
        for axis in _AXES
        if (limit := getattr(jitter, axis)) > 0
    }
