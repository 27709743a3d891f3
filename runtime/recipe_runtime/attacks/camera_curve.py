"""The camera's response as a smooth function of light, with its derivative: tone mapping, noise and encoding.

Light is linear, 1 is white. The renderer rounds it to 4096 levels and then to 8 bits; here, only `rounded` rounds.
Functions take arrays of any shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


def tone(x: Values) -> tuple[Values, Values]:
    """Return tone-mapped light, 0 to 1, and its derivative: Narkowicz's fit to the ACES curve."""
    x = np.maximum(x, 0.0)
    numerator, denominator = x * (2.51 * x + 0.03), x * (2.43 * x + 0.59) + 0.14
    y = numerator / denominator
    slope = ((5.02 * x + 0.03) * denominator - numerator * (4.86 * x + 0.59)) / (denominator * denominator)
    return np.minimum(y, 1.0), np.where((y < 1.0) & (x > 0.0), slope, 0.0)


def inverse_tone(y: Values) -> tuple[Values, Values]:
    """Return the light that `tone` maps to y, and its derivative."""
    a, b = 2.51 - 2.43 * y, 0.03 - 0.59 * y
    root = np.sqrt(b * b + 0.56 * a * y)
    x = (root - b) / (2.0 * a)
    half = (-0.59 * b + 0.28 * (2.51 - 4.86 * y)) / np.maximum(root, 1e-12)
    return x, (half + 0.59 + 4.86 * x) / (2.0 * a)


def with_noise(level: Values, deviates: Values, noise: float) -> tuple[Values, Values]:
    """Return light with the frame's noise, and its derivative.

    Args:
        level: Light without noise, 0 to 1.
        deviates: Standard normal deviates of the frame, of the same shape.
        noise: Strength of the noise, as in the recipe.
    """
    root = np.sqrt(np.maximum(level, 0.0))
    value = level + noise * deviates * (0.0005 + 0.008 * root)
    return value, 1.0 + noise * deviates * 0.004 / np.maximum(root, 1e-3)


def encoded(light: Values, table: Values) -> tuple[Values, Values]:
    """Return the picture's value, 0 to 1, of light, and its derivative.

    Args:
        light: Light; values outside 0 to 1 are clipped and have a derivative of 0.
        table: Values of equally spaced light from 0 to 1, between which the function interpolates linearly.
    """
    last = len(table) - 1
    t = np.clip(light, 0.0, 1.0) * last
    i = np.minimum(t.astype(np.int64), last - 1)
    step = table[i + 1] - table[i]
    inside = (light >= 0.0) & (light <= 1.0)
    return table[i] + step * (t - i), np.where(inside, step * last, 0.0)


def rounded(light: Values, table: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the 8-bit levels of light 0 to 1, from a table of levels, rounded as the renderer rounds."""
    last = len(table) - 1
    return table[np.clip(light * last + 0.5, 0.0, last).astype(np.int64)]
