"""The linear light of sRGB textures and their mip levels, with derivatives; sums have a fixed order."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact

from recipe_runtime.render.texture.mipmaps import covered, halved

Values = NDArray[np.float64]
_INTERVALS = 255  # of the table of linear light, whose nodes are the 8-bit values


def linear_light(texture: Values) -> tuple[Values, Values]:
    """Return the linear light of sRGB values 0 to 1, and its derivative, which is 0 outside that range.

    Both are exact at 8-bit values; between them, light is a cubic Hermite interpolation with the sRGB curve's slopes.
    """
    light, slope = _curve()
    t = np.clip(texture, 0.0, 1.0) * _INTERVALS
    i = np.minimum(t.astype(np.int64), _INTERVALS - 1)
    t = t - i
    a, b, p, q = light[i], light[i + 1], slope[i], slope[i + 1]
    c, d = 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q
    value = a + t * (p + t * (c + t * d))
    derivative = (p + t * (2.0 * c + t * 3.0 * d)) * _INTERVALS
    return value, np.where((texture < 0.0) | (texture > 1.0), 0.0, derivative)


@cache
def _curve() -> tuple[Values, Values]:
    """Return the linear light of the 8-bit values, and its slope per 8-bit step."""
    encoded = [i / _INTERVALS for i in range(_INTERVALS + 1)]
    bases = [(v + 0.055) / 1.055 for v in encoded]
    pairs = list(zip(encoded, bases, strict=True))
    light = [v / 12.92 if v <= 0.04045 else exact.power(b, 2.4) for v, b in pairs]
    slope = [1.0 / 12.92 if v <= 0.04045 else 2.4 / 1.055 * exact.power(b, 1.4) for v, b in pairs]
    return np.array(light), np.array(slope) / _INTERVALS


class MipChain:
    """The mip levels of textures of one size, as a linear map: each texel is the mean of the texels that it covers.

    The renderer rounds texels to 8 bits; this map does not.

    Args:
        width: Of the texture, texels.
        height: Of the texture, texels.
    """

    def __init__(self, width: int, height: int) -> None:
        self.shape = height, width, 3
        sizes = [(height, width)]
        while sizes[-1] != (1, 1):
            rows, columns = sizes[-1]
            sizes.append(((rows + 1) // 2, (columns + 1) // 2))
        self._sizes = sizes
        self._counts = [
            (covered(height, 1 << level)[:, None] * covered(width, 1 << level)[None, :])[..., None]
            for level in range(len(sizes))
        ]

    def forward(self, texture: Values) -> Values:
        """Return all levels of a texture [h, w, 3], finest first, row by row: [texels, 3]."""
        sums: Values = texture
        levels = [texture]
        for counts in self._counts[1:]:
            sums = halved(sums)
            levels.append(sums / counts)
        return np.concatenate([level.reshape(-1, 3) for level in levels])

    def backward(self, gradient: Values) -> Values:
        """Return the gradient of the texture, [h, w, 3], of a gradient of all levels, [texels, 3]."""
        ends = np.cumsum([rows * columns for rows, columns in self._sizes])
        total: Values = np.zeros((1, 1, 3))
        for (rows, columns), end, counts in reversed(list(zip(self._sizes, ends, self._counts, strict=True))):
            own = gradient[end - rows * columns : end].reshape(rows, columns, 3) / counts
            if (rows, columns) != self._sizes[-1]:
                total = np.repeat(np.repeat(total, 2, axis=0)[:rows], 2, axis=1)[:, :columns]
            total = total + own
        return total
