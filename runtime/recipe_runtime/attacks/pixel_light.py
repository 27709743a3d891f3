"""The tone-mapped light of pixels from the radiance of their samples, with its derivative; also through a lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.attacks import camera_curve
from recipe_runtime.render.retexture.lens_map import LensMap
from recipe_runtime.render.retexture.patched_frame import CameraCurve
from recipe_runtime.render.retexture.recording import Recording
from recipe_runtime.render.retexture.sparse import SparseProduct

Values = NDArray[np.float64]


class PixelLight:
    """Reflections of wet ground, rain, exposure, tone curve and antialiasing of the pixels of a recording.

    Args:
        recording: The patched samples of a frame: N slots, Q pixels.
        curve: The camera's response.
        streak: Radiance of a streak of rain, [3].
    """

    memory = 0  # bytes of sparse matrices

    def __init__(self, recording: Recording, curve: CameraCurve, streak: NDArray[np.float32]) -> None:
        self._mirrors, size = recording.mirrors, len(recording.radiance)
        self._fixed = np.minimum(self._mirrors.sources, 0).astype(np.bool_)
        # Reflections in wet ground that do not depend on a texture.
        self._mirrored = (recording.shown - recording.radiance).astype(np.float64)
        self._mirrored[recording.slots] = self._mirrored[self._mirrors.slots] = 0.0
        pixel = np.repeat(np.arange(len(recording.pixels)), recording.counts)
        drops = np.minimum(recording.rain / 65536.0, 0.8)[pixel, None]
        exposed = (curve.gain.astype(np.float64)[:, None] * curve.white)[pixel]
        self._factor, self._rain = (1.0 - drops) * exposed, drops * streak * exposed
        self._weights, self._size = recording.weights.astype(np.float64)[:, None], size
        numbers = np.arange(4)
        used = numbers < recording.counts[:, None]
        self._slots = np.where(used, recording.first_slots[:, None] + numbers, size)  # [Q, 4]; `size` is a row of zeros
        self._pixel = pixel

    def forward(self, radiance: Values) -> tuple[Values, tuple[Values, ...]]:
        """Return the light of each pixel, [Q, 3], of the radiance of slots, [N, 3], and the values for `backward`."""
        m = self._mirrors
        shown: Values = radiance + self._mirrored
        limited: Values = np.zeros((len(m.slots), 3))
        if len(m.slots):
            source = np.where(self._fixed[:, None], m.limits, radiance[m.sources])
            limited = np.where(self._fixed[:, None] | (source > m.limits), 0.0, 1.0)
            shown[m.slots] += np.minimum(source, m.limits) * m.shares[:, None]
        level, slope = camera_curve.tone(shown * self._factor + self._rain)
        weighted = np.concatenate([level * self._weights, np.zeros((1, 3))])
        a, b, c, d = (weighted[self._slots[:, k]] for k in range(4))
        return ((a + b) + c) + d, (slope * self._weights * self._factor, limited)

    def backward(self, saved: tuple[Values, ...], gradient: Values) -> Values:
        """Return the gradient of the radiance, [N, 3], of a gradient of the pixels, [Q, 3]."""
        (slope, limited), m = saved, self._mirrors
        shown = gradient[self._pixel] * slope
        if not len(m.slots):
            return shown
        mirrored = shown[m.slots] * limited * m.shares[:, None]
        sources = np.where(self._fixed, 0, m.sources)
        added = [np.bincount(sources, mirrored[:, channel], self._size) for channel in range(3)]  # in order
        return shown + np.stack(added, axis=-1)


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
        self.memory = sum(product.memory for product in (*self._blur, *self._bloom, *self._lens))

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
