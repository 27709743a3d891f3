"""A patch of mode `digital` or `color_transfer` as a function of its texture, which is warped into the picture.

In mode `digital`, the values of the pixels that show the patch are linear in the texture's sRGB values: W R texture,
where R downsamples the texture to about the size at which the picture shows it, and W interpolates it bilinearly. In
mode `color_transfer` they are clip(ratio * W f(R texture)), where f changes colours: see `color_transfer`. f and the
brightness ratios do not depend on the texture.
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
from recipe_runtime.render.linear.linear_map import numbers, vectors
from recipe_runtime.render.linear.sparse import RowMatrix, SparseProduct, row_matrix


class InsertedView(TextureView):
    """A patch of mode `digital` or `color_transfer` in a frame of a sensor.

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
        self._change = frame.color_change(patch)

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
        image = reduction.product(texture)
        if self._change is None:
            return warp.product(image), lambda y: reduction.transposed_product(warp.transposed_product(y))
        change, ratios = self._change  # on the host: the image has about as many texels as the picture shows
        colours, colours_transposed = change.linearised(numbers(image) * 255.0)
        values = numbers(warp.product(vectors(colours / 255.0, self.device))) * ratios
        kept = np.where((values < 0.0) | (values > 1.0), 0.0, ratios)

        def transposed(gradient: DeviceArray) -> DeviceArray:
            back = warp.transposed_product(vectors(numbers(gradient) * kept, self.device))
            return reduction.transposed_product(vectors(colours_transposed(numbers(back)), self.device))

        return vectors(np.clip(values, 0.0, 1.0), self.device), transposed

    def render(self, texture: Texture) -> NDArray[np.uint8]:
        """As `TextureView.render`."""
        return self._frame.render({self.patch: as_image(self.patch, texture)})

    def rounded(self, texture: Texture) -> NDArray[np.uint8]:
        """As `TextureView.rounded`; in mode `color_transfer`, whose methods round in between, as `render`."""
        if self._change is not None:
            return self.render(texture)
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
