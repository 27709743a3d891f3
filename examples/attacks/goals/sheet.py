"""Sheets: a row for each texture, with the texture and the frames that show it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from recipe_runtime.torch import Place

from benchmarks.paper import sheets
from examples.attacks.goals.detection import DETECTORS
from examples.attacks.goals.parts import Part

Cell = tuple[str, NDArray[np.uint8]]

_CELL, _BOX_COLOUR, _BOX_WIDTH = 160, (255, 230, 40), 3  # pixels


def row(title: str, part: Part, least: float, places: Sequence[Place], pictures: torch.Tensor) -> list[Cell]:
    """Return a texture, and frames with the first detector's score of the object, and its box from a least score on."""
    tested = [tuple(place) for place in part.values["places"]]
    cells = [(title, square(part.textures[0]))]
    for place, picture in zip(places, pictures, strict=True):
        number, shown = tested.index(place), pixels(picture)
        score = part.values[DETECTORS[0]]["scores"][number]
        if score >= least:
            outline(shown, part.values["boxes"][number])
        words = place[0].partition("weather=")[2].partition(",")[0].replace("_", " ")
        cells.append((f"{words}: {score:.2f}", shown))
    return cells


def save(rows: Sequence[Sequence[Cell]], path: Path) -> None:
    """Write rows of equal length as a JPEG."""
    cells = tuple(cell for cells in rows for cell in cells)
    sheets.save(sheets.Sheet(cells, len(rows[0]), (_CELL, _CELL)), path)


def square(texture: torch.Tensor) -> NDArray[np.uint8]:
    """Return a texture [3, h, w] on a white square."""
    side = max(texture.shape[1:])
    spare = [side - length for length in texture.shape[1:]]
    margins = (spare[1] // 2, spare[1] - spare[1] // 2, spare[0] // 2, spare[0] - spare[0] // 2)
    return pixels(torch.nn.functional.pad(texture, margins, value=1.0))


def pixels(picture: torch.Tensor) -> NDArray[np.uint8]:
    """Return a picture [3, h, w], 0 to 1, as 8-bit values [h, w, 3]."""
    found: NDArray[np.uint8] = (picture.permute(1, 2, 0) * 255).round().to(torch.uint8).numpy().copy()
    return found


def outline(shown: NDArray[np.uint8], box: Sequence[float], colour: tuple[int, int, int] = _BOX_COLOUR) -> None:
    """Draw a box, x0, y0, x1, y1."""
    height, width = shown.shape[:2]
    x0, y0, x1, y1 = (round(v) for v in box)
    left, top, right, bottom = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
    inner = slice(top + _BOX_WIDTH, bottom - _BOX_WIDTH), slice(left + _BOX_WIDTH, right - _BOX_WIDTH)
    kept = shown[inner].copy()
    shown[top:bottom, left:right] = colour
    shown[inner] = kept
