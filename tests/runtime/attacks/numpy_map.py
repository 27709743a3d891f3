"""The map from a texture to pixels in NumPy: an oracle of the kernels of `render.retexture`, which give its bytes."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_runtime.render.linear.sparse import SparseProduct
from recipe_runtime.render.retexture.lens_map import LensMap
from recipe_runtime.render.retexture.patched_frame import CameraCurve, PatchedFrame
from recipe_runtime.render.retexture.recording import Recording
from recipe_runtime.render.texture.mipmaps import covered, halved

Values = NDArray[np.float64]
_INTERVALS = 255  # of the table of linear light, whose nodes are the 8-bit values


def linearised(frame: PatchedFrame, patch: str, texture: Values, gradient: Values) -> tuple[Values, Values]:
    """Return the values of the pixels for a texture [h, w, 3], and the gradient of the texture for one of them."""
    height, width = texture.shape[:2]
    rows, curve, mips = frame.rows(patch), frame.curve, MipChain(width, height)
    taps = SparseProduct(frame.taps(patch, width, height), "cpu")
    pixels = PixelLight(frame.recording, curve, frame.streak)
    light = pixels if frame.lens is None else LensLight(pixels, frame.lens, "cpu")
    linear, linear_slope = linear_light(texture)
    radiance = rows.offset.copy()
    radiance[rows.samples] += rows.gain[rows.samples] * taps.forward(mips.forward(linear))
    level, saved = light.forward(radiance)
    noisy, noise_slope = with_noise(level, curve.deviates.astype(np.float64), curve.noise)
    values, curve_slope = encoded(noisy, curve.encoded)
    back = light.backward(saved, gradient * (curve_slope * noise_slope))
    texels = taps.backward(np.ascontiguousarray((back * rows.gain)[rows.samples]))
    return values, mips.backward(texels) * linear_slope


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
        level, slope = tone(shown * self._factor + self._rain)
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
        hdr, hdr_slope = inverse_tone(level)
        change = hdr - self._map.hdr
        for product in self._blur:
            change = product.forward(change)
        spread = change
        for product in self._bloom:
            spread = product.forward(spread)
        resampled = self._resampled(np.concatenate([change, spread]) if self._bloom else change)
        gain = self._map.gain[:, None]
        toned, slope = tone((self._map.light + resampled) * gain)
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
