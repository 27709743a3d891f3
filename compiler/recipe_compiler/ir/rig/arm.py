"""The pose at the end of an arm that is attached to an actor: a spring arm, or the line of sight of a follower.

The arm starts `PIVOT` above the actor's origin and stays level: it turns about the vertical with the actor's heading,
smoothed over earlier frames, and neither rolls nor pitches with it. The sensor at its end looks along it at its start.
Only IEEE `+ - * /` and `sqrt` are used, so the pose is the same on every machine. Lengths are in metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.rig.plan import BoxPlan

PIVOT = 1.0  # height of the arm's start above the actor's origin
CLEARANCE = 0.3  # from the end of a shortened arm to the obstacle, along the arm
_FORGOTTEN = 40.0  # time constants after which a heading has a weight below 1e-17
_SMALL = 1e-9

Direction = tuple[float, float]  # a horizontal unit vector
Vector = tuple[float, float, float]
Row = tuple[float, float, float, float]


def history(decay: float) -> int:
    """Return the number of earlier frames whose headings count, in a clip without end; 0 if the first one counts."""
    return math.ceil(_FORGOTTEN / -exact.log(decay)) if 0.0 < decay < 1.0 else 0


def first_frame(frame: int, decay: float) -> int:
    """Return the earliest frame whose heading counts at a frame."""
    if decay >= 1.0:
        return 0
    if decay <= 0.0:
        return frame
    return max(0, frame - history(decay))


def heading(directions: Sequence[Direction], decay: float) -> Direction:
    """Return an actor's smoothed heading: the mean of its headings, which count `decay` times less for every frame.

    The actor is taken to have had the first heading ever before.

    Args:
        directions: its headings at consecutive frames, the current one last.
        decay: from 0, the current heading, to 1, the first.
    """
    x, y = directions[0]
    for ahead_x, ahead_y in directions[1:]:
        x, y = decay * x + (1.0 - decay) * ahead_x, decay * y + (1.0 - decay) * ahead_y
    length = math.sqrt(x * x + y * y)
    return (x / length, y / length) if length > _SMALL else directions[-1]


def end_frame(origin: Vector, ahead: Direction, offset: Vector, obstacles: Iterable[BoxPlan]) -> tuple[Row, Row, Row]:
    """Return the frame at the end of an arm: x towards its start, y horizontal to the left, z up.

    Args:
        origin: the actor's origin in the world.
        ahead: the actor's smoothed heading.
        offset: the end of the full arm, relative to `origin`: forward along `ahead`, to the left, up.
        obstacles: the boxes that shorten it.

    Returns:
        The rows of the transform world-from-frame, 3x4.
    """
    pivot = origin[0], origin[1], origin[2] + PIVOT
    forward, left, up = offset
    span = ahead[0] * forward - ahead[1] * left, ahead[1] * forward + ahead[0] * left, up - PIVOT
    part = free_part(pivot, span, obstacles)
    end = tuple(a + part * b for a, b in zip(pivot, span, strict=True))
    x_axis = _unit((-span[0], -span[1], -span[2]), (ahead[0], ahead[1], 0.0))
    y_axis = _unit((-x_axis[1], x_axis[0], 0.0), (-ahead[1], ahead[0], 0.0))
    z_axis = _cross(x_axis, y_axis)
    first, second, third = ((x_axis[axis], y_axis[axis], z_axis[axis], end[axis]) for axis in range(3))
    return first, second, third


def free_part(pivot: Vector, span: Vector, obstacles: Iterable[BoxPlan]) -> float:
    """Return the part of an arm, 0 to 1, that ends `CLEARANCE` before the first box that the arm enters.

    A box that contains the arm's start does not shorten it.
    """
    length = math.sqrt(span[0] * span[0] + span[1] * span[1] + span[2] * span[2])
    if length <= _SMALL:
        return 1.0
    entered = min((entry(box, pivot, span) for box in obstacles), default=math.inf)
    return min(1.0, max(0.0, entered - CLEARANCE / length))


def entry(box: BoxPlan, start: Vector, span: Vector) -> float:
    """Return the part of a line segment, 0 to 1, before it enters a box; infinity if it does not, or starts inside."""
    reach = abs(box.size[0]) + abs(box.size[1]) + abs(span[0]) + abs(span[1])
    dx, dy = start[0] - box.x, start[1] - box.y
    if abs(dx) > reach or abs(dy) > reach:
        return math.inf
    s, c = exact.sin_cos_deg(box.yaw)
    sides = (
        (c * dx + s * dy, c * span[0] + s * span[1], box.size[0] / 2),
        (c * dy - s * dx, c * span[1] - s * span[0], box.size[1] / 2),
        (start[2] - box.z - box.size[2] / 2, span[2], box.size[2] / 2),
    )
    low, high = -math.inf, 1.0
    for at, step, half in sides:
        if abs(step) < _SMALL:
            if abs(at) >= half:
                return math.inf
            continue
        a, b = (-half - at) / step, (half - at) / step
        low, high = max(low, min(a, b)), min(high, max(a, b))
        if low >= high:
            return math.inf
    return low if low >= 0.0 else math.inf


def _unit(vector: Vector, otherwise: Vector) -> Vector:
    x, y, z = vector
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > _SMALL else otherwise


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
