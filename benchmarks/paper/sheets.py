"""Contact sheets: JPEG files of small pictures with captions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

GAP, CAPTION, MAX_BYTES = 4, 20, 100_000  # pixels between columns, height of a caption in pixels, size of a file


def colour_depth(metres: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return depth as grey levels, uint8 [H, W, 3]: logarithmic from 1 m, white, to 100 m, black."""
    scaled = 1 - np.clip(np.log10(np.maximum(metres, 1)) / 2, 0, 1)
    return np.repeat((scaled * 255).astype(np.uint8)[..., None], 3, axis=2)


def colour_instances(instances: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return instances as colours, uint8 [H, W, 3]; 0 is black."""
    rows = instances.astype(np.uint32)[..., None] * np.array([7919, 104729, 1299709], np.uint32)
    return np.where(instances[..., None] > 0, 80 + rows // 7 % 176, 0).astype(np.uint8)


def keep(picture: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return a picture that is black outside a mask."""
    return np.where(mask[..., None], picture, 0).astype(np.uint8)


def save(cells: Sequence[tuple[str, NDArray[np.uint8]]], columns: int, path: Path, size: tuple[int, int]) -> None:
    """Write captioned pictures as a sheet of less than 100 KB.

    Args:
        cells: Captions and pictures, row by row.
        columns: Pictures in a row.
        path: The JPEG file.
        size: Width and height of a picture on the sheet.
    """
    width, height = size
    rows = -(-len(cells) // columns)
    sheet = Image.new("RGB", (columns * (width + GAP) - GAP, rows * (height + CAPTION) - 1), (24, 26, 31))
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for number, (caption, picture) in enumerate(cells):
        left, top = number % columns * (width + GAP), number // columns * (height + CAPTION)
        sheet.paste(Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS), (left, top))
        pen.text((left + 2, top + height + 1), caption, fill=(196, 200, 207), font=font)
    path.parent.mkdir(parents=True, exist_ok=True)
    for quality in range(88, 20, -4):
        sheet.save(path, quality=quality, optimize=True)
        if path.stat().st_size < MAX_BYTES:
            return
