"""Images for tests of insertion, and simple functions to sample them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def smooth(height: int, width: int, seed: int, blur: int) -> NDArray[np.uint8]:
    """Return a random image without detail finer than about `blur` texels, uint8 [height, width, 3]."""
    values = np.random.default_rng(seed).uniform(-600, 855, (height, width, 3))
    for axis in (0, 1):
        for _ in range(2):
            moved = [np.roll(values, step, axis) for step in range(-blur, blur + 1)]
            values = np.mean(moved, axis=0)
    return np.clip(127 + (values - 127) * blur, 0, 255).astype(np.uint8)


def bilinear(image: Floats, x: Floats, y: Floats) -> Floats:
    """Return bilinear samples at texel positions x, y, one by one; (0, 0) is the centre of the first texel."""
    height, width = image.shape[:2]
    found = []
    for a, b in zip(np.clip(x, 0, width - 1), np.clip(y, 0, height - 1), strict=True):
        i, j = min(int(a), max(width - 2, 0)), min(int(b), max(height - 2, 0))
        right, below = min(i + 1, width - 1), min(j + 1, height - 1)
        s, t = a - i, b - j
        found.append(
            (1 - s) * (1 - t) * image[j, i]
            + s * (1 - t) * image[j, right]
            + (1 - s) * t * image[below, i]
            + s * t * image[below, right]
        )
    return np.array(found)


def dilated(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask extended by all neighbours of its pixels."""
    padded = np.pad(mask, 1)
    rows, columns = mask.shape
    found = np.zeros_like(mask)
    for i in range(3):
        for j in range(3):
            found |= padded[i : i + rows, j : j + columns]
    return found
