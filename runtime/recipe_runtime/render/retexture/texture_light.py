"""The radiance that the texture of a patch adds to the samples of a frame, with the transpose, on its device."""

from __future__ import annotations

from collections.abc import Callable, Collection

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.linear_map import Values, added, multiplied, vectors
from recipe_runtime.render.linear.mip_chain import MipChain
from recipe_runtime.render.linear.sparse import SparseProduct
from recipe_runtime.render.retexture.patched_frame import PatchedFrame
from recipe_runtime.render.retexture.response_kernels import light_slots, texel_gradients


class TextureLight:
    """The light of a patch: gain * (A @ M @ linear(texture)) of each of the N slots.

    Attributes:
        rows: gain and offset of the slots, and the K of them that the patch covers.
        taps: Products with A and its transpose.
        mips: Products with M and its transpose.
        offset: Radiance of the slots without the patch's light, vec3d [N].
    """

    def __init__(self, frame: PatchedFrame, patch: str, width: int, height: int, black: Collection[str] = ()) -> None:
        """Find the light of a patch.

        Args:
            frame: The frame.
            patch: Name of the patch.
            width: Of its textures, texels.
            height: Of its textures, texels.
            black: Other patches, which are black in `offset`; the rest have the recipe's textures.
        """
        self.device = device = frame.device
        self.rows = frame.rows(patch, black)
        self.taps = SparseProduct(frame.taps(patch, width, height), device)
        self.mips = MipChain(width, height, device)
        self.offset, self._gain = vectors(self.rows.offset, device), vectors(self.rows.gain, device)
        self._samples: DeviceArray = wp.array(self.rows.samples, dtype=wp.int32, device=device)

    def added(self, texture: DeviceArray) -> tuple[DeviceArray, Callable[[DeviceArray], DeviceArray]]:
        """Return the radiance that a texture adds to `offset`, vec3d [N], and the transpose of its derivative.

        The transpose maps a gradient of the radiance, [N], to one of the texture, [h * w].

        Args:
            texture: sRGB, 0 to 1, vec3d [h * w].
        """
        light, slope = self.mips.decoded(texture)

        def transposed(gradient: DeviceArray) -> DeviceArray:
            texels = wp.empty(self._samples.size, dtype=wp.vec3d, device=self.device)
            rows = {"samples": self._samples, "gain": self._gain, "gradient": gradient}
            launch(texel_gradients, texels.size, self.device, **rows, out_texels=texels)
            return multiplied(self.mips.transposed_product(self.taps.transposed_product(texels)), slope)

        return self._radiance(self.mips.product(light)), transposed

    def of_levels(self, texels: Values) -> DeviceArray:
        """Return the radiance of the slots of a texture by the sRGB values of all its mip levels, [T, 3]."""
        light, _ = self.mips.decoded(vectors(texels, self.device))
        return added(self.offset, self._radiance(light))

    def _radiance(self, texels: DeviceArray) -> DeviceArray:
        radiance: DeviceArray = wp.zeros(self.offset.size, dtype=wp.vec3d, device=self.device)
        shown = self.taps.product(texels)
        rows = {"samples": self._samples, "gain": self._gain, "texels": shown}
        launch(light_slots, shown.size, self.device, **rows, out_radiance=radiance)
        return radiance
