"""A line through points, with rounded corners, that a sensor travels along. Lengths in metres, angles in degrees."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from recipe_compiler.ir import exact
from recipe_compiler.schema.motion import SHORTEST_LEG

_DEGREE = math.pi / 180.0
_U_TURN = 179.9  # corners that turn by more are not rounded

Vector = tuple[float, float, float]


class Station(NamedTuple):
    """A place on a path, and the yaw of the direction of travel there."""

    x: float
    y: float
    z: float
    yaw: float


@dataclass(frozen=True)
class _Piece:
    """A straight line, or an arc if `radius` is not 0.

    An arc starts in the direction `ahead` at angle 0 and turns towards `aside`, a perpendicular unit vector. The piece
    is its part from the angle `first` on.
    """

    start: Vector
    ahead: Vector
    length: float
    yaw: float  # of the direction of travel, if that is vertical
    radius: float = 0.0
    aside: Vector = (0.0, 0.0, 0.0)
    first: float = 0.0

    def at(self, distance: float) -> Station:
        """Return the place at a distance from the start of the piece."""
        if self.radius == 0.0:
            x, y, z = _sum(self.start, self.ahead, distance)
            return Station(x, y, z, _yaw(self.ahead, self.yaw))
        sine, cosine = exact.sin_cos_deg(self.first + distance / self.radius / _DEGREE)
        along = _sum(self.start, self.ahead, self.radius * sine)
        x, y, z = _sum(along, self.aside, self.radius * (1.0 - cosine))
        direction = _sum((0.0, 0.0, 0.0), self.ahead, cosine)
        return Station(x, y, z, _yaw(_sum(direction, self.aside, sine), self.yaw))


class Path:
    """A path from the first point through the others, whose corners are arcs.

    A closed path returns to the first point. If that corner is rounded, the path starts in the middle of its arc.
    """

    def __init__(self, points: Sequence[Vector], radius: float = 0.0, *, closed: bool = False) -> None:
        """Lay out the path.

        Args:
            points: at least two that differ; a point equal to the one before is ignored.
            radius: of the arcs. An arc uses at most half of each adjacent leg, and its radius is smaller if necessary.
            closed: whether it returns to the first point.
        """
        self._pieces = _pieces([*points, points[0]] if closed else points, radius, closed)
        ends, total = [], 0.0
        for piece in self._pieces:
            total += piece.length
            ends.append(total)
        self._ends, self._closed = ends, closed

    @property
    def length(self) -> float:
        """Length of the path, of one round if it is closed."""
        return self._ends[-1]

    def at(self, distance: float) -> Station:
        """Return the place at a distance from the start; an open path ends at its last point, a closed one repeats."""
        distance = math.fmod(distance, self.length) if self._closed else min(distance, self.length)
        number = min(bisect.bisect_right(self._ends, distance), len(self._pieces) - 1)
        return self._pieces[number].at(distance - (self._ends[number - 1] if number else 0.0))


@dataclass(frozen=True)
class _Corner:
    """The arc between two legs: it starts `cut` before their common point and ends `cut` after it."""

    cut: float
    radius: float
    turn: float
    aside: Vector


_SHARP = _Corner(0.0, 0.0, 0.0, (0.0, 0.0, 0.0))


def _pieces(points: Sequence[Vector], radius: float, closed: bool) -> list[_Piece]:
    legs: list[tuple[Vector, Vector, float]] = []  # start, direction, length
    for end in points:
        start = _end(legs[-1]) if legs else points[0]
        span = end[0] - start[0], end[1] - start[1], end[2] - start[2]
        length = math.sqrt(_dot(span, span))
        if length > SHORTEST_LEG:
            legs.append((start, (span[0] / length, span[1] / length, span[2] / length), length))
    corners = [_corner(a, b, radius) for a, b in itertools.pairwise(legs)]
    last = _corner(legs[-1], legs[0], radius) if closed else _SHARP
    pieces: list[_Piece] = []
    yaw = 0.0
    for (start, ahead, length), before, after in zip(legs, [last, *corners], [*corners, last], strict=True):
        if not pieces and before.radius > 0.0:
            pieces.append(_arc(_end(legs[-1]), legs[-1][1], before, yaw, 0.5, 0.5))
        yaw = _yaw(ahead, yaw)
        line = length - before.cut - after.cut
        if line > SHORTEST_LEG:
            pieces.append(_Piece(_sum(start, ahead, before.cut), ahead, line, yaw))
        if after.radius > 0.0:
            end = start[0] + ahead[0] * length, start[1] + ahead[1] * length, start[2] + ahead[2] * length
            pieces.append(_arc(end, ahead, after, yaw, 0.0, 1.0 if after is not last else 0.5))
    return pieces


def _arc(corner: Vector, ahead: Vector, arc: _Corner, yaw: float, first: float, part: float) -> _Piece:
    """Return a part of the arc at a corner, from the part `first` of its turn on."""
    start = _sum(corner, ahead, -arc.cut)
    length = arc.radius * arc.turn * _DEGREE * part
    return _Piece(start, ahead, length, yaw, arc.radius, arc.aside, first * arc.turn)


def _corner(one: tuple[Vector, Vector, float], other: tuple[Vector, Vector, float], radius: float) -> _Corner:
    u, v = one[1], other[1]
    cosine = _dot(u, v)
    normal = _sum(v, u, -cosine)
    sine = math.sqrt(_dot(normal, normal))
    turn = exact.atan2_deg(sine, cosine)
    if radius <= 0.0 or sine < 1e-9 or turn > _U_TURN:
        return _SHARP
    half_tangent = sine / (1.0 + cosine)
    cut = min(radius * half_tangent, one[2] / 2, other[2] / 2)
    aside = normal[0] / sine, normal[1] / sine, normal[2] / sine
    return _Corner(cut, cut / half_tangent, turn, aside)


def _yaw(direction: Vector, otherwise: float) -> float:
    x, y, _ = direction
    return exact.atan2_deg(y, x) if abs(x) + abs(y) > 1e-9 else otherwise


def _end(leg: tuple[Vector, Vector, float]) -> Vector:
    start, ahead, length = leg
    return _sum(start, ahead, length)


def _sum(a: Vector, b: Vector, factor: float) -> Vector:
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
