"""A chart of 24 known colours in the place of a patch, from which a colour transform is fitted.

The chart has six columns and four rows of cells, which are rendered as patches under the same light, weather and
camera. Only pixels whose eight neighbours show the same cell are used, or all pixels of a cell without such pixels.
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
    """Histograms of the chart's cells in a picture: number of pixels by cell, channel and level, int64 [24, 3, 256]."""

    counts: NDArray[np.int64]

    @property
    def cells(self) -> list[int]:
        """The visible cells."""
        return [cell for cell in range(len(COLORS)) if self.counts[cell, 0].any()]

    def mean(self, cell: int, channel: int) -> float:
        """Return the mean 8-bit value of a visible cell."""
        row = self.counts[cell, channel]
        return int((row * np.arange(256)).sum()) / int(row.sum())


def chart_appearance(appearance: AppearancePlan, number: int) -> AppearancePlan:
    """Return an appearance in which the chart's cells, as patches, replace the patch with this index."""
    patch = appearance.patches[number]
    cells = tuple(_cell(patch, cell) for cell in range(len(COLORS)))
    patches = (*appearance.patches[:number], *cells, *appearance.patches[number + 1 :])
    return appearance.model_copy(update={"patches": patches})


def chart_pixels(picture: NDArray[np.uint8], patch_map: NDArray[np.uint8], number: int) -> ChartPixels:
    """Return the histograms of the chart's cells in a picture.

    Args:
        picture: The picture of a `chart_appearance`, uint8 [H, W, 3].
        patch_map: 1 + the index of the patch that each of its pixels shows, uint8 [H, W].
        number: The index of the chart's first cell.
    """
    inner = _uniform_neighbourhood(patch_map)
    counts = np.zeros((len(COLORS), 3, 256), np.int64)
    for cell in range(len(COLORS)):
        shown = patch_map == number + 1 + cell
        chosen = picture[shown & inner]
        chosen = chosen if len(chosen) else picture[shown]
        for channel in range(3):
            counts[cell, channel] = np.bincount(chosen[:, channel], minlength=256)
    return ChartPixels(counts)


def _cell(patch: PatchPlan, cell: int) -> PatchPlan:
    """Return the patch of one cell: a part of the patch's rectangle, in the cell's colour."""
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


def _uniform_neighbourhood(patch_map: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return the pixels whose eight neighbours have the same value; False at the picture's edge."""
    uniform = np.zeros(patch_map.shape, bool)
    height, width = patch_map.shape
    if height > 2 and width > 2:
        middle = patch_map[1:-1, 1:-1]
        same = np.ones(middle.shape, bool)
        for dy in range(3):
            for dx in range(3):
                same &= patch_map[dy : height - 2 + dy, dx : width - 2 + dx] == middle
        uniform[1:-1, 1:-1] = same
    return uniform
