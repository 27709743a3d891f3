"""The images of an appearance as one array of mip levels, on the host: means of linear light, in whole numbers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import AppearancePlan, FilePlan, TexturePlan
from recipe_compiler.ir.plan_bounds import MAX_TEXTURE_PIXELS

from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.texture.images import ImageAtlas
from recipe_runtime.render.texture.surface_colours import srgb_to_linear

Images = Callable[[TexturePlan], NDArray[np.uint8]]  # pixels [H, W, 3], sRGB
Levels = list[NDArray[np.uint32]]  # mip levels [H, W], the image itself first
Textures = Mapping[str, Mapping[str, TexturePlan]]  # body -> slot -> image
_Number = TypeVar("_Number", np.int64, np.float64)
_ONE = 65535  # linear light 1.0, as an integer
_ATLAS_CACHE_SIZE = 4  # each holds all images of an appearance, four thirds of their pixels times four bytes
_ATLAS_CACHE_TEXELS = 32 << 20  # of all cached atlases together, unless the last one alone has more
_ROWS = 256  # of an image that are summed at a time


@dataclass(frozen=True)
class Atlas:
    """The images of an appearance: a one-element array of `ImageAtlas`, and the number of each image in it."""

    images: DeviceArray
    numbers: Mapping[TexturePlan, int]
    texels: int


class ImageAtlases:
    """The image atlases of the appearances of a geometry; the last few are cached."""

    def __init__(self, geometry: Geometry, images: Images | None, device: str) -> None:
        self._geometry, self._images, self._device = geometry, images or no_images, device
        self._kept: dict[tuple[str, ...], Atlas] = {}
        self._levels: dict[TexturePlan, Levels] = {}  # of the images of the appearance that was used last

    def of(self, appearance: AppearancePlan, patched: Sequence[TexturePlan] = ()) -> Atlas:
        """Return an appearance's atlas; `patched` are the images that its patches show."""
        name = appearance.colours if appearance.textures or patched else "", *(t.file.sha256 for t in patched)
        if name not in self._kept:
            own = {texture for slots in appearance.textures.values() for texture in slots.values()}
            self._levels = {texture: levels for texture, levels in self._levels.items() if texture in own}
            made = atlas_of(self._geometry, appearance.textures, self._levels_of, self._device, patched)
            self._levels = {texture: levels for texture, levels in self._levels.items() if texture in own}
            self._kept[name] = made
            self._drop_oldest()
        return self._kept[name]

    def _levels_of(self, texture: TexturePlan) -> Levels:
        """The levels of an image; those of the last appearance are kept, since images of patches may change."""
        if texture not in self._levels:
            self._levels[texture] = mip_levels(self._images(texture))
        return self._levels[texture]

    def _drop_oldest(self) -> None:
        def texels() -> int:
            return sum(atlas.texels for atlas in self._kept.values())

        while len(self._kept) > 1 and (len(self._kept) > _ATLAS_CACHE_SIZE or texels() > _ATLAS_CACHE_TEXELS):
            self._kept.pop(next(iter(self._kept)))


def no_images(texture: TexturePlan) -> NDArray[np.uint8]:
    """Raise ValueError; for scenes without images."""
    raise ValueError(f"no reader was given for image sha256:{texture.file.sha256}")


def atlas_of(
    geometry: Geometry,
    textures: Textures,
    levels_of: Callable[[TexturePlan], Levels],
    device: str,
    patched: Sequence[TexturePlan] = (),
) -> Atlas:
    """Return the images of a geometry's surfaces and of patches; an image that several show is stored once.

    Raises:
        InputError: They have more pixels than those of a recipe may have: the plan may be untrusted.
    """
    wanted = [textures.get(key.body, {}).get(key.slot) for key in geometry.surfaces]
    known = list(dict.fromkeys(texture for texture in (*wanted, *patched) if texture is not None))
    ladders, pixels, counted = [], 0, set[tuple[FilePlan, int | None]]()
    for texture in known:
        ladders.append(levels_of(texture))
        pixels += 0 if (texture.file, texture.number) in counted else ladders[-1][0].size
        counted.add((texture.file, texture.number))
        if pixels > MAX_TEXTURE_PIXELS:
            raise InputError(
                f"the images have more than {MAX_TEXTURE_PIXELS:,} pixels in total",
                help="use fewer or smaller images",
                code=Code.INPUT_LIMIT,
            )
    numbers = {texture: number for number, texture in enumerate(known)}
    of_surface = [-1 if texture is None else numbers[texture] for texture in wanted]
    atlas = image_atlas(ladders, [texture.repeat for texture in known], of_surface, device)
    texels = sum(level.size for ladder in ladders for level in ladder)
    return Atlas(atlas, numbers, texels)


def image_atlas(
    ladders: Sequence[Sequence[NDArray[np.uint32]]], repeats: Sequence[bool], of_surface: Sequence[int], device: str
) -> DeviceArray:
    """Return a one-element array of `ImageAtlas`.

    Args:
        ladders: The mip levels of each image, as `mip_levels` returns them.
        repeats: Whether each image repeats beyond its edges.
        of_surface: The image of each surface, -1 for none.
        device: The device.
    """
    levels = [level for ladder in ladders for level in ladder]
    sizes = np.array([level.size for level in levels], np.int64)
    texels = np.concatenate([level.reshape(-1) for level in levels]) if levels else np.zeros(1, np.uint32)
    columns = {
        "of_surface": of_surface,
        "first": np.cumsum([0, *(len(ladder) for ladder in ladders)]),
        "repeats": repeats,
        "starts": np.cumsum(sizes) - sizes,
        "widths": [level.shape[1] for level in levels],
        "heights": [level.shape[0] for level in levels],
    }
    arrays = {name: np.array(values, np.int32).reshape(-1) for name, values in columns.items()}
    atlas = set_fields(
        ImageAtlas(),
        **{name: wp.array(values, dtype=wp.int32, device=device) for name, values in arrays.items()},
        texels=wp.array(texels, dtype=wp.uint32, device=device),
        linear=wp.array(_linear(), dtype=wp.float32, device=device),
    )
    return struct_array([atlas], device)


@cache
def _linear() -> NDArray[np.float32]:
    """Return the linear light of each 8-bit value."""
    return np.array([srgb_to_linear(v) for v in range(256)], np.float32)


def mip_levels(pixels: NDArray[np.uint8]) -> Levels:
    """Return an image [H, W, 3] and its coarser levels, down to one texel, each texel red, green << 8, blue << 16.

    Texel i of level l is the mean of the texels i * 2^l to (i + 1) * 2^l of the image, as far as it extends, in linear
    light, rounded to the nearest 8-bit colour. Sums are integers, so their order does not matter.
    """
    linear = linear_integers()
    levels = [_packed(pixels)]
    height, width = pixels.shape[:2]
    if height == 1 and width == 1:
        return levels
    # The first level is computed in strips of rows: sums need eight times the memory of the image.
    strips = [halved(linear[pixels[y : y + _ROWS]]) for y in range(0, height, _ROWS)]
    sums, size = np.concatenate(strips), 2
    while True:
        levels.append(_packed(_nearest(sums, covered(height, size)[:, None] * covered(width, size)[None, :])))
        if sums.shape[:2] == (1, 1):
            return levels
        sums, size = halved(sums), size * 2


def halved(values: NDArray[_Number]) -> NDArray[_Number]:
    """Return sums of 2 x 2 values; at odd ends, of those that exist."""
    rows = values[0::2].copy()
    rows[: len(values) // 2] += values[1::2]
    out = rows[:, 0::2].copy()
    out[:, : rows.shape[1] // 2] += rows[:, 1::2]
    return out


def covered(length: int, size: int) -> NDArray[np.int64]:
    """Return the number of texels of the image in each texel of a level, along one side."""
    return np.minimum(size, length - np.arange(0, length, size, dtype=np.int64))


def _nearest(sums: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return the 8-bit colours whose linear light is nearest to the means."""
    # A mean above the middle between two colours rounds up; twice the middle is an integer.
    twice = -(-2 * sums // counts[..., None])
    found: NDArray[np.uint8] = np.searchsorted(middles(), twice, side="left").astype(np.uint8)
    return found


@cache
def linear_integers() -> NDArray[np.int64]:
    """Return the linear light of each 8-bit value as a whole number, 65535 for white, [256]."""
    return np.array([round(srgb_to_linear(v) * _ONE) for v in range(256)], np.int64)


@cache
def middles() -> NDArray[np.int64]:
    """Return the sums of the linear light of neighbouring 8-bit values, [255]."""
    return np.array([a + b for a, b in itertools.pairwise(linear_integers().tolist())], np.int64)


def _packed(pixels: NDArray[np.uint8]) -> NDArray[np.uint32]:
    wide = pixels.astype(np.uint32)
    return (wide[..., 0] | (wide[..., 1] << 8) | (wide[..., 2] << 16)).astype(np.uint32)
