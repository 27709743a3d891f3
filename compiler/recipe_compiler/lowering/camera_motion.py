"""Computes the pose of a sensor at every frame from its mount, linear motion, rotation and jitter.

Jitter is drawn independently for every sensor, frame and axis, uniformly between -m and m, from streams keyed by name,
and does not accumulate. Adding frames or sensors therefore changes no existing pose.
"""

from __future__ import annotations

import math

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.schema.camera import Jitter, Linear, Mount, Rotation, Sensor

_AXES = ("x", "y", "z", "yaw", "pitch", "roll")


def poses(name: str, sensor: Sensor, *, seed: int, fps: int, frames: int) -> tuple[Pose, ...]:
    """Return the poses of a sensor in the frame of its mount.

    Args:
        name: the sensor's name, the key of its jitter.
        sensor: the sensor.
        seed: the variant's seed.
        fps: frames per second.
        frames: the number of frames.

    Returns:
        One pose if all are equal, else one per frame.
    """
    motion = sensor.motion
    moves = [
        motion.linear is not None,
        motion.rotation is not None,
        motion.jitter is not None and any(getattr(motion.jitter, axis) for axis in _AXES),
    ]
    count = frames if any(moves) else 1
    result = tuple(_pose(name, sensor, frame, frame / fps, seed) for frame in range(count))
    return result[:1] if all(pose == result[0] for pose in result) else result


def _pose(name: str, sensor: Sensor, frame: int, time: float, seed: int) -> Pose:
    values = {axis: getattr(sensor.mount, axis) for axis in _AXES}
    motion = sensor.motion
    if motion.linear is not None:
        values.update(_along(sensor.mount, motion.linear, time))
    if motion.rotation is not None:
        for axis, angle in _swept(motion.rotation, time).items():
            values[axis] += angle
    if motion.jitter is not None:
        for axis, offset in _shaken(name, motion.jitter, frame, seed).items():
            values[axis] += offset
    return Pose(**values)


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
