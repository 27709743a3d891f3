"""Rigid transforms as float64 arrays [..., 3, 4], made with exact arithmetic only.

Products are written out term by term: `@` and `dot` go through BLAS, whose order of additions depends on the CPU.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose, SensorPlan

from recipe_runtime.core.trace import METRE, UNIT, Trace

Array = NDArray[np.float64]


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


def part_transforms(trace: Trace, frame: int | slice | NDArray[np.intp]) -> Array:
    """World-from-part of every part of the Trace at a frame, or at many. Shape [P, 3, 4] or [F, P, 3, 4]."""
    p = trace.positions[frame].astype(np.float64) / METRE
    q = trace.rotations[frame].astype(np.float64) / UNIT
    trace.release()
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    s = 2.0 / (x * x + y * y + z * z + w * w)
    rows = [
        [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w), p[..., 0]],
        [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w), p[..., 1]],
        [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y), p[..., 2]],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def sensor_transform(sensor: SensorPlan, trace: Trace, frame: int) -> Array:
    """World-from-sensor (x forward, y left, z up) at a frame. Shape [3, 4]."""
    local = from_pose(sensor.pose(frame))
    if sensor.on is None:
        return local
    return compose(part_transforms(trace, frame)[trace.base_part(sensor.on)], local)
