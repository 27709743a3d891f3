"""Inserts the textures of patches into the finished pictures of a scene."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.patches import PatchPlan
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, SensorPlan, TexturePlan

from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array, sensor_transform
from recipe_runtime.insertion import projection
from recipe_runtime.insertion.color_chart import ChartPixels, chart_appearance, chart_pixels
from recipe_runtime.insertion.color_transfer import transfer, uses_chart
from recipe_runtime.insertion.warp import Image, reduced, sampled, texture_size

_IMAGES = 8  # decoded textures in memory


class FrameRenderer(Protocol):
    """Renders one frame of one sensor, without insertion."""

    def picture(self, appearance: AppearancePlan) -> NDArray[np.uint8]:
        """Return the picture, uint8 [H, W, 3] sRGB. The next call may overwrite it."""

    def patch_map(self, appearance: AppearancePlan) -> NDArray[np.uint8]:
        """Return 1 + the index of the patch that each pixel shows, uint8 [H, W]; 0 for none."""


class Inserter:
    """Inserts textures into the pictures of one scene.

    Args:
        trace: The motion of the scene.
        load: Returns the pixels of an image, uint8 [h, w, 3] sRGB.
    """

    def __init__(self, trace: Trace, load: Callable[[TexturePlan], Image]) -> None:
        self._trace, self._load = trace, load
        self._images: OrderedDict[str, Image] = OrderedDict()

    def picture(
        self, renderer: FrameRenderer, appearance: AppearancePlan, sensor: SensorPlan, frame: int
    ) -> NDArray[np.uint8]:
        """Return the picture of a frame with inserted textures, uint8 [H, W, 3] sRGB.

        Args:
            renderer: The renderer of the frame.
            appearance: The appearance.
            sensor: The sensor.
            frame: Number of the frame.
        """
        picture = renderer.picture(appearance)
        if not any(patch.inserted for patch in appearance.patches):
            return picture
        before, picture = picture.copy(), picture.copy()
        shown = renderer.patch_map(appearance)
        view = projection.view_from_world(sensor_transform(sensor, self._trace, frame))
        for number, patch in enumerate(appearance.patches):
            rows, columns = np.nonzero(shown == number + 1)
            if not patch.inserted or not len(rows):
                continue
            view_from_part = projection.view_from_part(patch, self._trace, frame, view)
            to_texture = projection.inverse(projection.homography(patch.faces[0], sensor.camera, view_from_part))
            chart = _chart(renderer, appearance, number) if uses_chart(patch.transfer) else None
            texture = self._texture(patch, frame)
            values = _values(patch, texture, chart, to_texture, sensor.camera, columns, rows, before[rows, columns])
            picture[rows, columns] = np.floor(np.clip(values, 0.0, 255.0) + 0.5).astype(np.uint8)
        return picture

    def _texture(self, patch: PatchPlan, frame: int) -> Image:
        """Return the texture of a patch in a frame; a single texel for a colour."""
        file = patch.texture.at(frame)
        if file is None:
            code = str(patch.texture.colour)
            return np.array([[[int(code[k : k + 2], 16) for k in (1, 3, 5)]]], np.uint8)
        if file.sha256 not in self._images:
            while len(self._images) >= _IMAGES:
                self._images.popitem(last=False)
            self._images[file.sha256] = self._load(TexturePlan(file=file))
        self._images.move_to_end(file.sha256)
        return self._images[file.sha256]


def _chart(renderer: FrameRenderer, appearance: AppearancePlan, number: int) -> ChartPixels:
    """Render a colour chart in the place of a patch, and return its histograms."""
    with_chart = chart_appearance(appearance, number)
    picture = renderer.picture(with_chart)
    return chart_pixels(picture, renderer.patch_map(with_chart), number)


def _values(
    patch: PatchPlan,
    texture: Image,
    chart: ChartPixels | None,
    to_texture: Array,
    camera: CameraPlan,
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    placeholder: NDArray[np.uint8],
) -> Array:
    """Return the inserted values of pixels, float64 [N, 3], before clipping and rounding.

    Args:
        patch: The patch.
        texture: Its texture.
        chart: The histograms of a chart in its place, if its transform needs them.
        to_texture: The homography [3, 3] from undistorted pixels to the texture.
        camera: The camera.
        columns: The pixels' columns, [N].
        rows: Their rows, [N].
        placeholder: Their values before insertion, uint8 [N, 3].
    """
    x, y = projection.undistorted(camera, columns.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5)
    image = reduced(texture, *texture_size(texture, to_texture, x, y))
    u, v, _ = projection.apply_homography(to_texture, x, y)
    if patch.transfer is None:
        return sampled(image, u, v)
    change = transfer(patch.transfer, chart)
    return sampled(change.texture(image), u, v) * change.ratios(placeholder)
