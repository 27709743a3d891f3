"""Pictures of a dataset with its labels drawn over them, for people."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir import optics
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.modalities import form_of
from recipe_compiler.ir.plan import CameraPlan, ScenarioPlan, SensorPlan

from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.annotate.masks import unpacked
from recipe_runtime.annotate.records import Box3d, LabelledFrame, LabelRecord
from recipe_runtime.attacks.truth import FrameTruth, PatchRecord
from recipe_runtime.core import codecs, layout
from recipe_runtime.core.documents import decode
from recipe_runtime.core.files import read_inside
from recipe_runtime.dataset.reader import Dataset, labels
from recipe_runtime.insertion import projection
from recipe_runtime.modalities import declared
from recipe_runtime.modalities.reading import stored_array

DRAWN = {
    "boxes": "boxes of the visible pixels",
    "masks": "masks",
    "ids": "class and number",
    "amodal": "boxes without occlusion",
    "boxes3d": "3-D boxes",
    "patches": "patches and their corners",
}
# Colours that are distinguishable for colour-blind people (Okabe and Ito, 2008), by instance.
_HUES = ((230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66), (213, 94, 0), (204, 121, 167))
_GROUND, _PATCH = (24, 26, 31), (255, 225, 77)
_EDGES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7))
_FRONT = ((4, 7), (5, 6))
_NEAR = 0.05  # metres in front of the camera; edges that are nearer are not drawn
_PATCH_BYTES = 64 << 20  # limit of the file with the patches of a frame

Size = tuple[int, int]  # width, height
Colour = tuple[int, int, int]


def hue(instance: int) -> Colour:
    """Return the colour of an object, the same in all frames and sensors."""
    return _HUES[instance % len(_HUES)]


def overlay(
    pixels: NDArray[np.uint8],
    objects: Sequence[LabelRecord],
    camera: CameraPlan,
    size: Size,
    drawn: Collection[str],
    patches: Sequence[PatchRecord] = (),
) -> Image.Image:
    """Return a picture with labels, scaled; lines and texts are drawn at its new size.

    Args:
        pixels: The picture, [H, W, 3].
        objects: The labels of the frame.
        camera: The camera.
        size: Of the result.
        drawn: Names of `DRAWN`.
        patches: The patches of the frame.
    """
    if "masks" in drawn:
        tinted = pixels.astype(np.int32)
        for item in objects:
            inside = unpacked(item["counts"], camera.width, camera.height) > 0
            tinted[inside] = (tinted[inside] + np.array(hue(item["instance"]))) // 2
        pixels = tinted.astype(np.uint8)
    picture = Image.fromarray(pixels).resize(size, Image.Resampling.BOX)
    pen = _Pen(ImageDraw.Draw(picture), size[0] / camera.width, size[1] / camera.height)
    for item in objects:
        colour = hue(item["instance"])
        if "boxes3d" in drawn:
            pen.solid(item["box3d"], camera, colour)
        for name, box in (("amodal", item["amodal_bbox"]), ("boxes", item["bbox"])):
            if name in drawn:
                pen.box(box, colour)
        if "ids" in drawn:
            pen.title(item, colour)
    if "patches" in drawn:
        for patch in patches:
            pen.patch(patch)
    return picture


@dataclass(frozen=True)
class _Pen:
    """Draws in pixels of the camera on a picture of another size."""

    pen: ImageDraw.ImageDraw
    x: float
    y: float

    def at(self, point: Sequence[float]) -> tuple[float, float]:
        return point[0] * self.x, point[1] * self.y

    def box(self, box: Sequence[int], colour: Colour) -> None:
        x, y, w, h = box
        (x0, y0), (x1, y1) = self.at((x, y)), self.at((x + w, y + h))
        self.pen.rectangle((int(x0), int(y0), int(x1), int(y1)), outline=colour)

    def title(self, item: LabelRecord, colour: Colour) -> None:
        x, y, _, h = item["bbox"]
        if int(self.at((0, y + h))[1]) - int(self.at((0, y))[1]) >= 16:
            text = f"{CATEGORIES.get(item['instance'] // 1000, 'other')} {item['instance'] % 1000}"
            left, top = self.at((x, y))
            font = ImageFont.load_default(12)
            place = int(left), int(top) - 3
            self.pen.text(place, text, fill=colour, font=font, anchor="ls", stroke_width=1, stroke_fill=_GROUND)

    def solid(self, box: Box3d, camera: CameraPlan, colour: Colour) -> None:
        """Draw a box in the sensor's frame; the front, where the actor looks, has a cross."""
        places = box_pixels(box, camera)
        for a, b in _EDGES + _FRONT:
            first, second = places[a], places[b]
            if first and second:
                self.pen.line((*self.at(first), *self.at(second)), fill=colour)

    def patch(self, patch: PatchRecord) -> None:
        if patch["corners"] is None or not patch["area"]:
            return
        corners = [self.at(corner) for corner in patch["corners"]]
        self.pen.line([*corners, corners[0]], fill=_PATCH, width=2)
        for (x, y), fill in zip(corners, ("#ff4d4d", "#4dff6a", "#4da3ff", "#ffffff"), strict=True):
            self.pen.ellipse((x - 3, y - 3, x + 3, y + 3), fill=fill)


def box_pixels(box: Box3d, camera: CameraPlan) -> list[tuple[float, float] | None]:
    """Return the pixels of the corners of a box in the sensor's frame; None for those behind the camera."""
    focal = optics.focal_length(camera)
    return [_pixel(corner, camera, focal) for corner in _corners(box)]


def _corners(box: Box3d) -> list[list[float]]:
    """Return the eight corners of a box; the last four are in front."""
    w, x, y, z = box["rotation"]
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    signs = [(i, j, k) for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)]
    at = [[sign * side for sign, side in zip(corner, box["size"], strict=True)] for corner in signs]
    return [[r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + c for r, c in zip(rows, box["centre"], strict=True)] for p in at]


def _pixel(point: Sequence[float], camera: CameraPlan, focal: float) -> tuple[float, float] | None:
    """Return the pixel of a point in the sensor's frame (x forward, y left, z up); None if it is behind the camera."""
    x, y, z = point
    if x < _NEAR:
        return None
    return projection.distort(camera, camera.width / 2.0 - focal * y / x, camera.height / 2.0 - focal * z / x)


@dataclass(frozen=True)
class AnnotatedVideo:
    """The pictures of one sensor of one variant of a dataset, which is not trusted."""

    dataset: Dataset
    variant: ScenarioPlan
    sensor: SensorPlan

    def pictures(
        self, frames: Collection[int], modality: str, drawn: Collection[str]
    ) -> Iterator[tuple[LabelledFrame, Image.Image]]:
        """Yield frames in their order, with the labels drawn over the picture of a modality.

        Raises:
            InputError: A file is missing or damaged.
        """
        camera = self.sensor.camera
        try:
            for frame in labels(self.dataset, self.variant, self.sensor):
                if frame["frame"] not in frames:
                    continue
                patches = self._patches(frame["frame"]) if "patches" in drawn else []
                pixels, size = self._pixels(frame["frame"], modality), (camera.width, camera.height)
                yield frame, overlay(pixels, frame["objects"], camera, size, drawn, patches)
        except (OSError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            place = f"{self.variant.variant}, {self.sensor.name}"
            raise InputError(
                f"{self.dataset.name}: {place}: a file is missing or damaged ({error})",
                help="repair the dataset",
                code=Code.INVALID_DATASET,
            ) from None

    def _pixels(self, frame: int, modality: str) -> NDArray[np.uint8]:
        camera, forms = self.sensor.camera, self.dataset.plan.forms
        ending, shape = form_of(modality, forms).ending, (camera.height, camera.width)
        path = layout.frame_file(self.variant.variant, self.sensor.name, modality, frame, forms)
        stored = stored_array(read_inside(self.dataset.root, path, codecs.largest_file(*shape[::-1])), ending, shape)
        form = declared(modality).files[ending]
        if stored.shape[:2] != shape or not form.fits(stored):
            raise ValueError(f"{path} is not a picture of its sensor")
        return declared(modality).picture(form.load(stored))

    def _patches(self, frame: int) -> list[PatchRecord]:
        if not self.variant.appearance.patches:
            return []
        path = layout.patches_file(self.variant.variant, self.sensor.name, frame)
        return decode(read_inside(self.dataset.root, path, _PATCH_BYTES), FrameTruth)["patches"]
