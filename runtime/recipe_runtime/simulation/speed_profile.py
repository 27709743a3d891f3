"""The highest speed of a vehicle along its path: slow in bends, and standing at the goal."""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_runtime.simulation.path import Path, Point

_SIDEWAYS, _BRAKING = 2.2, 1.6  # m/s2, comfortable
_SLOWEST = 1.2  # m/s in any bend
_AT_GOAL = 0.05  # metres


class SpeedProfile:
    """Limits by bends and the goal, each of which is met by gentle braking."""

    def __init__(self, path: Path, speed: float, *, stops: bool) -> None:
        """Compute the limits.

        Args:
            path: What the vehicle follows.
            speed: m/s, the most anywhere.
            stops: Whether it stops at the end of the path.
        """
        self._path, self._speed, self._stops = path, speed, stops
        self._limits = _limits(path.points, speed, 0.0 if stops else speed)

    def at(self, metres: float, leg: int) -> float:
        """Return the highest speed at an arc length, in m/s.

        Args:
            metres: Arc length of the vehicle's middle.
            leg: The leg of the path that it is on.
        """
        if len(self._limits) < 2:
            return 0.0
        rest = max(0.0, self._path.start_of(leg + 1) - metres)
        if self._stops and leg == len(self._limits) - 2 and rest < _AT_GOAL:
            return 0.0
        end = self._limits[leg + 1]
        return min(self._speed, math.sqrt(end * end + 2.0 * _BRAKING * rest))


def _limits(points: Sequence[Point], speed: float, last: float) -> list[float]:
    """Return the speed limit at each waypoint in m/s, by curvature and by later limits."""
    limits = [speed] * len(points)
    limits[-1] = last
    for n in range(1, len(points) - 1):
        (ax, ay), (bx, by), (cx, cy) = points[n - 1], points[n], points[n + 1]
        ux, uy, wx, wy = bx - ax, by - ay, cx - bx, cy - by
        lu, lw = math.sqrt(ux * ux + uy * uy), math.sqrt(wx * wx + wy * wy)
        sine, cosine = abs(ux * wy - uy * wx) / (lu * lw), (ux * wx + uy * wy) / (lu * lw)
        bend = sine if cosine > 0 else 2.0 - sine
        curvature = bend / min(4.0, max(lu, lw, 1.0)) if bend > 0.02 else 0.0
        if curvature > 0.0:
            limits[n] = min(speed, max(_SLOWEST, math.sqrt(_SIDEWAYS / curvature)))
    for n in range(len(points) - 2, -1, -1):
        dx, dy = points[n + 1][0] - points[n][0], points[n + 1][1] - points[n][1]
        way = math.sqrt(dx * dx + dy * dy)
        limits[n] = min(limits[n], math.sqrt(limits[n + 1] * limits[n + 1] + 2.0 * _BRAKING * way))
    return limits
