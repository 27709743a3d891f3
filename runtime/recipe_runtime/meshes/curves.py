"""Smooth curves through a few points, with exact arithmetic only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

Curve = Sequence[tuple[float, float]]  # pairs of abscissa and value, abscissas ascending


def smooth(curve: Curve, u: float) -> float:
    """Evaluate monotone cubic interpolation (Fritsch and Butland, 1984), constant outside the points."""
    if u <= curve[0][0]:
        return curve[0][1]
    for n in range(len(curve) - 1):
        (u0, v0), (u1, v1) = curve[n], curve[n + 1]
        if u <= u1:
            step, t = u1 - u0, (u - u0) / (u1 - u0)
            a, b = _slopes(tuple(curve))[n : n + 2]
            s = 1.0 - t
            return s * s * (v0 * (1.0 + 2.0 * t) + step * a * t) + t * t * (v1 * (3.0 - 2.0 * t) - step * b * s)
    return curve[-1][1]


@lru_cache(maxsize=256)
def _slopes(curve: tuple[tuple[float, float], ...]) -> tuple[float, ...]:
    return tuple(_slope(curve, n) for n in range(len(curve)))


def _slope(curve: Curve, n: int) -> float:
    """Return the slope at a point: the harmonic mean of its segments' slopes, 0 at an extremum."""
    sides = [
        (curve[k + 1][1] - curve[k][1]) / (curve[k + 1][0] - curve[k][0]) for k in (n - 1, n) if 0 <= k < len(curve) - 1
    ]
    if len(sides) == 1:
        return sides[0]
    before, after = sides
    return 2.0 * before * after / (before + after) if before * after > 0.0 else 0.0


def straight(curve: Curve, u: float) -> float:
    """Evaluate linear interpolation, constant outside the points."""
    if u <= curve[0][0]:
        return curve[0][1]
    for n in range(len(curve) - 1):
        (u0, v0), (u1, v1) = curve[n], curve[n + 1]
        if u <= u1:
            return v0 + (v1 - v0) * (u - u0) / (u1 - u0)
    return curve[-1][1]


def quarter(t: float) -> float:
    """Return the outward distance of a quarter circle at the fraction t of its depth: 0 at t = 0, 1 from t = 1 on."""
    t = max(0.0, min(1.0, t))
    return math.sqrt(t * (2.0 - t))
