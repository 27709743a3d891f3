"""Swept paths: the area that a vehicle covers in a junction, and the intersections of two of them.

A body is a row of circles that together cover its rectangle. It moves as `simulation.vehicle` steers: with the front
axle on the path in a bend to the left, where the rear cuts in, and with the rear axle on the path in a bend to the
right, where the front swings out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.body.skeleton import axle_shift
from recipe_runtime.simulation.path import Path, Point
from recipe_runtime.simulation.traffic.protocols import Body

Turn = Literal["straight", "left", "right"]
_POSE_STEP, _TRACTRIX_STEP = 1.0, 0.25  # metres along the path
_SLICE, _LONG_SLICE = 0.6, 1.0  # metres of a body that one circle covers, and of one longer than a van
_VAN = 5.6  # metres
MARGIN = 0.3  # metres that two bodies keep apart
_FAR = 25.0  # metres from a junction's middle beyond which nothing is touched


@dataclass(frozen=True, slots=True)
class Overlap:
    """The intersection of two movements: metres of each body's middle from its own stop line."""

    first: float
    last: float
    other_first: float
    other_last: float


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """One path through a junction for vehicles of one size, relative to the junction's middle.

    Row k of `x` and `y` are the circles of the body when its middle is `start + k` metres behind the stop line.
    """

    number: int
    turn: Turn
    start: float  # metres of the body's middle from the stop line; negative before it
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    radius: float

    def overlap(self, other: Movement) -> Overlap | None:
        """Return the intersection with another movement at the same junction; None if there is none."""
        reach = self.radius + other.radius + MARGIN
        dx = self.x.reshape(-1, 1) - other.x.reshape(1, -1)
        dy = self.y.reshape(-1, 1) - other.y.reshape(1, -1)
        hits = dx * dx + dy * dy < reach * reach
        mine = np.flatnonzero(hits.any(axis=1))
        if not len(mine):
            return None
        theirs = np.flatnonzero(hits.any(axis=0))
        a, b = self.x.shape[1], other.x.shape[1]
        return Overlap(
            self.start + _POSE_STEP * int(mine[0] // a),
            self.start + _POSE_STEP * int(mine[-1] // a),
            other.start + _POSE_STEP * int(theirs[0] // b),
            other.start + _POSE_STEP * int(theirs[-1] // b),
        )

    def first_contact(self, x: float, y: float, radius: float, after: float) -> float | None:
        """Return the position at which the body would first touch a circle.

        Args:
            x: The circle's middle, about the junction's.
            y: The same along y.
            radius: The circle's radius in metres.
            after: Metres of the body's middle from the stop line, from which it goes on.

        Returns:
            Metres of the body's middle from the stop line; None if it touches the circle nowhere.
        """
        row = max(0, int((after - self.start) / _POSE_STEP))
        dx, dy, reach = self.x[row:] - x, self.y[row:] - y, self.radius + radius
        rows = np.flatnonzero((dx * dx + dy * dy < reach * reach).any(axis=1))
        return self.start + _POSE_STEP * (row + int(rows[0])) if len(rows) else None

    def first_touch(self, body: Body, middle: Point, after: float, margin: float = 0.0) -> float | None:
        """Return the position at which the body would first touch a stationary vehicle.

        Args:
            body: The vehicle; three circles stand for it.
            middle: The junction's middle in the world frame.
            after: Metres of the moving body's middle from the stop line, from which it goes on.
            margin: Metres to keep from the circles, beyond which the corners of the vehicle reach by up to 0.5.

        Returns:
            Metres of the moving body's middle from the stop line; None if it touches the vehicle nowhere.
        """
        first: float | None = None
        for k in (-1.0, 0.0, 1.0):
            x = body.x + k * (body.reach - body.radius) * body.heading[0] - middle[0]
            y = body.y + k * (body.reach - body.radius) * body.heading[1] - middle[1]
            if abs(x) > _FAR or abs(y) > _FAR:
                continue
            contact = self.first_contact(x, y, body.radius + margin, after)
            if contact is not None and (first is None or contact < first):
                first = contact
        return first

    def reach_into(self, direction: Point, lane: tuple[float, float]) -> float:
        """Return how far from the junction's middle the body reaches in a lane that leads to it.

        Args:
            direction: The direction of travel in the lane.
            lane: Its left and right edge, metres to the right of the junction's middle.

        Returns:
            Metres against the direction of travel; minus infinity if the body does not touch the lane.
        """
        out = -(self.x * direction[0] + self.y * direction[1])
        right = self.x * direction[1] - self.y * direction[0]
        beside = np.maximum(np.maximum(lane[0] - right, right - lane[1]), 0.0)
        touching = beside < self.radius
        if not touching.any():
            return -math.inf
        depth = out + np.sqrt(np.maximum(self.radius * self.radius - beside * beside, 0.0))
        return float(depth[touching].max())


def turn_of(before: Point, after: Point) -> Turn:
    """Return the turn between two unit vectors."""
    sine = before[0] * after[1] - before[1] * after[0]
    if abs(sine) < 0.5:
        return "straight" if before[0] * after[0] + before[1] * after[1] > 0.0 else "left"
    return "left" if sine > 0.0 else "right"


def sweep(
    number: int, path: Path, span: tuple[float, float], middle: Point, shape: Mapping[str, float], offset: float
) -> Movement:
    """Return the movement of a vehicle along a part of its path.

    Args:
        number: A number for the movement.
        path: The vehicle's path.
        span: Arc lengths at the stop line and where the junction ends.
        middle: The junction's middle in the world frame.
        shape: The vehicle's shape.
        offset: Metres to the left of the path at which it drives.
    """
    entry, leave = span
    turn = turn_of(path.tangent(entry), path.tangent(leave))
    half, width = shape["length"] / 2, shape["width"]
    count = max(2, math.ceil(shape["length"] / (_SLICE if shape["length"] < _VAN else _LONG_SLICE)))
    piece = shape["length"] / count
    rows = int((leave - entry + 2.0 * half) / _POSE_STEP) + 2
    poses = _poses(path, entry - half, rows, shape, offset, rear=turn == "right")
    places = [-half + piece * (k + 0.5) for k in range(count)]
    x = [[px - middle[0] + hx * u for u in places] for px, _, hx, _ in poses]
    y = [[py - middle[1] + hy * u for u in places] for _, py, _, hy in poses]
    radius = math.sqrt(width * width / 4.0 + piece * piece / 4.0)
    return Movement(number, turn, -half, np.array(x), np.array(y), radius)


def _poses(
    path: Path, start: float, rows: int, shape: Mapping[str, float], offset: float, *, rear: bool
) -> list[tuple[float, float, float, float]]:
    """Return middle and heading at each step, the middle first at arc length `start`."""
    base, shift = shape["wheelbase"], axle_shift(shape)
    behind, ahead = base / 2 - shift, base / 2 + shift  # from the middle to the axles
    poses = []
    if rear:
        for k in range(rows):
            x, y, (hx, hy) = _beside(path, start + _POSE_STEP * k - behind, offset)
            poses.append((x + behind * hx, y + behind * hy, hx, hy))
        return poses
    per_row = int(_POSE_STEP / _TRACTRIX_STEP)
    fx, fy, (hx, hy) = _beside(path, start + ahead, offset)
    for k in range(rows * per_row):
        rx, ry = fx - base * hx, fy - base * hy
        if k % per_row == 0:
            poses.append((fx - ahead * hx, fy - ahead * hy, hx, hy))
        fx, fy, _ = _beside(path, start + ahead + _TRACTRIX_STEP * (k + 1), offset)
        dx, dy = fx - rx, fy - ry
        size = math.sqrt(dx * dx + dy * dy)
        hx, hy = dx / size, dy / size
    return poses


def _beside(path: Path, metres: float, offset: float) -> tuple[float, float, Point]:
    """Return the point at an offset from the path at an arc length, and the direction of the path there."""
    (ax, ay), (bx, by) = path.at(metres - 0.5), path.at(metres + 0.5)
    dx, dy = bx - ax, by - ay
    size = max(math.sqrt(dx * dx + dy * dy), 1e-9)
    tx, ty = dx / size, dy / size
    x, y = path.at(metres)
    return x - offset * ty, y + offset * tx, (tx, ty)
