"""The values of the pixels that change with patches, from the radiance of their samples, with the derivative."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.attacks import camera_curve
from recipe_runtime.attacks.pixel_light import LensLight, PixelLight
from recipe_runtime.render.retexture.patched_frame import PatchedFrame

Values = NDArray[np.float64]


class Development:
    """Reflections, rain, exposure, lens, tone curve, noise and encoding of a frame: all after a sample's radiance."""

    def __init__(self, frame: PatchedFrame) -> None:
        self.curve = frame.curve
        self._light: PixelLight | LensLight = PixelLight(frame.recording, frame.curve, frame.streak)
        if frame.lens is not None:
            self._light = LensLight(self._light, frame.lens, frame.device)

    @property
    def memory(self) -> int:
        """Bytes of its sparse matrices."""
        return self._light.memory

    def linearised(self, radiance: Values) -> tuple[Values, Callable[[Values], Values]]:
        """Return the values of the pixels, [Q, 3], 0 to 1, of the radiance of slots, [N, 3], and the transpose.

        The transpose maps a gradient of the values to one of the radiance.
        """
        level, saved = self._light.forward(radiance)
        noisy, noise_slope = camera_curve.with_noise(level, self.curve.deviates.astype(np.float64), self.curve.noise)
        values, curve_slope = camera_curve.encoded(noisy, self.curve.encoded)

        def transposed(gradient: Values) -> Values:
            return self._light.backward(saved, gradient * (curve_slope * noise_slope))

        return values, transposed

    def rounded(self, radiance: Values) -> NDArray[np.uint8]:
        """Return the 8-bit values of the pixels, [Q, 3], of the radiance of slots, [N, 3]."""
        level, _ = self._light.forward(radiance)
        noisy, _ = camera_curve.with_noise(level, self.curve.deviates.astype(np.float64), self.curve.noise)
        return camera_curve.rounded(noisy, self.curve.rounded)
