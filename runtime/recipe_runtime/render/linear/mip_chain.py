"""The linear light of sRGB textures and their mip levels on a device, with derivatives; sums have a fixed order."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.linear_map import LinearMap, Values
from recipe_runtime.render.linear.texture_kernels import (
    INTERVALS,
    decode_texture,
    halve_level,
    mean_texels,
    round_means,
    round_texture,
    spread_level,
)
from recipe_runtime.render.texture.mipmaps import covered, linear_integers, middles


class MipChain(LinearMap):
    """The mip levels of textures of one size, as a linear map: each texel is the mean of the texels that it covers.

    The renderer rounds texels to 8 bits; this map does not. Textures are [h * w, 3], row by row; their levels are
    [T, 3], finest first.

    Args:
        width: Of the texture, texels.
        height: Of the texture, texels.
        device: The Warp device.
    """

    def __init__(self, width: int, height: int, device: str = "cpu") -> None:
        super().__init__(device)
        self.shape, sizes = (height, width, 3), [(width, height)]
        while sizes[-1] != (1, 1):
            wide, high = sizes[-1]
            sizes.append(((wide + 1) // 2, (high + 1) // 2))
        self._sizes, self._firsts = sizes, [0, *np.cumsum([wide * high for wide, high in sizes]).tolist()]
        counts = [covered(height, 1 << n)[:, None] * covered(width, 1 << n)[None, :] for n in range(len(sizes))]
        self._counts = _table(np.concatenate([level.reshape(-1) for level in counts]), device)
        light, slope = _curve()
        self._curve = {"light": _table(light, device), "slope": _table(slope, device)}
        self._linear = _table(linear_integers(), device)
        self._middles: DeviceArray = wp.array(middles(), dtype=wp.int64, device=device)

    @property
    def texels(self) -> int:
        """T, the number of texels of all levels."""
        return int(self._firsts[-1])

    @property
    def size(self) -> int:
        """Number of texels of a texture."""
        return int(self._firsts[1])

    def decoded(self, texture: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the linear light of sRGB values of any number, vec3d, and its derivative."""
        light, slope = (wp.empty(texture.size, dtype=wp.vec3d, device=self.device) for _ in range(2))
        launch(
            decode_texture, texture.size, self.device, texture=texture, **self._curve, out_light=light, out_slope=slope
        )
        return light, slope

    def product(self, x: DeviceArray) -> DeviceArray:
        """As `LinearMap.product`."""
        sums, texels = (wp.empty(self.texels, dtype=wp.vec3d, device=self.device) for _ in range(2))
        wp.copy(sums, x, count=self.size)
        self._add_levels(sums)
        launch(mean_texels, self.texels, self.device, sums=sums, counts=self._counts, out_texels=texels)
        return texels

    def transposed_product(self, y: DeviceArray) -> DeviceArray:
        """As `LinearMap.transposed_product`."""
        totals = wp.empty(self.texels, dtype=wp.vec3d, device=self.device)
        given = {"gradient": y, "counts": self._counts, "totals": totals, "out_totals": totals}
        for n in reversed(range(len(self._sizes))):
            wide, high = self._sizes[n]
            coarser = self._firsts[n + 1] if n + 1 < len(self._sizes) else -1
            launch(spread_level, wide * high, self.device, **given, finer=self._firsts[n], width=wide, coarser=coarser)
        first: DeviceArray = totals[: self.size]
        return first

    def round_into(self, texture: DeviceArray, out_texels: DeviceArray, first: int) -> None:
        """Write the 8-bit texels of all levels, as `mipmaps.mip_levels` does.

        Args:
            texture: sRGB, 0 to 1, vec3d [h * w].
            out_texels: Receives the texels, uint32, from place `first` on.
            first: The place.
        """
        sums = wp.empty(self.texels, dtype=wp.vec3d, device=self.device)
        out = out_texels[first : first + self.size]
        launch(
            round_texture, self.size, self.device, texture=texture, linear=self._linear, out_sums=sums, out_texels=out
        )
        self._add_levels(sums)
        given = {"sums": sums, "counts": self._counts, "middles": self._middles, "after": self.size, "first": first}
        launch(round_means, self.texels - self.size, self.device, **given, out_texels=out_texels)

    def _add_levels(self, sums: DeviceArray) -> None:
        """Write the sums of all levels after the first, which `sums` begins with."""
        for n, (wide, high) in enumerate(self._sizes[:-1]):
            places = {"finer": self._firsts[n], "coarser": self._firsts[n + 1], "width": wide, "height": high}
            count = self._firsts[n + 2] - self._firsts[n + 1]
            launch(halve_level, count, self.device, sums=sums, **places, out_sums=sums)


def _table(values: Values | NDArray[np.int64], device: str) -> DeviceArray:
    array: DeviceArray = wp.array(values.astype(np.float64), dtype=wp.float64, device=device)
    return array


@cache
def _curve() -> tuple[Values, Values]:
    """Return the linear light of the 8-bit values, and its slope per 8-bit step."""
    encoded = [i / INTERVALS for i in range(INTERVALS + 1)]
    bases = [(v + 0.055) / 1.055 for v in encoded]
    pairs = list(zip(encoded, bases, strict=True))
    light = [v / 12.92 if v <= 0.04045 else exact.power(b, 2.4) for v, b in pairs]
    slope = [1.0 / 12.92 if v <= 0.04045 else 2.4 / 1.055 * exact.power(b, 1.4) for v, b in pairs]
    return np.array(light), np.array(slope) / INTERVALS
