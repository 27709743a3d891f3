"""The picture of a frame with other textures of some patches that are on the frame's device."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from recipe_runtime.render.device.arrays import DeviceArray, struct_of
from recipe_runtime.render.linear.mip_chain import MipChain
from recipe_runtime.render.retexture.patched_frame import PatchedFrame


class TextureReplay:
    """Renders a frame with textures of fixed sizes, with the bytes of `PatchedFrame.render`.

    Args:
        frame: The frame.
        mips: The mip levels of the textures, by the name of the patch.
    """

    def __init__(self, frame: PatchedFrame, mips: Mapping[str, MipChain]) -> None:
        self._frame, self._mips = frame, mips
        self._shown = frame.textured({name: np.zeros(chain.shape, np.uint8) for name, chain in mips.items()})
        numbers = {plan.name: number for number, plan in enumerate(frame.plans)}
        self._firsts = {name: self._shown.first_texel(numbers[name]) for name in mips}

    def picture(self, textures: Mapping[str, DeviceArray]) -> DeviceArray:
        """Return the picture, uint8 [H * W * 3], which the next picture of the frame may overwrite.

        Args:
            textures: sRGB, 0 to 1, which is rounded to 8 bits, vec3d [h * w], by the name of the patch.
        """
        texels = struct_of(self._shown.album).texels
        for name, texture in textures.items():
            self._mips[name].round_into(texture, texels, self._firsts[name])
        return self._frame.drawn(self._shown)
