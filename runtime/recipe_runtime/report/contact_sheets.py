"""Contact sheets: one picture of every variant side by side, and annotations drawn over pictures.

They are drawn with Pillow, whose fonts and scaling may change, so no digest covers them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.annotate.records import LabelRecord, Video
from recipe_runtime.core import codecs
from recipe_runtime.report.annotated import Size, overlay
from recipe_runtime.report.difference import read_pixels

_GROUND = (24, 26, 31)
_FRAME = (33, 36, 42)  # around a picture of another shape than the first
_INK = (236, 238, 241)
_CAPTION_INK = (196, 200, 207)
_MARGIN, _GAP, _CAPTION, _TITLE = 24, 14, 26, 58
_MAX_CELLS = 96  # most cells on one sheet


@dataclass(frozen=True)
class Cell:
    """One picture and its caption at a row and a column of the sheet."""

    caption: str
    row: int
    column: int
    video: Video
    frame: int


T = TypeVar("T")
Picture = Callable[[Video, int], Path]  # returns the file of a video's RGB picture at a frame


def contact_sheet(title: str, videos: Sequence[Video], picture: Picture) -> bytes:
    """Return a PNG with the middle frame of every RGB camera of every variant.

    The variants are arranged by the axes, once for each camera: their first cameras, their second ones and so on.
    """
    cameras: dict[str, list[Video]] = {}
    for video in videos:
        if "rgb" in video.sensor.capture and video.frames:
            cameras.setdefault(video.variant, []).append(video)
    most = min(max(map(len, cameras.values()), default=1), _MAX_CELLS)
    names = _thin(list(cameras), _MAX_CELLS // most)
    places = _places(names)
    rows, columns = (max((place[k] for place in places), default=0) + 1 for k in range(2))
    across = _blocks_across(most, rows, columns)
    cells = [
        Cell(
            name if most == 1 else video.name,
            row + n // across * rows,
            column + n % across * columns,
            video,
            _middle(video),
        )
        for name, (row, column) in zip(names, places, strict=True)
        for n, video in enumerate(cameras[name][:most])
    ]
    return _sheet(title, cells, lambda cell, size: _scaled(_read(cell, picture), size))


def overlay_sheet(title: str, videos: Sequence[Video], picture: Picture) -> bytes:
    """Return a PNG with boxes, masks and names over the middle frame of every video whose labels differ."""
    seen: dict[str, Video] = {}
    for video in videos:
        if "rgb" in video.sensor.capture and video.frames:
            seen.setdefault(_label_of(video), video)
    shown = _thin(list(seen.values()), _MAX_CELLS)
    cells = [Cell(v.name, n // 3, n % 3, v, _middle(v)) for n, v in enumerate(shown)]
    return _sheet(title, cells, lambda cell, size: _overlay(_read(cell, picture), cell, size))


def _label_of(video: Video) -> str:
    return "\n".join(str(record["digests"]["labels"]) for record in video.frames) + video.sensor.name


def _thin(items: list[T], most: int) -> list[T]:
    step = -(-len(items) // most) or 1
    return items[::step]


def _blocks_across(blocks: int, rows: int, columns: int) -> int:
    """Return how many blocks of rows and columns of cells are side by side, for an aspect ratio of 8:5 or more."""
    fits = (c for c in range(1, blocks) if c * columns * 4 * 5 >= -(-blocks // c) * rows * 3 * 8)
    return next(fits, blocks)


def _middle(video: Video) -> int:
    """Return the frame with the most visible objects, the nearest to the middle if there are several."""
    half = len(video.frames) // 2
    best = max(range(len(video.frames)), key=lambda n: (len(video.frames[n]["objects"]), -abs(n - half), -n))
    return int(video.frames[best]["frame"])


def _places(names: Sequence[str]) -> list[tuple[int, int]]:
    """Arrange names in rows and columns with an aspect ratio near 8:5.

    Names of the form a=b,c=d are arranged by axes.
    """
    axes = [dict(pair.split("=", 1) for pair in name.split(",") if "=" in pair) for name in names]
    keys = list(axes[0]) if axes else []
    if len(keys) < 2 or any(list(a) != keys for a in axes) or len({tuple(a.values()) for a in axes}) < len(names):
        columns = next(c for c in range(1, len(names) + 2) if c * c * 4 >= len(names) * 5)
        return [(n // columns, n % columns) for n in range(len(names))]
    layouts = []
    for split in range(1, len(keys)):
        rows = list(dict.fromkeys(tuple(a[k] for k in keys[:split]) for a in axes))
        columns_ = list(dict.fromkeys(tuple(a[k] for k in keys[split:]) for a in axes))
        rank = abs(len(columns_) * 4 * 5 - len(rows) * 3 * 8)
        layouts.append((rank, split, rows, columns_))
    _, split, rows, columns_ = min(layouts)
    return [
        (rows.index(tuple(a[k] for k in keys[:split])), columns_.index(tuple(a[k] for k in keys[split:]))) for a in axes
    ]


def _sheet(title: str, cells: Sequence[Cell], draw: Callable[[Cell, Size], Image.Image]) -> bytes:
    columns = max((c.column for c in cells), default=0) + 1
    rows = max((c.row for c in cells), default=0) + 1
    width = 640 if columns <= 2 else 480 if columns == 3 else 360 if columns <= 6 else 240
    camera = cells[0].video.sensor.camera if cells else None
    height = round(width * camera.height / camera.width) if camera else width
    step = width + _GAP, height + _CAPTION + _GAP
    size = 2 * _MARGIN + columns * step[0] - _GAP, _TITLE + _MARGIN + rows * step[1] - _GAP
    sheet = Image.new("RGB", size, _GROUND)
    pen = ImageDraw.Draw(sheet)
    pen.text((_MARGIN, 20), title, fill=_INK, font=ImageFont.load_default(22))
    for cell in cells:
        corner = _MARGIN + cell.column * step[0], _TITLE + cell.row * step[1]
        pen.rectangle((*corner, corner[0] + width - 1, corner[1] + height - 1), fill=_FRAME)
        fit = _fit(cell.video.sensor.camera, (width, height))
        sheet.paste(draw(cell, fit), (corner[0] + (width - fit[0]) // 2, corner[1] + (height - fit[1]) // 2))
        _caption(pen, cell.caption, (corner[0], corner[1] + height + 5), width)
    return codecs.png(np.asarray(sheet), level=6)


def _fit(camera: CameraPlan, cell: Size) -> Size:
    """Return the size of a camera's picture that fits into a cell."""
    wide, high = cell[0], round(cell[0] * camera.height / camera.width)
    if high > cell[1]:
        wide, high = round(cell[1] * camera.width / camera.height), cell[1]
    return max(1, wide), max(1, high)


def _caption(pen: ImageDraw.ImageDraw, text: str, corner: tuple[int, int], width: int) -> None:
    """Draw text at the largest size that fits; at the smallest size, the middle of the text is omitted if necessary."""
    for size in (15, 13, 11):
        font = ImageFont.load_default(size)
        if pen.textlength(text, font=font) <= width:
            break
    half = len(text) // 2
    shown = text
    while half > 1 and pen.textlength(shown, font=font) > width:
        half -= 1
        shown = f"{text[:half]}…{text[-half:]}"
    pen.text(corner, shown, fill=_CAPTION_INK, font=font)


def _read(cell: Cell, picture: Picture) -> Image.Image:
    """Return the picture of a cell. `build --repair` takes over pictures that anyone may have written."""
    path, camera = picture(cell.video, cell.frame), cell.video.sensor.camera
    pixels = read_pixels(path, (camera.height, camera.width))
    if pixels is None or pixels.shape != (camera.height, camera.width, 3) or pixels.dtype != np.uint8:
        raise RunError(f"{path} is not the picture of its camera", help="move the dataset away, and build it again")
    return Image.fromarray(pixels)


def _scaled(picture: Image.Image, size: Size) -> Image.Image:
    small: Image.Image = picture.resize(size, Image.Resampling.BOX)
    return small


def _overlay(picture: Image.Image, cell: Cell, size: Size) -> Image.Image:
    objects: list[LabelRecord] = next(r["objects"] for r in cell.video.frames if r["frame"] == cell.frame)
    return overlay(np.asarray(picture), objects, cell.video.sensor.camera, size, ("masks", "boxes", "ids"))
