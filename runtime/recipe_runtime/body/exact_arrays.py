"""The functions of `recipe_compiler.ir.exact` over arrays, with the same bits as the scalar functions.

They apply the same IEEE `+ - * /` and `sqrt` in the same order, element by element.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_DEGREE = math.pi / 180.0
_SINE_DIVISORS = (272.0, 210.0, 156.0, 110.0, 72.0, 42.0, 20.0, 6.0)
_COSINE_DIVISORS = (306.0, 240.0, 182.0, 132.0, 90.0, 56.0, 30.0, 12.0, 2.0)


def sin_cos_deg(angle: Floats) -> tuple[Floats, Floats]:
    """Return the sines and cosines of angles in degrees."""
    turned = np.fmod(angle, 360.0)
    quarter = np.floor(turned / 90.0 + 0.5)
    rest = (turned - 90.0 * quarter) * _DEGREE
    square = rest * rest
    s, c = rest * _series(square, _SINE_DIVISORS), _series(square, _COSINE_DIVISORS)
    quadrant = quarter.astype(np.int64) & 3
    odd = (quadrant & 1) == 1
    sine, cosine = np.where(odd, c, s), np.where(odd, s, c)
    return (
        np.where(quadrant >= 2, -sine, sine),
        np.where((quadrant == 1) | (quadrant == 2), -cosine, cosine),
    )


def _series(square: Floats, divisors: tuple[float, ...]) -> Floats:
    """Return 1 - z/d (1 - z/d' (...)), the innermost divisor first."""
    tail = square / divisors[0]
    for divisor in divisors[1:]:
        np.subtract(1.0, tail, out=tail)
        tail *= square
        tail /= divisor
    result: Floats = 1.0 - tail
    return result


def atan2_deg(y: Floats, x: Floats) -> Floats:
    """Return the angles of the vectors (x, y) in degrees, in (-180, 180]; 0 for null vectors."""
    ax, ay = np.abs(x), np.abs(y)
    larger = np.maximum(ax, ay)
    angle = _atan_unit(np.minimum(ax, ay) / np.where(larger == 0.0, 1.0, larger)) / _DEGREE
    angle = np.where(ay <= ax, angle, 90.0 - angle)
    angle = np.where(x < 0.0, 180.0 - angle, angle)
    return np.where(y < 0.0, -angle, angle)


def _atan_unit(x: Floats) -> Floats:
    for _ in range(2):
        x = x / (1.0 + np.sqrt(1.0 + x * x))
    z = x * x
    total = np.zeros_like(x)
    for n in range(27, 0, -2):
        total = 1.0 / n - z * total
    result: Floats = 4.0 * x * total
    return result
