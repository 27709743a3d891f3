"""A chart of 24 known colours in the place of a patch: the calibration colours of a colour transform.

The chart is rendered as a patch is, with six columns and four rows of cells, so the same light, weather and camera act
on it. Only pixels are used whose eight neighbours show the same cell; of a cell without such pixels, all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.patches import PatchFace, PatchPlan, PatchTexture
from recipe_compiler.ir.plan import AppearancePlan

COLUMNS, ROWS = 6, 4

# sRGB of the 24 fields of the ColorChecker Classic, row by row, as published by its maker in 2005.
COLORS: tuple[tuple[int, int, int], ...] = (
    (115, 82, 68), (194, 150, 130), (98, 122, 157), (87, 108, 67), (133, 128, 177), (103, 189, 170),
    (214, 126, 44), (80, 91, 166), (193, 90, 99), (94, 60, 108), (157, 188, 64), (224, 163, 46),
    (56, 61, 150), (70, 148, 73), (175, 54, 60), (231, 199, 31), (187, 86, 149), (8, 133, 161),
    (243, 243, 242), (200, 200, 200), (160, 160, 160), (122, 122, 121), (85, 85, 85), (52, 52, 52),
)  # fmt: skip


@dataclass(frozen=True)
class ChartPixels:
    """What a picture shows of the chart: `counts[cell, channel, level]`, the number of pixels, int64 [24, 3, 256]."""

    counts: NDArray[np.int64]

    @property
    def cells(self) -> list[int]:
        """The cells that are seen."""
        return [cell for cell in range(len(COLORS)) if self.counts[cell, 0].any()]

    def mean(self, cell: int, channel: int) -> float:
        """The mean 8-bit value of a cell that is seen."""
        row = self.counts[cell, channel]
        return int((row * np.arange(256)).sum()) / int(row.sum())


def chart_appearance(appearance: AppearancePlan, number: int) -> AppearancePlan:
    """Return an appearance whose patch of this number, from 0, is the chart; its cells are numbered from there on."""
    patch = appearance.patches[number]
    cells = tuple(_cell(patch, cell) for cell in range(len(COLORS)))
    patches = (*appearance.patches[:number], *cells, *appearance.patches[number + 1 :])
    return appearance.model_copy(update={"patches": patches})


def chart_pixels(picture: NDArray[np.uint8], patch_map: NDArray[np.uint8], number: int) -> ChartPixels:
    """Return what a picture shows of the chart.

    Args:
        picture: The picture of a `chart_appearance`, uint8 [H, W, 3].
        patch_map: 1 + the number of the patch that each of its pixels shows, uint8 [H, W].
        number: The number of the chart's first cell, from 0.
    """
    inner = _alike_around(patch_map)
    counts = np.zeros((len(COLORS), 3, 256), np.int64)
    for cell in range(len(COLORS)):
        shown = patch_map == number + 1 + cell
        chosen = picture[shown & inner]
        chosen = chosen if len(chosen) else picture[shown]
        for channel in range(3):
            counts[cell, channel] = np.bincount(chosen[:, channel], minlength=256)
    return ChartPixels(counts)


def _cell(patch: PatchPlan, cell: int) -> PatchPlan:
    """The patch of one cell: a part of the patch's rectangle, in the cell's colour."""
    face, (row, column) = patch.faces[0], divmod(cell, COLUMNS)
    width, height = face.width / COLUMNS, face.height / ROWS
    corner = tuple(
        (face.corner[axis] + column * width * face.right[axis]) + row * height * face.down[axis] for axis in range(3)
    )
    part: PatchFace = face.model_copy(update={"corner": corner, "width": width, "height": height})
    colour = "#{:02x}{:02x}{:02x}".format(*COLORS[cell])
    return patch.model_copy(
        update={"faces": (part,), "mode": "rendered", "transfer": None, "texture": PatchTexture(colour=colour)}
    )


def _alike_around(patch_map: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Which pixels' eight neighbours have the same number; none at the picture's edge."""
    alike = np.zeros(patch_map.shape, bool)
    height, width = patch_map.shape
    if height > 2 and width > 2:
        middle = patch_map[1:-1, 1:-1]
        same = np.ones(middle.shape, bool)
        for dy in range(3):
            for dx in range(3):
                same &= patch_map[dy : height - 2 + dy, dx : width - 2 + dx] == middle
        alike[1:-1, 1:-1] = same
    return alike
