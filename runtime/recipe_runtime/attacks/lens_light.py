"""The tone-mapped light of pixels from the radiance of their samples, through motion blur and lens effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.attacks import camera_curve
from recipe_runtime.attacks.pixel_light import PixelLight
from recipe_runtime.render.retexture.lens_map import LensMap
from recipe_runtime.render.retexture.sparse import SparseProduct

Values = NDArray[np.float64]


class LensLight:
    """Motion blur, bloom, distortion, chromatic aberration, supersampling and vignette.

    `light` gives the pixels of the undistorted HDR image. The samples of the picture are resampled from it and
    tone-mapped.
    """

    def __init__(self, light: PixelLight, lens: LensMap, device: str) -> None:
        self._light, self._map = light, lens
        self._blur = [SparseProduct(matrix, device) for matrix in (lens.blur,) if matrix is not None]
        self._bloom = [SparseProduct(matrix, device) for matrix in lens.bloom]
        self._lens = [SparseProduct(matrix, device) for matrix in lens.lens]

    @property
    def memory(self) -> int:
        """About how many bytes of memory the sparse matrices take."""
        return sum(product.memory for product in (*self._blur, *self._bloom, *self._lens))

    def forward(self, radiance: Values) -> tuple[Values, tuple[Values, ...]]:
        """Return the light of each pixel, [Q, 3], of the radiance of slots, [N, 3], and the values for `backward`."""
        level, saved = self._light.forward(radiance)
        hdr, hdr_slope = camera_curve.inverse_tone(level)
        change = hdr - self._map.hdr
        for product in self._blur:
            change = product.forward(change)
        spread = change
        for product in self._bloom:
            spread = product.forward(spread)
        resampled = self._resampled(np.concatenate([change, spread]) if self._bloom else change)
        gain = self._map.gain[:, None]
        toned, slope = camera_curve.tone((self._map.light + resampled) * gain)
        n = self._map.per_pixel
        total = np.zeros((len(self._map.pixels), 3))
        for sample in range(n):
            total += toned[sample::n]
        return total / n, (slope * gain / n, hdr_slope, *saved)

    def backward(self, saved: tuple[Values, ...], gradient: Values) -> Values:
        """Return the gradient of the radiance, [N, 3], of a gradient of the pixels, [Q, 3]."""
        slope, hdr_slope, *rest = saved
        back = self._resampled_transposed(np.repeat(gradient, self._map.per_pixel, axis=0) * slope)
        if self._bloom:
            blurred = self._bloom[0].matrix.width
            change, spread = back[:blurred], back[blurred:]
            for product in reversed(self._bloom):
                spread = product.backward(spread)
            back = change + spread
        for product in self._blur:
            back = product.backward(back)
        return self._light.backward(tuple(rest), back * hdr_slope)

    def _resampled(self, change: Values) -> Values:
        if len(self._lens) == 1:
            return self._lens[0].forward(change)
        return np.stack([self._lens[c].forward(change)[:, c] for c in range(3)], axis=-1)

    def _resampled_transposed(self, gradient: Values) -> Values:
        gradient = np.ascontiguousarray(gradient)
        if len(self._lens) == 1:
            return self._lens[0].backward(gradient)
        return np.stack([self._lens[c].backward(gradient)[:, c] for c in range(3)], axis=-1)
