"""Kinematics of articulated bodies: quaternions, forward kinematics, and inverse kinematics of two-bone limbs.

Rotations are unit quaternions x, y, z, w, computed with `+ - * /` and `sqrt` alone. The bones of a limb point along -z
at rest.
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


def inverse(rotation: Quaternion) -> Quaternion:
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


def two_bone_ik(
    target: Sequence[float], upper: float, lower: float, pole: Sequence[float], *, knee: bool
) -> tuple[Quaternion, Quaternion]:
    """Return the rotations of a limb's two joints that bring its end to `target`.

    A target out of reach is approached as far as the limb extends.

    Args:
        target: Position of the end, relative to the root of the limb, metres.
        upper: Length of the upper bone, metres.
        lower: Length of the lower bone, metres.
        pole: Direction that the middle joint bends towards.
        knee: Whether the lower bone folds backwards, as at a knee, or forwards, as at an elbow.
    """
    tx, ty, tz = target
    reach = math.sqrt(tx * tx + ty * ty + tz * tz)
    u = (tx / reach, ty / reach, tz / reach)
    along = u[0] * pole[0] + u[1] * pole[1] + u[2] * pole[2]
    w = _normalize((pole[0] - along * u[0], pole[1] - along * u[1], pole[2] - along * u[2]))
    reach = min(reach, 0.999 * (upper + lower))
    cosine = max(-1.0, min(1.0, (upper * upper + reach * reach - lower * lower) / (2.0 * upper * reach)))
    sine = math.sqrt(1.0 - cosine * cosine)
    first = tuple(cosine * u[k] + sine * w[k] for k in range(3))
    second = tuple((reach * u[k] - upper * first[k]) / lower for k in range(3))
    hinge = _cross(w, u) if knee else _cross(u, w)
    above = _bone_rotation(first, hinge)
    return above, compose(inverse(above), _bone_rotation(second, hinge))


def _bone_rotation(bone: Sequence[float], hinge: Sequence[float]) -> Quaternion:
    """Return the orientation whose -z axis is a bone and whose y axis is its hinge."""
    z = (-bone[0], -bone[1], -bone[2])
    x = _cross(hinge, z)
    rows = [[x[k], hinge[k], z[k]] for k in range(3)]
    qw, qx, qy, qz = quaternion_of_matrix(rows)
    return qx, qy, qz, qw


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _normalize(v: Vector) -> Vector:
    size = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return (v[0] / size, v[1] / size, v[2] / size)


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
