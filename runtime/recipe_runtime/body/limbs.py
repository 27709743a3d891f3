"""Inverse kinematics of two-bone limbs, over arrays. The bones point along -z at rest."""

from __future__ import annotations

import numpy as np

from recipe_runtime.body.exact_arrays import Floats
from recipe_runtime.body.kinematics import compose, inverse
from recipe_runtime.body.poses import Components3, Components4


def two_bone_ik(
    target: Components3, upper: Floats, lower: Floats, pole: Components3, *, knee: bool
) -> tuple[Components4, Components4]:
    """Return the rotations of the two joints of limbs that bring their ends to `target`.

    A target out of reach is approached as far as the limb extends.

    Args:
        target: Positions of the ends, relative to the roots of the limbs, metres.
        upper: Lengths of the upper bones, metres.
        lower: Lengths of the lower bones, metres.
        pole: Directions that the middle joints bend towards.
        knee: Whether the lower bone folds backwards, as at a knee, or forwards, as at an elbow.
    """
    tx, ty, tz = target
    reach = np.sqrt(tx * tx + ty * ty + tz * tz)
    u = (tx / reach, ty / reach, tz / reach)
    along = u[0] * pole[0] + u[1] * pole[1] + u[2] * pole[2]
    w = _normalized((pole[0] - along * u[0], pole[1] - along * u[1], pole[2] - along * u[2]))
    reach = np.minimum(reach, 0.999 * (upper + lower))
    cosine = (upper * upper + reach * reach - lower * lower) / (2.0 * upper * reach)
    cosine = np.maximum(-1.0, np.minimum(1.0, cosine))
    sine = np.sqrt(1.0 - cosine * cosine)
    ax, ay, az = (cosine * u[k] + sine * w[k] for k in range(3))
    bx, by, bz = ((reach * u[k] - upper * a) / lower for k, a in enumerate((ax, ay, az)))
    hinge = _cross(w, u) if knee else _cross(u, w)
    above = _bone_rotation((ax, ay, az), hinge)
    return above, compose(inverse(above), _bone_rotation((bx, by, bz), hinge))


def _bone_rotation(bone: Components3, hinge: Components3) -> Components4:
    """Return the orientations whose -z axis is a bone and whose y axis is its hinge."""
    z = (-bone[0], -bone[1], -bone[2])
    return _of_axes(_cross(hinge, z), hinge, z)


def _of_axes(x: Components3, y: Components3, z: Components3) -> Components4:
    """Return the unit quaternions of rotation matrices with given columns, as `kinematics.quaternion_of_matrix`."""
    squares = (
        1.0 + x[0] + y[1] + z[2],
        1.0 + x[0] - y[1] - z[2],
        1.0 - x[0] + y[1] - z[2],
        1.0 - x[0] - y[1] + z[2],
    )
    largest = np.stack(squares).argmax(0)
    a, b, c = y[2] - z[1], z[0] - x[2], x[1] - y[0]
    d, e, f = x[1] + y[0], z[0] + x[2], z[1] + y[2]
    qw = np.choose(largest, (squares[0], a, b, c))
    qx = np.choose(largest, (a, squares[1], d, e))
    qy = np.choose(largest, (b, d, squares[2], f))
    qz = np.choose(largest, (c, e, f, squares[3]))
    length = np.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    first = np.where(qw != 0.0, qw, np.where(qx != 0.0, qx, np.where(qy != 0.0, qy, qz)))
    length = np.where(first < 0.0, -length, length)
    return qx / length, qy / length, qz / length, qw / length


def _cross(a: Components3, b: Components3) -> Components3:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _normalized(v: Components3) -> Components3:
    size = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return v[0] / size, v[1] / size, v[2] / size
