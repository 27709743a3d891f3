"""A patch of mode `digital` as a function of its texture, which is warped into the finished picture.

The values of the pixels that show the patch are linear in the texture's sRGB values: W R texture, where R downsamples
the texture to about the size at which the picture shows it, and W interpolates it bilinearly.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.attacks.retextured_frame import RetexturedFrame
from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.textures import Texture, Values, as_image
from recipe_runtime.insertion.inserter import InsertedPixels
from recipe_runtime.insertion.warp import neighbours
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.linear.linear_map import vectors
from recipe_runtime.render.linear.sparse import RowMatrix, SparseProduct, row_matrix


class InsertedView(TextureView):
    """A patch of mode `digital` in a frame of a sensor.

    Attributes:
        products: R and W with their transposes; empty if the frame does not show the patch.
    """

    def __init__(self, frame: RetexturedFrame, patch: str, width: int, height: int) -> None:
        self._frame, self.patch, self.shape, self.device = frame, patch, (height, width, 3), frame.scene.device
        self.picture, found = frame.render({}), frame.inserted_pixels(patch)
        self.pixels = np.zeros(0, np.int64)
        self.products: list[SparseProduct] = []
        if found is not None:
            self.pixels = found.rows * self.picture.shape[1] + found.columns
            self.products = [SparseProduct(matrix, self.device) for matrix in _matrices(found, width, height)]

    @property
    def memory(self) -> int:
        """As `TextureView.memory`."""
        return self._frame.memory + sum(product.memory for product in self.products) + self.picture.nbytes

    def linearised(self, texture: DeviceArray) -> tuple[DeviceArray, Callable[[DeviceArray], DeviceArray]]:
        """As `TextureView.linearised`."""
        if not self.products:
            none = vectors(np.zeros((0, 3)), self.device)
            return none, lambda gradient: vectors(np.zeros(self.shape), self.device)
        reduction, warp = self.products
        values = warp.product(reduction.product(texture))
        return values, lambda gradient: reduction.transposed_product(warp.transposed_product(gradient))

    def render(self, texture: Texture) -> NDArray[np.uint8]:
        """As `TextureView.render`."""
        return self._frame.render({self.patch: as_image(self.patch, texture)})

    def rounded(self, texture: Texture) -> NDArray[np.uint8]:
        """As `TextureView.rounded`."""
        return np.floor(self.forward(as_image(self.patch, texture)) * 255.0 + 0.5).astype(np.uint8)


def _matrices(pixels: InsertedPixels, width: int, height: int) -> tuple[RowMatrix, RowMatrix]:
    """Return R and W for textures of a size."""
    wide, high = pixels.reduced_size(width, height)
    u, v = pixels.places()
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
