"""The values of the pixels that change with patches, from the radiance of their samples, with the transpose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.linear_map import multiplied, numbers, vectors
from recipe_runtime.render.retexture.patched_frame import PatchedFrame
from recipe_runtime.render.retexture.pixel_light import LensLight, PixelLight
from recipe_runtime.render.retexture.response_kernels import encode_pixels


class Development:
    """Reflections, rain, exposure, lens, tone curve, noise and encoding of a frame: all after a sample's radiance.

    Arrays are on the device of the frame.
    """

    def __init__(self, frame: PatchedFrame) -> None:
        self._device, self.curve = frame.device, frame.curve
        light = PixelLight(frame.recording, self.curve.gain, self.curve.white, frame.streak, frame.device)
        self._light = light if frame.lens is None else LensLight(light, frame.lens, frame.device)
        self._deviates = vectors(self.curve.deviates, frame.device)
        self._encoded: DeviceArray = wp.array(self.curve.encoded, dtype=wp.float64, device=frame.device)

    @property
    def memory(self) -> int:
        """Bytes of its sparse matrices."""
        return self._light.memory

    def linearised(self, radiance: DeviceArray) -> tuple[DeviceArray, Callable[[DeviceArray], DeviceArray]]:
        """Return the values of the pixels, vec3d [Q], 0 to 1, of the radiance of slots, vec3d [N], and the transpose.

        The transpose maps a gradient of the values to one of the radiance.
        """
        level, saved = self._light.forward(radiance)
        _, values, slope = self._encode(level)
        return values, lambda gradient: self._light.backward(saved, multiplied(gradient, slope))

    def rounded(self, radiance: DeviceArray) -> NDArray[np.uint8]:
        """Return the 8-bit values of the pixels, [Q, 3], of the radiance of slots, rounded as the renderer rounds."""
        noisy, _, _ = self._encode(self._light.forward(radiance)[0])
        last = len(self.curve.rounded) - 1
        return self.curve.rounded[np.clip(numbers(noisy) * last + 0.5, 0.0, last).astype(np.int64)]

    def _encode(self, level: DeviceArray) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
        """Return light with noise, the pictures' values, and their derivative by the light without noise."""
        noisy, values, slope = (wp.empty(level.size, dtype=wp.vec3d, device=self._device) for _ in range(3))
        given = {"level": level, "deviates": self._deviates, "noise": self.curve.noise, "table": self._encoded}
        out = {"out_noisy": noisy, "out_values": values, "out_slope": slope}
        launch(encode_pixels, level.size, self._device, **given, **out)
        return noisy, values, slope
