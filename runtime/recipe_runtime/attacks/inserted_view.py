"""A patch of mode `digital` as a function of its texture, which is warped into the finished picture.

The values of the pixels that show the patch are linear in the texture's sRGB values: W R texture, where R downsamples
the texture to about the size at which the picture shows it, and W interpolates it bilinearly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.attacks.retextured_frame import RetexturedFrame
from recipe_runtime.attacks.textures import Texture, Values, as_gradient, as_image, as_values
from recipe_runtime.insertion.inserter import InsertedPixels
from recipe_runtime.insertion.warp import neighbours
from recipe_runtime.render.retexture.sparse import EntryCount, RowMatrix, SparseProduct, row_matrix


class InsertedView:
    """A patch of mode `digital` in a frame of a sensor.

    Attributes:
        pixels: Index, row by row, of each of the Q pixels that change with the texture, int64 [Q].
        picture: The frame with the texture of the recipe, uint8 [H, W, 3].
        products: R and W with their transposes; empty if the frame does not show the patch.
    """

    def __init__(self, frame: RetexturedFrame, patch: str, width: int, height: int) -> None:
        self._frame, self.patch, self.shape = frame, patch, (height, width, 3)
        self.picture, found = frame.render({}), frame.inserted_pixels(patch)
        self.pixels: NDArray[np.int64] = np.zeros(0, np.int64)
        self.products: list[SparseProduct] = []
        if found is not None:
            self.pixels = found.rows * self.picture.shape[1] + found.columns
            self.products = [SparseProduct(matrix, frame.scene.device) for matrix in _matrices(found, width, height)]

    @property
    def memory(self) -> int:
        """About how many bytes of memory the view takes, with its frame."""
        return self._frame.memory + sum(product.memory for product in self.products) + self.picture.nbytes

    def forward(self, texture: Texture) -> Values:
        """Return the picture for a texture, uint8 or 0 to 1, float64 [H, W, 3], 0 to 1, not rounded in the patch."""
        out = self.picture / 255.0
        values = as_values(self.patch, texture, self.shape).reshape(-1, 3)
        if self.products:
            reduction, warp = self.products
            out.reshape(-1, 3)[self.pixels] = warp.forward(reduction.forward(values))
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
        as_values(self.patch, texture, self.shape)  # checks it: the derivative is the same at all textures
        values = as_gradient(self.patch, gradient, self.picture.shape)
        if not self.products:
            return np.zeros(self.shape)
        reduction, warp = self.products
        back = reduction.backward(warp.backward(values.reshape(-1, 3)[self.pixels]))
        return back.reshape(self.shape)

    def render(self, texture: Texture) -> NDArray[np.uint8]:
        """Return the picture for a texture, uint8 [H, W, 3], as `Scenario.render` does.

        Args:
            texture: uint8, or 0 to 1 (rounded to 8 bits), [h, w, 3]; of any size.
        """
        return self._frame.render({self.patch: as_image(self.patch, texture)})

    def rounded(self, texture: Texture) -> NDArray[np.uint8]:
        """Return the picture for a texture by the linear map, rounded as a build rounds it.

        Args:
            texture: uint8, or 0 to 1 (rounded to 8 bits, as in `render`), [h, w, 3].

        Returns:
            The picture, uint8 [H, W, 3].
        """
        return np.floor(self.forward(as_image(self.patch, texture)) * 255.0 + 0.5).astype(np.uint8)


def _matrices(pixels: InsertedPixels, width: int, height: int) -> tuple[RowMatrix, RowMatrix]:
    """Return R and W for textures of a size."""
    wide, high = pixels.reduced_size(width, height)
    u, v = pixels.places()
    overlaps = (wide * (-(-width // wide) + 1)) * (high * (-(-height // high) + 1))
    EntryCount("use a smaller texture or picture").add(4 * len(pixels.rows) + overlaps)
    (x0, x1, fx), (y0, y1, fy) = neighbours(u, wide), neighbours(v, high)
    columns = np.stack([y0 * wide + x0, y0 * wide + x1, y1 * wide + x0, y1 * wide + x1], axis=1)
    weights = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], axis=1)
    return _means(width, height, wide, high), _matrix(columns, weights, wide * high)


def _means(width: int, height: int, wide: int, high: int) -> RowMatrix:
    """Return the matrix of `warp.reduced`: the mean over the area of each new texel."""
    (rows, down), (columns, across) = _overlaps(height, high), _overlaps(width, wide)
    places = rows[:, None, :, None] * width + columns[None, :, None, :]
    weights = down[:, None, :, None] * across[None, :, None, :]
    return _matrix(places.reshape(wide * high, -1), weights.reshape(wide * high, -1), width * height)


def _overlaps(length: int, size: int) -> tuple[NDArray[np.int64], Values]:
    """Return the texels, of `length`, that each of `size` new texels overlaps, and the share of each, [size, max]."""
    starts = np.arange(size, dtype=np.int64)[:, None] * length  # in units of 1 / size of a texel
    places = starts // size + np.arange(-(-length // size) + 1, dtype=np.int64)
    common = np.minimum(places * size + size, starts + length) - np.maximum(places * size, starts)
    return np.minimum(places, length - 1), np.maximum(common, 0) / float(length)


def _matrix(columns: NDArray[np.int64], weights: Values, width: int) -> RowMatrix:
    firsts = (np.arange(len(columns) + 1) * columns.shape[1]).astype(np.int32)
    return row_matrix(firsts, columns.reshape(-1).astype(np.int32), weights.reshape(-1), width)
