"""Rigid transforms as float64 arrays [..., 3, 4], made with exact arithmetic only.

Products are written out term by term: `@` and `dot` go through BLAS, whose order of additions depends on the CPU.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose, SensorPlan
from recipe_compiler.ir.rig import arm

from recipe_runtime.core.trace import METRE, UNIT, Trace

Array = NDArray[np.float64]

# Camera x right, y down, z forward, from sensor x forward, y left, z up; and the reverse.
VIEW_FROM_SENSOR = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
SENSOR_FROM_VIEW = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0]])


def compose(a: Array, b: Array) -> Array:
    """The transform that applies b, then a. Shapes broadcast over leading axes."""
    out = a[..., :, 0:1] * b[..., 0:1, :] + a[..., :, 1:2] * b[..., 1:2, :] + a[..., :, 2:3] * b[..., 2:3, :]
    out[..., :, 3] += a[..., :, 3]
    return out


def invert(a: Array) -> Array:
    """The inverse of a rigid transform: transposed rotation, moved-back origin."""
    rotation = np.swapaxes(a[..., :3], -1, -2)
    t = a[..., 3]
    origin = rotation[..., :, 0] * t[..., 0:1] + rotation[..., :, 1] * t[..., 1:2] + rotation[..., :, 2] * t[..., 2:3]
    return np.concatenate([rotation, -origin[..., None]], axis=-1)


def from_pose(pose: Pose) -> Array:
    """World-from-body of a plan's pose: R = Rz(yaw) Ry(pitch) Rx(roll), then the position. Shape [3, 4]."""
    sy, cy = exact.sin_cos_deg(pose.yaw)
    sp, cp = exact.sin_cos_deg(pose.pitch)
    sr, cr = exact.sin_cos_deg(pose.roll)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, pose.x],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, pose.y],
            [-sp, cp * sr, cp * cr, pose.z],
        ]
    )


def rigid_transform(position: Sequence[float], rotation: Sequence[float]) -> Array:
    """The transform of a position [3] and a quaternion x, y, z, w, which need not have unit length. Shape [3, 4]."""
    return _of_quaternions(np.array(position, np.float64), np.array(rotation, np.float64))


def transform_points(transform: Array, points: Array) -> Array:
    """Apply transforms [..., 3, 4] to points [..., N, 3]."""
    t = transform[..., None, :, :]
    x, y, z = points[..., 0:1], points[..., 1:2], points[..., 2:3]
    moved: Array = t[..., 0] * x + t[..., 1] * y + t[..., 2] * z + t[..., 3]
    return moved


def part_transforms(trace: Trace, frame: int | slice | NDArray[np.intp]) -> Array:
    """World-from-part of every part of the Trace at a frame, or at many. Shape [P, 3, 4] or [F, P, 3, 4]."""
    made = _transforms(trace.positions[frame], trace.rotations[frame])
    trace.release()
    return made


def _transforms(positions: NDArray[np.int64], rotations: NDArray[np.int32]) -> Array:
    """Transforms [..., 3, 4] of a Trace's positions [..., 3] and rotations [..., 4]."""
    return _of_quaternions(positions.astype(np.float64) / METRE, rotations.astype(np.float64) / UNIT)


def _of_quaternions(p: Array, q: Array) -> Array:
    """Transforms [..., 3, 4] of positions [..., 3] and quaternions x, y, z, w [..., 4]."""
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    s = 2.0 / (x * x + y * y + z * z + w * w)
    rows = [
        [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w), p[..., 0]],
        [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w), p[..., 1]],
        [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y), p[..., 2]],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def sensor_transform(sensor: SensorPlan, trace: Trace, frame: int) -> Array:
    """World-from-sensor (x forward, y left, z up) at a frame. Shape [3, 4].

    At the end of an arm it depends on the motion of the sensor's actor up to that frame, else on no other frame.
    """
    pose = sensor.pose(frame)
    if sensor.on is None:
        return from_pose(pose)
    if sensor.arm is None:
        return compose(part_transforms(trace, frame)[trace.base_part(sensor.on)], from_pose(pose))
    part, first = trace.base_part(sensor.on), arm.first_frame(frame, sensor.arm.decay)
    frames = np.array([0, frame]) if sensor.arm.decay >= 1.0 else np.arange(first, frame + 1)
    bases = _transforms(trace.positions[frames, part], trace.rotations[frames, part])
    trace.release()
    ahead = arm.heading([_level(x, y) for x, y in bases[:, :2, 0].tolist()], sensor.arm.decay)
    x, y, z = bases[-1, :, 3].tolist()
    end = np.array(arm.end_frame((x, y, z), ahead, (pose.x, pose.y, pose.z), sensor.arm.obstacles))
    return compose(end, from_pose(Pose(yaw=pose.yaw, pitch=pose.pitch, roll=pose.roll)))


def _level(x: float, y: float) -> tuple[float, float]:
    """The horizontal direction of a vector; +x for a vertical one."""
    length = math.sqrt(x * x + y * y)
    return (x / length, y / length) if length > 0.0 else (1.0, 0.0)
