"""Paths over the ground: polylines through waypoints, parameterised by arc length in metres."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

Point = tuple[float, float]
_HALF_SPAN = 1.5  # metres to both sides over which curvature is measured


class Path:
    """A polyline that an agent follows forwards, extended straight beyond both ends."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = [points[0]]
        self._starts = [0.0]  # metres to each point
        for point in points[1:]:
            step = _distance(self._points[-1], point)
            if step > 1e-6:
                self._points.append(point)
                self._starts.append(self._starts[-1] + step)
        self._leg = 0

    def project(self, x: float, y: float) -> float:
        """Return the arc length of a point's projection onto the path.

        The segment never decreases from one call to the next.
        """
        if len(self._points) < 2:
            return 0.0
        while True:
            (ax, ay), (bx, by) = self._points[self._leg], self._points[self._leg + 1]
            length = self._starts[self._leg + 1] - self._starts[self._leg]
            done = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length
            if done < length or self._leg >= len(self._points) - 2:
                return self._starts[self._leg] + done
            self._leg += 1

    def at(self, metres: float) -> Point:
        """Return the point at an arc length."""
        if len(self._points) < 2:
            return self._points[0]
        leg = min(max(bisect_right(self._starts, metres) - 1, 0), len(self._points) - 2)
        (ax, ay), (bx, by) = self._points[leg], self._points[leg + 1]
        t = (metres - self._starts[leg]) / (self._starts[leg + 1] - self._starts[leg])
        return ax + (bx - ax) * t, ay + (by - ay) * t

    def curvature(self, metres: float) -> tuple[float, Point]:
        """Return the curvature at an arc length (1/m, positive to the left) and the unit vector to the left."""
        (ax, ay), (bx, by), (cx, cy) = (self.at(metres + d) for d in (-_HALF_SPAN, 0.0, _HALF_SPAN))
        ux, uy, wx, wy = bx - ax, by - ay, cx - bx, cy - by
        size = max(_distance((ax, ay), (cx, cy)), 1e-9)
        lu, lw = max(_distance((0.0, 0.0), (ux, uy)), 1e-9), max(_distance((0.0, 0.0), (wx, wy)), 1e-9)
        return (ux * wy - uy * wx) / (lu * lw * _HALF_SPAN), (-(cy - ay) / size, (cx - ax) / size)


def _distance(a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    return math.sqrt(dx * dx + dy * dy)
