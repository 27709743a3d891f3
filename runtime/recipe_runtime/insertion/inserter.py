"""Inserts the textures of patches into the finished pictures of a scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.patches import WITH_CHART, PatchPlan
from recipe_compiler.ir.plan import AppearancePlan, SensorPlan, TexturePlan

from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array, sensor_transform
from recipe_runtime.insertion import projection
from recipe_runtime.insertion.color_chart import ChartPixels, chart_appearance, chart_pixels
from recipe_runtime.insertion.color_transfer import Transfer, transfer
from recipe_runtime.insertion.warp import Image, reduced, sampled, texture_size

_IMAGES = 8  # decoded textures in memory


class FrameRenderer(Protocol):
    """Renders one frame of one sensor, without insertion."""

    def picture(self, appearance: AppearancePlan) -> NDArray[np.uint8]:
        """Return the picture, uint8 [H, W, 3] sRGB. The next call may overwrite it."""

    def patch_map(self, appearance: AppearancePlan) -> NDArray[np.uint8]:
        """Return 1 + the index of the patch that each pixel shows, uint8 [H, W]; 0 for none."""


@dataclass(frozen=True, eq=False)
class InsertedPixels:
    """The N pixels into which the texture of a patch is inserted, and their texture coordinates."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    x: Array  # of a pinhole camera's picture, pixels
    y: Array
    homography: Array  # [3, 3] from (x, y, 1) to the texture, 0 to 1 each, times a factor

    def reduced_size(self, width: int, height: int) -> tuple[int, int]:
        """Return the width and height to which a texture of a size is downsampled."""
        return texture_size((width, height), self.homography, self.x, self.y)

    def places(self) -> tuple[Array, Array]:
        """Return u and v of the pixels, 0 to 1 each from the texture's top left."""
        u, v, _ = projection.apply_homography(self.homography, self.x, self.y)
        return u, v


class Inserter:
    """Inserts textures into the pictures of one scene.

    Args:
        trace: The motion of the scene.
        load: Returns the pixels of an image, uint8 [h, w, 3] sRGB.
    """

    def __init__(self, trace: Trace, load: Callable[[TexturePlan], Image]) -> None:
        self._trace = trace
        self._image = lru_cache(_IMAGES)(lambda file: load(TexturePlan(file=file)))

    def picture(
        self,
        renderer: FrameRenderer,
        appearance: AppearancePlan,
        sensor: SensorPlan,
        frame: int,
        textures: Mapping[str, Image] | None = None,
    ) -> NDArray[np.uint8]:
        """Return the picture of a frame with inserted textures, uint8 [H, W, 3] sRGB.

        Args:
            renderer: The renderer of the frame.
            appearance: The appearance.
            sensor: The sensor.
            frame: Number of the frame.
            textures: Images to insert in place of the recipe's, uint8 [h, w, 3] sRGB, by the name of the patch.
        """
        picture = renderer.picture(appearance)
        if not any(patch.inserted for patch in appearance.patches):
            return picture
        before, picture = picture.copy(), picture.copy()
        shown, others = renderer.patch_map(appearance), textures or {}
        for number, patch in enumerate(appearance.patches):
            pixels = self.pixels(shown, appearance, number, sensor, frame) if patch.inserted else None
            if pixels is None:
                continue
            change = self.change(renderer, appearance, number)
            texture = others[patch.name] if patch.name in others else self._texture(patch, frame)
            rows, columns = pixels.rows, pixels.columns
            values = _values(texture, change, pixels, before[rows, columns])
            picture[rows, columns] = np.floor(np.clip(values, 0.0, 255.0) + 0.5).astype(np.uint8)
        return picture

    def change(self, renderer: FrameRenderer, appearance: AppearancePlan, number: int) -> Transfer | None:
        """Return the colour transform of the patch with a number; None if its mode has none."""
        method = appearance.patches[number].transfer
        if method is None:
            return None
        return transfer(method, _chart(renderer, appearance, number) if method in WITH_CHART else None)

    def pixels(
        self, patch_map: NDArray[np.uint8], appearance: AppearancePlan, number: int, sensor: SensorPlan, frame: int
    ) -> InsertedPixels | None:
        """Return the pixels into which a patch is inserted; None if it is not visible.

        Args:
            patch_map: 1 + the number of the patch that each pixel shows, uint8 [H, W].
            appearance: The appearance.
            number: The number of the patch, from 0.
            sensor: The sensor.
            frame: Number of the frame.
        """
        rows, columns = np.nonzero(patch_map == number + 1)
        if not len(rows):
            return None
        patch, camera = appearance.patches[number], sensor.camera
        view = projection.view_from_world(sensor_transform(sensor, self._trace, frame))
        there = projection.view_from_part(patch, self._trace, frame, view)
        back = projection.inverse(projection.homography(patch.faces[0], camera, there))
        x, y = projection.undistorted(camera, columns.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5)
        return InsertedPixels(rows, columns, x, y, back)

    def texture_size(self, patch: PatchPlan, frame: int) -> tuple[int, int] | None:
        """Return width and height of a patch's own image; None for a colour."""
        if patch.texture.at(frame) is None:
            return None
        texture = self._texture(patch, frame)
        return texture.shape[1], texture.shape[0]

    def _texture(self, patch: PatchPlan, frame: int) -> Image:
        """Return the texture of a patch in a frame; a single texel for a colour."""
        file = patch.texture.at(frame)
        if file is None:
            code = str(patch.texture.colour)
            return np.array([[[int(code[k : k + 2], 16) for k in (1, 3, 5)]]], np.uint8)
        return self._image(file)


def _chart(renderer: FrameRenderer, appearance: AppearancePlan, number: int) -> ChartPixels:
    """Render a colour chart in the place of a patch, and return its histograms."""
    with_chart = chart_appearance(appearance, number)
    picture = renderer.picture(with_chart)
    return chart_pixels(picture, renderer.patch_map(with_chart), number)


def _values(
    texture: Image,
    change: Transfer | None,
    pixels: InsertedPixels,
    placeholder: NDArray[np.uint8],
) -> Array:
    """Return the inserted values of pixels, float64 [N, 3], before clipping and rounding.

    Args:
        texture: The texture.
        change: Its colour transform.
        pixels: The pixels.
        placeholder: Their values before insertion, uint8 [N, 3].
    """
    image = reduced(texture, *pixels.reduced_size(texture.shape[1], texture.shape[0]))
    u, v = pixels.places()
    if change is None:
        return sampled(image, u, v)
    return sampled(change.texture(image), u, v) * change.ratios(placeholder)
