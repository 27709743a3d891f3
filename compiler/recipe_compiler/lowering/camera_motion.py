"""A rig's poses, frame by frame: linear motion, rotation and jitter, together.

Jitter is drawn per rig, frame and axis from streams keyed by name, uniform between -m and m, so its mean is zero
whatever the number of frames; it is added to the frame's own pose and never carried on to the next. So more frames
change no earlier pose, and another sensor's jitter shares nothing with this one's.
"""

from __future__ import annotations

import math

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.schema.camera import Jitter, Linear, Mount, Rotation, Sensor

_AXES = ("x", "y", "z", "yaw", "pitch", "roll")


def poses(name: str, sensor: Sensor, *, seed: int, fps: int, frames: int) -> tuple[Pose, ...]:
    """The poses of a rig in its mount's frame: one if it never moves, else one a frame."""
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
