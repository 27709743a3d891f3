"""Texture maps painted with textures that were made for other models.

Camouflage for CARLA's cars comes in two forms. DTA and ACTIVE repeat a square image over the car along three axes
(world-aligned, triplanar); FCA and RAUCA paint a model by its own texture coordinates. Here both become an image for
the texture map of a body of this project, so that attacks on different models are compared in one scene.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from recipe_compiler.ir.assets import MeshData
from recipe_compiler.ir.patches import PatchFace

from recipe_runtime.report.texture_maps import Island, along, map_size

Pixels = NDArray[np.uint8]  # [H, W, 3], sRGB
Floats = NDArray[np.float64]

_MARGIN = 1.02  # size of the box of a texture map, relative to the body in it
_EMPTY = (128, 128, 128)
_MAX_LAYERS = 200  # of triangles of a model behind each other: painting takes time for each


def tiled(islands: Sequence[Island], aspect: float, tile: Pixels, metres: float) -> bytes:
    """Return a PNG of a texture map on which an image is repeated, upright and not mirrored from every side.

    Args:
        islands: The islands of the map, with their names.
        aspect: Its width by its height.
        tile: The image.
        metres: Width of the image on the body; its height follows.
    """
    page = _Page(aspect)
    for face, box, points in page.areas(islands):
        scale = (box[2] - box[0]) / face.width  # pixels a metre
        width = max(1, round(metres * scale))
        height = max(1, round(width * tile.shape[0] / tile.shape[1]))
        x, y = (np.floor(along(points, axis) * scale).astype(np.int64) for axis in (face.right, face.down))
        (columns, x), (rows, y) = _needed(x, width), _needed(y, height)
        strips = [[_scaled(tile, (width, height), across, down) for across in columns] for down in rows]
        page.put(box, np.concatenate([np.concatenate(strip, axis=1) for strip in strips])[y, x])
    return page.png()


def _needed(places: NDArray[np.int64], size: int) -> tuple[list[tuple[int, int]], NDArray[np.int64]]:
    """Return the ranges of an image, repeated along an axis, that are needed; and the indices of places in them.

    Args:
        places: Places along the axis, in pixels.
        size: Pixels of the image along the axis.
    """
    low = int(places.min())
    number = int(places.max()) - low + 1
    if number >= size:
        return [(0, size)], places % size
    start = low % size
    rest = start + number - size
    return [(start, min(start + number, size))] + ([(0, rest)] if rest > 0 else []), places - low


def _scaled(tile: Pixels, size: tuple[int, int], across: tuple[int, int], down: tuple[int, int]) -> Pixels:
    """Return the columns `across` and rows `down` of an image scaled to `size`; the rest is not computed."""
    crop: list[slice] = []
    ends: list[tuple[float, float]] = []
    for (start, stop), length, scaled in ((across, tile.shape[1], size[0]), (down, tile.shape[0], size[1])):
        first, last = start * length / scaled, stop * length / scaled
        reach = 3 * max(1, -(-length // scaled)) + 1  # of the filter
        begin = max(0, int(first) - reach)
        crop.append(slice(begin, min(length, int(last) + 1 + reach)))
        ends.append((first - begin, last - begin))
    box = (ends[0][0], ends[1][0], ends[0][1], ends[1][1])
    part = Image.fromarray(np.ascontiguousarray(tile[crop[1], crop[0]]))
    shape = (across[1] - across[0], down[1] - down[0])
    return np.asarray(part.resize(shape, Image.Resampling.LANCZOS, box), np.uint8)


def unwrapped(islands: Sequence[Island], aspect: float, model: MeshData, picture: Pixels, turn: int = 0) -> bytes:
    """Return a PNG of a texture map that looks like another model with its picture, seen from each side.

    The model is stretched to the box of the map. Each point takes the colour of the outermost surface of the model that
    lies behind it.

    Args:
        islands: The islands of the map, with their names; all of one part.
        aspect: Its width by its height.
        model: The other model; x forward, y left, z up. Its parts without texture coordinates are left out.
        picture: Its picture.
        turn: Degrees, a multiple of 90, by which the model is turned to the left first.

    Raises:
        ValueError: The map has several parts, or the model no texture coordinates or far too many triangles.
    """
    if len({face.part for _, face in islands}) > 1:
        raise ValueError("the body has several parts, which a model cannot be stretched to")
    mapped = [part for part in model.parts if part.mapped]
    if not mapped:
        raise ValueError("the model has no texture coordinates")
    corners = np.concatenate([part.vertices[part.triangles] for part in mapped])
    uvs = np.concatenate([part.uvs[part.triangles] for part in mapped])
    for _ in range(turn // 90 % 4):
        corners = corners[..., [1, 0, 2]] * (-1.0, 1.0, 1.0)
    corners = _stretched(corners, np.array([corner for _, face in islands for corner in face.corners]))
    page = _Page(aspect)
    for face, box, _ in page.areas(islands):
        page.put(box, *_seen(face, (box[2] - box[0], box[3] - box[1]), corners, uvs, picture))
    return page.png()


class _Page:
    """A texture map in the making."""

    def __init__(self, aspect: float) -> None:
        self._size = map_size(aspect)
        self._pixels = np.full((self._size[1], self._size[0], 3), _EMPTY, np.uint8)
        self._filled = np.zeros((self._size[1], self._size[0]), np.bool_)

    def areas(self, islands: Sequence[Island]) -> Iterator[tuple[PatchFace, tuple[int, int, int, int], Floats]]:
        """Yield each island's face, its box in pixels, and the point [h, w, 3] of each of its pixels, metres."""
        for _, face in islands:
            left, top, right, bottom = (round(v * self._size[n % 2]) for n, v in enumerate(face.region))
            if right <= left or bottom <= top:
                continue
            u = (np.arange(right - left) + 0.5) / (right - left) * face.width
            v = (np.arange(bottom - top) + 0.5) / (bottom - top) * face.height
            across, down = u[None, :, None] * np.array(face.right), v[:, None, None] * np.array(face.down)
            yield face, (left, top, right, bottom), np.array(face.corner) + across + down

    def put(self, box: tuple[int, int, int, int], pixels: Pixels, filled: NDArray[np.bool_] | None = None) -> None:
        """Paint a box, where `filled`."""
        left, top, right, bottom = box
        self._pixels[top:bottom, left:right] = pixels
        self._filled[top:bottom, left:right] = True if filled is None else filled

    def png(self) -> bytes:
        """Return the map; the colours at the edges of what is painted go on beyond them."""
        step = 1
        while step < max(self._size) and not self._filled.all():
            for axis in (0, 1):
                self._spread(axis, step)
                self._spread(axis, -step)
            step *= 2
        made = io.BytesIO()
        Image.fromarray(self._pixels).save(made, "PNG")
        return made.getvalue()

    def _spread(self, axis: int, step: int) -> None:
        """Give empty pixels the colour of the pixel that lies `step` before them along an axis."""
        there, colours = np.roll(self._filled, step, axis), np.roll(self._pixels, step, axis)
        beyond = slice(None, step) if step > 0 else slice(step, None)
        there[(beyond, slice(None)) if axis == 0 else (slice(None), beyond)] = False
        taken = there & ~self._filled
        self._pixels[taken] = colours[taken]
        self._filled |= taken


def _stretched(corners: Floats, box: Floats) -> Floats:
    """Return triangles [T, 3, 3] moved and scaled to the box of points [n, 3], without its margin."""
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    start, end = box.min(axis=0), box.max(axis=0)
    middle, size = (start + end) / 2, (end - start) / _MARGIN
    middle[2], size[2] = start[2] + (end[2] - start[2]) / _MARGIN / 2, (end[2] - start[2]) / _MARGIN
    stretched: Floats = (corners - (low + high) / 2) * (size / np.maximum(high - low, 1e-9)) + middle
    return stretched


def _seen(
    face: PatchFace, size: tuple[int, int], corners: Floats, uvs: Floats, picture: Pixels
) -> tuple[Pixels, NDArray[np.bool_]]:
    """Return the model from one side, [h, w, 3], and where it is: triangles are painted from the rear to the front."""
    offset = corners - np.array(face.corner)
    x = along(offset, face.right) / face.width * size[0]
    y = along(offset, face.down) / face.height * size[1]
    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    if np.abs(area).sum() / 2 > _MAX_LAYERS * size[0] * size[1]:
        raise ValueError(f"on average, more than {_MAX_LAYERS} of the model's triangles lie behind each other")
    order = np.argsort(along(offset, face.normal).mean(axis=1), kind="stable")
    order = order[np.abs(area[order]) > 1e-9]
    numbers = Image.new("I", size, 0)
    pen = ImageDraw.Draw(numbers)
    for number, outline in zip(order.tolist(), np.stack([x, y], axis=-1)[order].reshape(-1, 6).tolist(), strict=True):
        pen.polygon(outline, fill=number + 1)
    shown = np.asarray(numbers, np.int64)
    found = np.maximum(shown - 1, 0)
    px, py = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    a, b, c = x[found], y[found], uvs[found]
    with np.errstate(divide="ignore", invalid="ignore"):
        first = ((a[..., 1] - px) * (b[..., 2] - py) - (a[..., 2] - px) * (b[..., 1] - py)) / area[found]
        second = ((a[..., 2] - px) * (b[..., 0] - py) - (a[..., 0] - px) * (b[..., 2] - py)) / area[found]
    first, second = (np.nan_to_num(share, nan=0.0, posinf=0.0, neginf=0.0) for share in (first, second))
    shares = np.clip(np.stack([first, second, 1.0 - first - second], axis=-1), 0.0, 1.0)
    uv = (c * (shares / np.maximum(shares.sum(axis=-1, keepdims=True), 1e-9))[..., None]).sum(axis=-2)
    height, width = picture.shape[:2]
    column = np.floor(uv[..., 0] * width).astype(np.int64) % width
    row = np.floor(uv[..., 1] * height).astype(np.int64) % height
    return picture[row, column], shown > 0
