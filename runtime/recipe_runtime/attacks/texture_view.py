"""A patch in a frame as a function of its texture: what the views of rendered and inserted patches share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.attacks.textures import Texture, Values, as_gradient, as_values
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.linear.linear_map import numbers, vectors
from recipe_runtime.render.retexture.tensor_exchange import places_of


class TextureView(ABC):
    """A patch in a frame of a sensor.

    Attributes:
        patch: Name of the patch.
        shape: Of textures, [h, w, 3].
        device: `cpu` or `cuda:N`.
        pixels: Index, row by row, of each of the Q pixels that change with the texture, [Q].
        picture: The frame with the texture of the recipe, uint8 [H, W, 3].
    """

    patch: str
    shape: tuple[int, int, int]
    device: str
    pixels: NDArray[np.int32] | NDArray[np.int64]
    picture: NDArray[np.uint8]

    @property
    @abstractmethod
    def memory(self) -> int:
        """About how many bytes of memory the view takes, with its frame."""

    @abstractmethod
    def linearised(self, texture: DeviceArray) -> tuple[DeviceArray, Callable[[DeviceArray], DeviceArray]]:
        """Return the values of the pixels, vec3d [Q], 0 to 1, and the transpose of their derivative.

        The transpose maps a gradient of the values, [Q], to one of the texture, [h * w].

        Args:
            texture: sRGB, 0 to 1, vec3d [h * w] on the device.
        """

    @abstractmethod
    def render(self, texture: Texture) -> NDArray[np.uint8]:
        """Return the rendered picture for a texture, uint8 [H, W, 3], as `Scenario.render` does.

        Args:
            texture: uint8, or 0 to 1 (rounded to 8 bits), [h, w, 3]; of any size.
        """

    @abstractmethod
    def rounded(self, texture: Texture) -> NDArray[np.uint8]:
        """Return the picture for a texture by the linear map, rounded where a build rounds, uint8 [H, W, 3].

        Args:
            texture: uint8, or 0 to 1 (rounded to 8 bits, as in `render`), [h, w, 3].
        """

    def forward(self, texture: Texture) -> Values:
        """Return the picture for a texture, float64 [H, W, 3], 0 to 1; its pixels' values are not rounded."""
        out = self.picture / 255.0
        out.reshape(-1, 3)[self.pixels] = numbers(self.linearised(self._uploaded(texture))[0])
        return out

    def backward(self, texture: Texture, gradient: Values) -> Values:
        """Return the vector-Jacobian product of `forward`.

        Args:
            texture: The texture at which the derivative is taken, uint8 or 0 to 1, [h, w, 3].
            gradient: Gradient with respect to the picture, [H, W, 3]; a tensor is [3, H, W].

        Returns:
            The gradient of the texture, float64 [h, w, 3]; equal bytes on every machine.

        Raises:
            InputError: The texture or the gradient does not have the expected shape or type.
        """
        values = as_gradient(self.patch, gradient, self.picture.shape)
        transposed = self.linearised(self._uploaded(texture))[1]
        return numbers(transposed(vectors(values.reshape(-1, 3)[self.pixels], self.device))).reshape(self.shape)

    @cached_property
    def places(self) -> DeviceArray:
        """`pixels` on the device."""
        return places_of(self.pixels, self.device)

    def _uploaded(self, texture: Texture) -> DeviceArray:
        return vectors(as_values(self.patch, texture, self.shape), self.device)
