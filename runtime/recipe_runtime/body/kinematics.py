"""Where a body's parts are: turns of its joints, and the way from its base to every part.

Turns are unit quaternions x, y, z, w, made with `+ - * /` and `sqrt` alone. Limbs of two bones hang along -z at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact

from recipe_runtime.body.skeleton import Joint

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Placed = tuple[Vector, Quaternion]  # a part's origin and orientation in the world

STILL: Quaternion = (0.0, 0.0, 0.0, 1.0)


def about(axis: str, degrees: float) -> Quaternion:
    """A turn about "x", "y" or "z"."""
    s, c = exact.sin_cos_deg(degrees / 2.0)
    return (s * (axis == "x"), s * (axis == "y"), s * (axis == "z"), c)


def then(first: Quaternion, second: Quaternion) -> Quaternion:
    """The turn `first`, and `second` about the axes so turned: the product first * second."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turned(turn: Quaternion, v: Sequence[float]) -> Vector:
    """A vector after a turn."""
    x, y, z, w = turn
    a, b, c = v
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx)


def back(turn: Quaternion) -> Quaternion:
    """The turn that undoes it."""
    x, y, z, w = turn
    return (-x, -y, -z, w)


def place(base: Placed, joints: Sequence[Joint], turns: Sequence[Quaternion]) -> list[Placed]:
    """The base and then every joint's part in the world; `turns` are the joints', each about its parent's axes."""
    name = "" if not joints else joints[0].parent
    found: dict[str, Placed] = {name: base}
    for joint, turn in zip(joints, turns, strict=True):
        (px, py, pz), orientation = found[joint.parent]
        dx, dy, dz = turned(orientation, joint.offset)
        found[joint.part] = ((px + dx, py + dy, pz + dz), then(orientation, turn))
    return list(found.values())


def limb(
    target: Sequence[float], upper: float, lower: float, pole: Sequence[float], *, knee: bool
) -> tuple[Quaternion, Quaternion]:
    """Turns of a limb's two joints that bring its end to `target`, seen from its root; it bends towards `pole`.

    A target out of reach is taken as near as the limb comes. A knee's lower bone folds back, an elbow's forward.
    """
    tx, ty, tz = target
    reach = math.sqrt(tx * tx + ty * ty + tz * tz)
    u = (tx / reach, ty / reach, tz / reach)
    along = u[0] * pole[0] + u[1] * pole[1] + u[2] * pole[2]
    w = _unit((pole[0] - along * u[0], pole[1] - along * u[1], pole[2] - along * u[2]))
    reach = min(reach, 0.999 * (upper + lower))
    cosine = max(-1.0, min(1.0, (upper * upper + reach * reach - lower * lower) / (2.0 * upper * reach)))
    sine = math.sqrt(1.0 - cosine * cosine)
    first = tuple(cosine * u[k] + sine * w[k] for k in range(3))
    second = tuple((reach * u[k] - upper * first[k]) / lower for k in range(3))
    hinge = _cross(w, u) if knee else _cross(u, w)
    above = _hanging(first, hinge)
    return above, then(back(above), _hanging(second, hinge))


def _hanging(bone: Sequence[float], hinge: Sequence[float]) -> Quaternion:
    """The orientation whose -z runs along a bone and whose y along its hinge."""
    z = (-bone[0], -bone[1], -bone[2])
    x = _cross(hinge, z)
    rows = [[x[k], hinge[k], z[k]] for k in range(3)]
    qw, qx, qy, qz = of_rotation(rows)
    return qx, qy, qz, qw


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(v: Vector) -> Vector:
    size = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return (v[0] / size, v[1] / size, v[2] / size)


def of_rotation(r: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """A rotation matrix as a unit quaternion w, x, y, z; the first that is not 0 is positive.

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
