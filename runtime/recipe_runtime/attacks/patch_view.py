"""A patch in a frame as a function of its texture, with the exact gradient.

Each pixel that shows the patch has one sample or, at edges, up to four. The light of each sample is linear in the
texture:

    radiance = gain * (A @ M @ linear(texture)) + offset

M computes the mip levels. A is sparse: the weights of the texels that the renderer reads for the sample. gain is the
light of sun, sky and lamps with shadow, coverage and fog; offset is the light that does not depend on the texture.
Samples of wet ground that reflect a patch are included. The camera tone-maps samples, averages those of a pixel, and
adds noise: see `response_kernels`. Motion blur, bloom, distortion, chromatic aberration and supersampling come before
the noise: see `pixel_light`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.patches import PatchPlan

from recipe_runtime.attacks.inserted_view import InsertedView
from recipe_runtime.attacks.retextured_frame import RetexturedFrame
from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.textures import Texture, as_image, check_shape, check_size
from recipe_runtime.frames.process_lock import ProcessLock
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.linear.linear_map import added
from recipe_runtime.render.retexture.development import Development
from recipe_runtime.render.retexture.patched_frame import PatchedFrame
from recipe_runtime.render.retexture.texture_light import TextureLight
from recipe_runtime.render.texture.mipmaps import mip_levels

_SAMPLE_BYTES, _TEXEL_BYTES = 200, 48  # of memory, per sample and per texel


class PatchView(TextureView):
    """A patch of mode `rendered` in a frame of a sensor.

    Attributes:
        gain: Of each of the N samples of these pixels, float64 [N, 3].
        offset: Of each sample, float64 [N, 3].
        samples: Index of each of the K samples that the patch covers, int32 [K]: the rows of A.
        taps: Products with A and its transpose, see `SparseProduct`.
        mips: Products with M and its transpose, of textures [h * w, 3].
        light: The same on the frame's device.
    """

    def __init__(
        self,
        frame: PatchedFrame,
        patch: str,
        width: int,
        height: int,
        exclusive: ProcessLock | None = None,
        black: Collection[str] = (),
        development: Development | None = None,
    ) -> None:
        """Find how the frame depends on a patch's texture.

        Args:
            frame: The frame.
            patch: Name of the patch.
            width: Of its textures, texels.
            height: Of its textures, texels.
            exclusive: The lock of the scene, with which the frame shares buffers.
            black: Other patches, which are black in `offset`; the rest have the recipe's textures.
            development: That of the frame, if there is one.
        """
        self._frame, self.patch, self.shape, self.device = frame, patch, (height, width, 3), frame.device
        self._exclusive = exclusive or ProcessLock()
        self.light = TextureLight(frame, patch, width, height, black)
        self.samples, self.gain, self.offset = self.light.rows.samples, self.light.rows.gain, self.light.rows.offset
        self.taps, self.mips = self.light.taps, self.light.mips
        self.development = development or Development(frame)
        self.curve, self.pixels = self.development.curve, frame.pixels
        self.picture = frame.render({})

    @property
    def memory(self) -> int:
        """As `TextureView.memory`."""
        own = _SAMPLE_BYTES * len(self.gain) + _TEXEL_BYTES * self.mips.size
        return self._frame.memory + self.taps.memory + self.development.memory + own + self.picture.nbytes

    def linearised(self, texture: DeviceArray) -> tuple[DeviceArray, Callable[[DeviceArray], DeviceArray]]:
        """As `TextureView.linearised`."""
        radiance, texture_gradient = self.light.added(texture)
        values, radiance_gradient = self.development.linearised(added(self.light.offset, radiance))
        return values, lambda gradient: texture_gradient(radiance_gradient(gradient))

    def render(self, texture: Texture) -> NDArray[np.uint8]:
        """As `TextureView.render`."""
        image = as_image(self.patch, texture)
        with self._exclusive():
            return self._frame.render({self.patch: image})

    def rounded(self, texture: Texture) -> NDArray[np.uint8]:
        """As `TextureView.rounded`."""
        image = as_image(self.patch, texture)
        check_shape(self.patch, image.shape, self.shape)
        texels = np.concatenate([level.reshape(-1) for level in mip_levels(image)])
        channels = np.stack([texels & 255, texels >> 8 & 255, texels >> 16 & 255], axis=-1)
        out = self.picture.copy()
        out.reshape(-1, 3)[self.pixels] = self.development.rounded(self.light.of_levels(channels / 255.0))
        return out


def patch_view(frame: RetexturedFrame, patch: PatchPlan, size: tuple[int, int] | None) -> TextureView:
    """Return the view of a patch.

    Args:
        frame: The frame.
        patch: The patch.
        size: Height and width of textures; None for those of the recipe's image.

    Raises:
        InputError: No size is given and the patch has no image, or the size is no pair or is too large.
    """
    height, width = size_of(frame, patch, size)
    if patch.inserted:
        return InsertedView(frame, patch.name, width, height)
    return PatchView(frame.scene, patch.name, width, height, frame.exclusive)


def size_of(frame: RetexturedFrame, patch: PatchPlan, size: tuple[int, int] | None) -> tuple[int, int]:
    """Return the height and width of a view's textures: those of the recipe's image if the size is None.

    Raises:
        InputError: No size is given and the patch has no image, or the size is no pair or is too large.
    """
    name = patch.name
    if size is None:
        own = frame.texture_size(patch)
        if own is None:
            raise InputError(f"patch {name}: its texture is a colour, which has no size; give the texture's size")
        size = own[1], own[0]
    if not isinstance(size, Sequence) or len(size) != 2:
        raise InputError(f"patch {name}: the size of its texture is {size!r}; give height and width")
    check_size(name, size[1], size[0])
    return int(size[0]), int(size[1])  # products of NumPy's integers overflow
