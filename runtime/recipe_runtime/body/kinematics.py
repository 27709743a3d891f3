"""Kinematics of articulated bodies: quaternions and forward kinematics.

Rotations are unit quaternions x, y, z, w, computed with `+ - * /` and `sqrt` alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

from recipe_compiler.ir import exact

from recipe_runtime.body.exact_arrays import Floats
from recipe_runtime.body.skeleton import Joint

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
PartPose = tuple[Vector, Quaternion]  # origin and orientation
Real = TypeVar("Real", float, Floats)  # numbers, or arrays of one shape

IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)


def axis_rotation(axis: str, degrees: float) -> Quaternion:
    """Return the rotation by an angle about the axis "x", "y" or "z"."""
    s, c = exact.sin_cos_deg(degrees / 2.0)
    return (s * (axis == "x"), s * (axis == "y"), s * (axis == "z"), c)


def compose(
    first: tuple[Real, Real, Real, Real], second: tuple[Real, Real, Real, Real]
) -> tuple[Real, Real, Real, Real]:
    """Return the Hamilton product first * second: `second` is relative to the axes that `first` rotated."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate(rotation: tuple[Real, Real, Real, Real], v: tuple[Real, Real, Real]) -> tuple[Real, Real, Real]:
    """Rotate a vector."""
    x, y, z, w = rotation
    a, b, c = v
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx)


def inverse(rotation: tuple[Real, Real, Real, Real]) -> tuple[Real, Real, Real, Real]:
    """Return the inverse of a rotation."""
    x, y, z, w = rotation
    return (-x, -y, -z, w)


def forward_kinematics(base: PartPose, joints: Sequence[Joint], rotations: Sequence[Quaternion]) -> list[PartPose]:
    """Return the pose of the base and of the part of every joint.

    Args:
        base: Pose of the base part, in the world frame.
        joints: Joints in an order in which parents come first.
        rotations: Rotation of each joint, relative to its parent.
    """
    name = "" if not joints else joints[0].parent
    poses: dict[str, PartPose] = {name: base}
    for joint, rotation in zip(joints, rotations, strict=True):
        (px, py, pz), orientation = poses[joint.parent]
        dx, dy, dz = rotate(orientation, joint.offset)
        poses[joint.part] = ((px + dx, py + dy, pz + dz), compose(orientation, rotation))
    return list(poses.values())


def quaternion_of_matrix(r: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Convert a rotation matrix [3, 3] to a unit quaternion w, x, y, z; the first component that is not 0 is positive.

    By Shepperd's method (Journal of Guidance and Control 1, 1978): the largest component first, by a square root.
    """
    squares = (  # four times each component's square
        1.0 + r[0][0] + r[1][1] + r[2][2],
        1.0 + r[0][0] - r[1][1] - r[2][2],
        1.0 - r[0][0] + r[1][1] - r[2][2],
        1.0 - r[0][0] - r[1][1] + r[2][2],
    )
    a, b, c = r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]
    d, e, f = r[1][0] + r[0][1], r[0][2] + r[2][0], r[2][1] + r[1][2]
    products = ((squares[0], a, b, c), (a, squares[1], d, e), (b, d, squares[2], f), (c, e, f, squares[3]))
    w, x, y, z = products[squares.index(max(squares))]  # four times that component, times each
    length = math.sqrt(w * w + x * x + y * y + z * z)
    sign = -1.0 if next(v for v in (w, x, y, z) if v != 0.0) < 0.0 else 1.0
    return sign * w / length, sign * x / length, sign * y / length, sign * z / length
