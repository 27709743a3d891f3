"""The tone-mapped light of pixels from the radiance of their samples, with its transpose; also through a lens.

Arrays are vec3d on the device of the frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.linear_map import added, multiplied, subtracted, vectors
from recipe_runtime.render.linear.sparse import SparseProduct
from recipe_runtime.render.retexture.lens_map import LensMap
from recipe_runtime.render.retexture.recording import Mirrors, Recording
from recipe_runtime.render.retexture.response_kernels import (
    MirrorArrays,
    SlotLight,
    mirror_gradients,
    reflect_slots,
    sample_gradients,
    select_channels,
    slot_gradients,
    tone_pixels,
    tone_samples,
    undo_tone,
)

Saved = tuple[DeviceArray, ...]


class PixelLight:
    """Reflections of wet ground, rain, exposure, tone curve and antialiasing of the pixels of a recording.

    Args:
        recording: The patched samples of a frame: N slots, Q pixels.
        exposure: Gain of exposure and vignette of each pixel, [Q].
        white: Gains of the white balance, [3].
        streak: Radiance of a streak of rain, [3].
        device: The Warp device.
    """

    memory = 0  # bytes of sparse matrices

    def __init__(
        self,
        recording: Recording,
        exposure: NDArray[np.float32],
        white: NDArray[np.float32],
        streak: NDArray[np.float32],
        device: str,
    ) -> None:
        self._device, self._size, self._pixels = device, len(recording.radiance), len(recording.pixels)
        self._mirror_count = len(recording.mirrors.slots)
        self._mirrors = struct_array([_mirrors(recording.mirrors, self._size, device)], device)
        # Reflections in wet ground that do not depend on a texture.
        mirrored = (recording.shown - recording.radiance).astype(np.float64)
        mirrored[recording.slots] = mirrored[recording.mirrors.slots] = 0.0
        pixel = np.repeat(np.arange(self._pixels), recording.counts)
        drops = np.minimum(recording.rain / 65536.0, 0.8)[pixel, None]
        exposed = (exposure.astype(np.float64)[:, None] * white)[pixel]
        columns = {"pixels": pixel, "firsts": recording.first_slots, "counts": recording.counts}
        light = set_fields(
            SlotLight(),
            mirrored=vectors(mirrored, device),
            factors=vectors((1.0 - drops) * exposed, device),
            rain=vectors(drops * streak * exposed, device),
            weights=wp.array(recording.weights.astype(np.float64), dtype=wp.float64, device=device),
            **{name: _integers(values, device) for name, values in columns.items()},
        )
        self._mirrored, self._light = light.mirrored, struct_array([light], device)

    def forward(self, radiance: DeviceArray) -> tuple[DeviceArray, Saved]:
        """Return the light of each pixel, [Q], of the radiance of slots, [N], and the arrays for `backward`."""
        device = self._device
        shown, slope = added(radiance, self._mirrored), wp.empty(self._size, dtype=wp.vec3d, device=device)
        passed = wp.empty(self._mirror_count, dtype=wp.vec3d, device=device)
        level = wp.empty(self._pixels, dtype=wp.vec3d, device=device)
        out = {"out_shown": shown, "out_passed": passed}
        launch(reflect_slots, self._mirror_count, device, mirrors=self._mirrors, radiance=radiance, **out)
        out = {"out_level": level, "out_slope": slope}
        launch(tone_pixels, self._pixels, device, light=self._light, shown=shown, **out)
        return level, (slope, passed)

    def backward(self, saved: Saved, gradient: DeviceArray) -> DeviceArray:
        """Return the gradient of the radiance, [N], of a gradient of the pixels, [Q]."""
        slope, passed = saved
        shown = wp.empty(self._size, dtype=wp.vec3d, device=self._device)
        given = {"light": self._light, "gradient": gradient, "slope": slope}
        launch(slot_gradients, self._size, self._device, **given, out_shown=shown)
        if not self._mirror_count:
            return shown
        radiance = wp.empty(self._size, dtype=wp.vec3d, device=self._device)
        given = {"mirrors": self._mirrors, "shown": shown, "passed": passed}
        launch(mirror_gradients, self._size, self._device, **given, out_radiance=radiance)
        return radiance


class LensLight:
    """Motion blur, bloom, distortion, chromatic aberration, supersampling and vignette.

    `light` gives the pixels of the undistorted HDR image. The samples of the picture are resampled from it and
    tone-mapped.
    """

    def __init__(self, light: PixelLight, lens: LensMap, device: str) -> None:
        self._device, self._light, self._per_pixel = device, light, lens.per_pixel
        self._blur = [SparseProduct(matrix, device) for matrix in (lens.blur,) if matrix is not None]
        self._bloom = [SparseProduct(matrix, device) for matrix in lens.bloom]
        self._lens = [SparseProduct(matrix, device) for matrix in lens.lens]
        self.memory = sum(product.memory for product in (*self._blur, *self._bloom, *self._lens))
        self._hdr, self._constant = vectors(lens.hdr, device), vectors(lens.light, device)
        self._gain: DeviceArray = wp.array(lens.gain, dtype=wp.float64, device=device)
        self._pixels = len(lens.pixels)

    def forward(self, radiance: DeviceArray) -> tuple[DeviceArray, Saved]:
        """Return the light of each pixel, [Q], of the radiance of slots, [N], and the arrays for `backward`."""
        level, saved = self._light.forward(radiance)
        hdr, hdr_slope = self._empty(level.size), self._empty(level.size)
        launch(undo_tone, level.size, self._device, level=level, out_light=hdr, out_slope=hdr_slope)
        change = subtracted(hdr, self._hdr)
        for product in self._blur:
            change = product.product(change)
        if self._bloom:
            spread = change
            for product in self._bloom:
                spread = product.product(spread)
            both = self._empty(change.size + spread.size)
            wp.copy(both, change, count=change.size)
            wp.copy(both, spread, dest_offset=change.size, count=spread.size)
            change = both
        found = [product.product(change) for product in self._lens]
        toned, slope = self._empty(self._pixels), self._empty(self._gain.size)
        given = {"light": self._constant, "change": self._channels(found), "gain": self._gain}
        out = {"out_level": toned, "out_slope": slope}
        launch(tone_samples, self._pixels, self._device, **given, per_pixel=self._per_pixel, **out)
        return toned, (slope, hdr_slope, *saved)

    def backward(self, saved: Saved, gradient: DeviceArray) -> DeviceArray:
        """Return the gradient of the radiance, [N], of a gradient of the pixels, [Q]."""
        slope, hdr_slope, *rest = saved
        samples = self._empty(slope.size)
        given = {"gradient": gradient, "slope": slope, "per_pixel": self._per_pixel}
        launch(sample_gradients, slope.size, self._device, **given, out_samples=samples)
        back = self._channels([product.transposed_product(samples) for product in self._lens])
        if self._bloom:
            blurred = self._bloom[0].matrix.width
            change, spread = (back[:blurred], back[blurred:]) if blurred else (back, back)
            for product in reversed(self._bloom):
                spread = product.transposed_product(spread)
            back = added(change, spread)
        for product in self._blur:
            back = product.transposed_product(back)
        return self._light.backward(tuple(rest), multiplied(back, hdr_slope))

    def _channels(self, found: list[DeviceArray]) -> DeviceArray:
        """Return one array of those of red, green and blue, or the one that is for all."""
        if len(found) == 1:
            return found[0]
        red, green, blue = found
        out = self._empty(red.size)
        launch(select_channels, red.size, self._device, red=red, green=green, blue=blue, out_colour=out)
        return out

    def _empty(self, count: int) -> DeviceArray:
        array: DeviceArray = wp.empty(count, dtype=wp.vec3d, device=self._device)
        return array


def _mirrors(mirrors: Mirrors, slots: int, device: str) -> MirrorArrays:
    """Return mirrors on a device, with the mirrors that reflect each of the slots."""
    order = np.argsort(mirrors.sources, kind="stable")
    order = order[mirrors.sources[order] >= 0]
    firsts = np.searchsorted(mirrors.sources[order], np.arange(slots + 1))
    columns: dict[str, NDArray[np.integer]] = {
        "slots": mirrors.slots,
        "sources": mirrors.sources,
        "firsts": firsts,
        "numbers": order,
    }
    return set_fields(
        MirrorArrays(),
        shares=wp.array(mirrors.shares.astype(np.float64), dtype=wp.float64, device=device),
        limits=vectors(mirrors.limits, device),
        **{name: _integers(values, device) for name, values in columns.items()},
    )


def _integers(values: NDArray[np.integer], device: str) -> DeviceArray:
    array: DeviceArray = wp.array(np.ascontiguousarray(values, np.int32), dtype=wp.int32, device=device)
    return array
