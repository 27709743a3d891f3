"""A way over the ground: a line through waypoints, measured in metres from its start."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

Point = tuple[float, float]
_ARM = 1.5  # metres to both sides over which a bend is measured


class Way:
    """A line that somebody follows forwards; it goes straight on beyond both ends."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = [points[0]]
        self._starts = [0.0]  # metres to each point
        for point in points[1:]:
            step = _distance(self._points[-1], point)
            if step > 1e-6:
                self._points.append(point)
                self._starts.append(self._starts[-1] + step)
        self._leg = 0

    def reached(self, x: float, y: float) -> float:
        """Metres along the way of the place nearest to a point, never on a leg before the last one asked for."""
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
        """The point of the way so far from its start."""
        if len(self._points) < 2:
            return self._points[0]
        leg = min(max(bisect_right(self._starts, metres) - 1, 0), len(self._points) - 2)
        (ax, ay), (bx, by) = self._points[leg], self._points[leg + 1]
        t = (metres - self._starts[leg]) / (self._starts[leg + 1] - self._starts[leg])
        return ax + (bx - ax) * t, ay + (by - ay) * t

    def bend(self, metres: float) -> tuple[float, Point]:
        """Curvature there in 1/m, positive to the left, and the unit direction to the left of the way."""
        (ax, ay), (bx, by), (cx, cy) = (self.at(metres + d) for d in (-_ARM, 0.0, _ARM))
        ux, uy, wx, wy = bx - ax, by - ay, cx - bx, cy - by
        size = max(_distance((ax, ay), (cx, cy)), 1e-9)
        lu, lw = max(_distance((0.0, 0.0), (ux, uy)), 1e-9), max(_distance((0.0, 0.0), (wx, wy)), 1e-9)
        return (ux * wy - uy * wx) / (lu * lw * _ARM), (-(cy - ay) / size, (cx - ax) / size)


def _distance(a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    return math.sqrt(dx * dx + dy * dy)
