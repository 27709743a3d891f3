"""A patch in a frame as a function of its texture, with the exact gradient.

Each pixel that shows the patch has one sample or, at edges, up to four. The light of each sample is linear in the
texture:

    radiance = gain * (A @ M @ linear(texture)) + offset

M computes the mip levels. A is sparse: the weights of the texels that the renderer reads for the sample. gain is the
light of sun, sky and lamps with shadow, coverage and fog; offset is the light that does not depend on the texture.
Samples of wet ground that reflect a patch are included. The camera tone-maps samples, averages those of a pixel, and
adds noise: see `camera_curve`. Motion blur, bloom, distortion, chromatic aberration and supersampling come before the
noise: see `pixel_light`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.patches import PatchPlan

from recipe_runtime.attacks import camera_curve
from recipe_runtime.attacks.inserted_view import InsertedView
from recipe_runtime.attacks.mip_chain import MipChain, linear_light
from recipe_runtime.attacks.pixel_light import LensLight, PixelLight
from recipe_runtime.attacks.retextured_frame import RetexturedFrame
from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.textures import Texture, Values, as_image, check_shape, check_size
from recipe_runtime.frames.process_lock import ProcessLock
from recipe_runtime.render.retexture.patched_frame import PatchedFrame
from recipe_runtime.render.retexture.sparse import SparseProduct
from recipe_runtime.render.texture.mipmaps import mip_levels

_SAMPLE_BYTES, _TEXEL_BYTES = 150, 16  # of memory, per sample and per texel


class PatchView(TextureView):
    """A patch of mode `rendered` in a frame of a sensor.

    Attributes:
        gain: Of each of the N samples of these pixels, float64 [N, 3].
        offset: Of each sample, float64 [N, 3].
        samples: Index of each of the K samples that the patch covers, int32 [K]: the rows of A.
        taps: Products with A and its transpose, see `SparseProduct`.
        mips: Products with M and its transpose.
    """

    def __init__(
        self, frame: PatchedFrame, patch: str, width: int, height: int, exclusive: ProcessLock | None = None
    ) -> None:
        self._frame, self.patch, self.shape = frame, patch, (height, width, 3)
        self._exclusive = exclusive or ProcessLock()
        rows = frame.rows(patch)
        self.samples, self.gain, self.offset = rows.samples, rows.gain, rows.offset
        self.taps = SparseProduct(frame.taps(patch, width, height), frame.device)
        self.mips = MipChain(width, height)
        self._light: PixelLight | LensLight = PixelLight(frame.recording, frame.curve, frame.streak)
        if frame.lens is not None:
            self._light = LensLight(self._light, frame.lens, frame.device)
        self.curve, self.pixels = frame.curve, frame.pixels
        self.picture = frame.render({})

    @property
    def memory(self) -> int:
        """As `TextureView.memory`."""
        texels = self.mips.shape[0] * self.mips.shape[1]
        products = self.taps.memory + self._light.memory
        own = _SAMPLE_BYTES * len(self.gain) + _TEXEL_BYTES * texels
        return self._frame.memory + products + own + self.picture.nbytes

    def linearised(self, texture: Values) -> tuple[Values, Callable[[Values], Values]]:
        """As `TextureView.linearised`."""
        light, light_slope = linear_light(texture)
        level, saved = self._light.forward(self._radiance(self.mips.forward(light)))
        noisy, noise_slope = camera_curve.with_noise(level, self.curve.deviates.astype(np.float64), self.curve.noise)
        values, curve_slope = camera_curve.encoded(noisy, self.curve.encoded)

        def transposed(gradient: Values) -> Values:
            radiance = self._light.backward(saved, gradient * (curve_slope * noise_slope))
            texels = self.taps.backward(np.ascontiguousarray((radiance * self.gain)[self.samples]))
            return self.mips.backward(texels) * light_slope

        return values, transposed

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
        level, _ = self._light.forward(self._radiance(linear_light(channels / 255.0)[0]))
        noisy, _ = camera_curve.with_noise(level, self.curve.deviates.astype(np.float64), self.curve.noise)
        out = self.picture.copy()
        out.reshape(-1, 3)[self.pixels] = camera_curve.rounded(noisy, self.curve.rounded)
        return out

    def _radiance(self, texels: Values) -> Values:
        radiance = self.offset.copy()
        radiance[self.samples] += self.gain[self.samples] * self.taps.forward(texels)
        return radiance


def patch_view(frame: RetexturedFrame, patch: PatchPlan, size: tuple[int, int] | None) -> TextureView:
    """Return the view of a patch.

    Args:
        frame: The frame.
        patch: The patch.
        size: Height and width of textures; None for those of the recipe's image.

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
    size = int(size[0]), int(size[1])  # products of NumPy's integers overflow
    if patch.inserted:
        return InsertedView(frame, name, size[1], size[0])
    return PatchView(frame.scene, name, size[1], size[0], frame.exclusive)
