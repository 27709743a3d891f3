"""From the radiance of a frame's patched samples to the linear levels of pixels, through motion blur and lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.attacks import camera_curve
from recipe_runtime.attacks.pixel_light import PixelLight
from recipe_runtime.render.retexture.lens_map import LensMap
from recipe_runtime.render.retexture.sparse import SparseProduct

Values = NDArray[np.float64]


class LensLight:
    """Motion blur, bloom, distortion, chromatic aberration, supersampling and vignette after the light of pixels.

    A pixel's light is that of the undistorted HDR image; samples of the picture are resampled from it and tone-mapped.
    """

    def __init__(self, light: PixelLight, lens: LensMap, device: str) -> None:
        self._light, self._map = light, lens
        self._blur = [SparseProduct(matrix, device) for matrix in (lens.blur,) if matrix is not None]
        self._bloom = [SparseProduct(matrix, device) for matrix in lens.bloom]
        self._lens = [SparseProduct(matrix, device) for matrix in lens.lens]

    def forward(self, radiance: Values) -> tuple[Values, tuple[Values, ...]]:
        """Return the level of each pixel, [Q, 3] of [N, 3], and what `backward` needs."""
        level, saved = self._light.forward(radiance)
        hdr, hdr_rise = camera_curve.inverse_tone(level)
        change = hdr - self._map.hdr
        for product in self._blur:
            change = product.forward(change)
        spread = change
        for product in self._bloom:
            spread = product.forward(spread)
        resampled = self._resampled(np.concatenate([change, spread]) if self._bloom else change)
        gain = self._map.gain[:, None]
        toned, rise = camera_curve.tone((self._map.light + resampled) * gain)
        n = self._map.per_pixel
        total = np.zeros((len(self._map.pixels), 3))
        for sample in range(n):
            total += toned[sample::n]
        return total / n, (rise * gain / n, hdr_rise, *saved)

    def backward(self, saved: tuple[Values, ...], gradient: Values) -> Values:
        """Return the gradient of the radiance, [N, 3] of [Q, 3]."""
        rise, hdr_rise, *rest = saved
        back = self._resampled_transposed(np.repeat(gradient, self._map.per_pixel, axis=0) * rise)
        if self._bloom:
            blurred = self._bloom[0].matrix.width
            change, spread = back[:blurred], back[blurred:]
            for product in reversed(self._bloom):
                spread = product.backward(spread)
            back = change + spread
        for product in self._blur:
            back = product.backward(back)
        return self._light.backward(tuple(rest), back * hdr_rise)

    def _resampled(self, change: Values) -> Values:
        if len(self._lens) == 1:
            return self._lens[0].forward(change)
        return np.stack([self._lens[c].forward(change)[:, c] for c in range(3)], axis=-1)

    def _resampled_transposed(self, gradient: Values) -> Values:
        gradient = np.ascontiguousarray(gradient)
        if len(self._lens) == 1:
            return self._lens[0].backward(gradient)
        return np.stack([self._lens[c].backward(gradient)[:, c] for c in range(3)], axis=-1)
