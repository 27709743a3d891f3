"""Paths over the ground: polylines through waypoints, parameterised by arc length in metres."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence

Point = tuple[float, float]
Leg = tuple[float, float, float, float, float, float]  # x, y of its start, unit tangent x, y, metres to it, length
_HALF_SPAN = 1.5  # metres to both sides over which curvature is measured
_SAMPLE = 0.5  # metres between samples of the curvature
_BEND = 0.03  # 1/m, the least curvature of a bend


class Path:
    """A polyline that an agent follows forwards, extended straight beyond both ends."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = [points[0]]
        self._starts = [0.0]  # metres to each point
        self._legs: list[Leg] = []
        for point in points[1:]:
            (x, y), start = self._points[-1], self._starts[-1]
            step = _distance((x, y), point)
            if step > 1e-6:
                self._legs.append((x, y, (point[0] - x) / step, (point[1] - y) / step, start, step))
                self._points.append(point)
                self._starts.append(start + step)
        self._bends = self._find_bends()

    @property
    def length(self) -> float:
        """Its length in metres."""
        return self._starts[-1]

    @property
    def legs(self) -> Sequence[Leg]:
        """Its straight segments, in order; empty if all its points are equal."""
        return self._legs

    @property
    def points(self) -> Sequence[Point]:
        """Its points, without repetitions of the previous point."""
        return self._points

    def start_of(self, leg: int) -> float:
        """Return the metres to the beginning of a leg; to the end of the path for the one after the last."""
        return self._starts[leg]

    def locate(self, x: float, y: float, leg: int = 0) -> tuple[float, float, int]:
        """Return the arc length of a point's projection onto the path, the metres from there to the left, and the leg.

        Args:
            x: Position in the world frame, metres.
            y: Position in the world frame, metres.
            leg: The leg of the last projection, where the search begins, so that it never goes back on paths that
                cross themselves.
        """
        last = len(self._legs) - 1
        if last < 0:
            return 0.0, 0.0, 0
        while True:
            ax, ay, tx, ty, start, length = self._legs[leg]
            dx, dy = x - ax, y - ay
            along = dx * tx + dy * ty
            if along < length or leg == last:
                return start + along, dy * tx - dx * ty, leg
            leg += 1

    def leg_at(self, metres: float) -> int:
        """Return the index of the leg at an arc length; the first or last one beyond the ends."""
        leg = bisect_right(self._starts, metres) - 1
        return 0 if leg < 0 else min(leg, len(self._legs) - 1)

    def window(self, start: float, end: float) -> Sequence[Leg]:
        """Return the legs between two arc lengths."""
        return self._legs[self.leg_at(start) : self.leg_at(end) + 1]

    def tangent(self, metres: float) -> Point:
        """Return the unit vector along the path at an arc length; (1, 0) if all its points are equal."""
        if not self._legs:
            return 1.0, 0.0
        leg = self._legs[self.leg_at(metres)]
        return leg[2], leg[3]

    def at(self, metres: float) -> Point:
        """Return the point at an arc length."""
        if not self._legs:
            return self._points[0]
        ax, ay, tx, ty, start, _ = self._legs[self.leg_at(metres)]
        return ax + tx * (metres - start), ay + ty * (metres - start)

    def left(self, metres: float) -> Point:
        """Return the unit vector to the left of the path at an arc length, smoothed over 3 m."""
        if not self._legs:
            return 0.0, 1.0
        _, _, tx, ty, start, length = self._legs[self.leg_at(metres)]
        if start + _HALF_SPAN <= metres <= start + length - _HALF_SPAN:
            return -ty, tx
        (ax, ay), (cx, cy) = self.at(metres - _HALF_SPAN), self.at(metres + _HALF_SPAN)
        size = max(_distance((ax, ay), (cx, cy)), 1e-9)
        return -(cy - ay) / size, (cx - ax) / size

    def curvature(self, metres: float, half_span: float = _HALF_SPAN) -> float:
        """Return the curvature at an arc length, measured over some metres to both sides: 1/m, positive to the left."""
        (ax, ay), (bx, by), (cx, cy) = (self.at(metres + d) for d in (-half_span, 0.0, half_span))
        ux, uy, wx, wy = bx - ax, by - ay, cx - bx, cy - by
        lu, lw = max(_distance((0.0, 0.0), (ux, uy)), 1e-9), max(_distance((0.0, 0.0), (wx, wy)), 1e-9)
        return (ux * wy - uy * wx) / (lu * lw * half_span)

    def next_bend(self, start: float, end: float) -> float:
        """Return the curvature of the first bend between two arc lengths; 0 if there is none."""
        found = bisect_left(self._bends, (start, -math.inf))
        return self._bends[found][1] if found < len(self._bends) and self._bends[found][0] <= end else 0.0

    def _find_bends(self) -> list[tuple[float, float]]:
        """Arc lengths, in order, and curvatures of samples in bends, which are found about inner points only."""
        count = round(_HALF_SPAN / _SAMPLE)
        places = {start + k * _SAMPLE for start in self._starts[1:-1] for k in range(-count, count + 1)}
        bends = ((metres, self.curvature(metres)) for metres in sorted(places))
        return [(metres, bend) for metres, bend in bends if abs(bend) > _BEND]


def nearest_on(legs: Sequence[Leg], x: float, y: float, open_end: bool = False) -> tuple[float, float]:
    """Return the arc length of the point of some legs that is nearest to (x, y), and the metres to the left of it.

    Args:
        legs: Consecutive legs of a path, at least one.
        x: Position in the world frame, metres.
        y: Position in the world frame, metres.
        open_end: Whether the last leg is extended straight beyond its end.
    """
    best, found, last = math.inf, (0.0, 0.0), len(legs) - 1
    for n, (ax, ay, tx, ty, start, length) in enumerate(legs):
        dx, dy = x - ax, y - ay
        along, aside = dx * tx + dy * ty, dy * tx - dx * ty
        over = 0.0
        if along < 0.0:
            over, along = along, 0.0
        elif along > length and (n < last or not open_end):
            over, along = along - length, length
        square = aside * aside + over * over
        if square < best:
            best = square
            if over:
                size = math.sqrt(square)
                aside = size if aside >= 0.0 else -size
            found = (start + along, aside)
    return found


def _distance(a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    return math.sqrt(dx * dx + dy * dy)
