"""Resampling of textures for a picture: downsampling to the size at which it shows them, then bilinear sampling.

Arithmetic is elementwise + - * / and sqrt on float64 and integers, so that every host computes the same values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core.transforms import Array

Image = NDArray[np.uint8]


def texture_size(size: tuple[int, int], back: Array, x: Array, y: Array) -> tuple[int, int]:
    """Return the width and height, in pixels, at which a picture shows a texture; at most the texture's own.

    Args:
        size: Width and height of the texture.
        back: The homography [3, 3] from pixels (x, y, 1) to (u, v, 1) times a factor, with u and v from 0 to 1.
        x: Horizontal positions of the pixels that show it, [N], at least one.
        y: Vertical positions, [N].
    """
    middle_x, middle_y = (float(v.min()) + float(v.max()) for v in (x, y))
    px, py = middle_x / 2.0, middle_y / 2.0
    top_u, top_v, w = ((float(row[0]) * px + float(row[1]) * py) + float(row[2]) for row in back)
    sizes = []
    for top, row, most in ((top_u, back[0], size[0]), (top_v, back[1], size[1])):
        dx, dy = ((float(row[k]) * w - top * float(back[2, k])) / (w * w) for k in (0, 1))
        slope = float(np.sqrt(dx * dx + dy * dy))
        sizes.append(most if slope * most <= 1.0 else max(1, int(1.0 / slope)))
    return sizes[0], sizes[1]


def reduced(image: Image, width: int, height: int) -> Array:
    """Return an image downsampled to a size, float64 [height, width, 3]: the exact mean over each new texel's area.

    Args:
        image: uint8 [h, w, 3].
        width: 1 to w.
        height: 1 to h.
    """
    rows, cols = image.shape[:2]
    total = _area_sums(_area_sums(image.astype(np.int64), height, 0), width, 1)
    return total / float(rows * cols)  # the sums are whole numbers below 2^53


def _area_sums(values: NDArray[np.int64], size: int, axis: int) -> NDArray[np.int64]:
    """Return sums over `size` equal intervals of an axis, times `size`."""
    length = values.shape[axis]
    if size == length:
        return values * size
    values = np.moveaxis(values, axis, 0)
    before = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    ends = np.arange(size + 1, dtype=np.int64) * length
    whole, rest = ends // size, ends % size
    padded = np.concatenate([values, np.zeros_like(values[:1])])
    shape = (-1,) + (1,) * (values.ndim - 1)
    until = before[whole] * size + padded[whole] * rest.reshape(shape)
    return np.moveaxis(until[1:] - until[:-1], 0, axis)


def sampled(image: Array, u: Array, v: Array) -> Array:
    """Sample an image bilinearly at points, float64 [N, 3]; coordinates are clamped to the edge.

    Args:
        image: float64 [h, w, 3].
        u: Horizontal positions [N], from 0 at its left edge to 1 at its right edge.
        v: Vertical positions [N], from 0 at its top edge to 1 at its bottom edge.
    """
    (x0, x1, fx), (y0, y1, fy) = neighbours(u, image.shape[1]), neighbours(v, image.shape[0])
    top = image[y0, x0] + (image[y0, x1] - image[y0, x0]) * fx[:, None]
    bottom = image[y1, x0] + (image[y1, x1] - image[y1, x0]) * fx[:, None]
    values: Array = top + (bottom - top) * fy[:, None]
    return values


def neighbours(u: Array, size: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return the indices of the texels on both sides of positions, and the weight of the second.

    Args:
        u: Positions from 0 to 1, [N].
        size: Number of texels.
    """
    at = np.clip(u * float(size) - 0.5, 0.0, float(size - 1))
    first = np.floor(at).astype(np.int64)
    return first, np.minimum(first + 1, size - 1), at - first
