"""Contact sheets: JPEG files of small pictures with captions, on white."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

GAP, CAPTION, MAX_BYTES = 6, 24, 100_000  # pixels between pictures, height of a caption in pixels, size of a file
BACKGROUND, TEXT = (255, 255, 255), (24, 26, 31)
TRUE_POSITIVE, FALSE_POSITIVE, NEGATIVE = (52, 168, 83), (234, 67, 53), (24, 26, 31)  # of `marked`
OUTLINE = (255, 0, 255)

Picture = NDArray[np.uint8]  # [H, W, 3]
Mask = NDArray[np.bool_]  # [H, W]


@dataclass(frozen=True)
class Sheet:
    """Captions and pictures, row by row; the pictures in a row; width and height of a picture on the sheet."""

    cells: tuple[tuple[str, Picture], ...]
    columns: int
    size: tuple[int, int]


def colour_depth(metres: NDArray[np.float32]) -> Picture:
    """Return depth as grey levels, uint8 [H, W, 3]: logarithmic from 1 m, white, to 100 m, black."""
    scaled = 1 - np.clip(np.log10(np.maximum(metres, 1)) / 2, 0, 1)
    return np.repeat((scaled * 255).astype(np.uint8)[..., None], 3, axis=2)


def colour_instances(instances: NDArray[np.uint16]) -> Picture:
    """Return instances as colours, uint8 [H, W, 3]; 0 is black."""
    rows = instances.astype(np.uint32)[..., None] * np.array([7919, 104729, 1299709], np.uint32)
    return np.where(instances[..., None] > 0, 80 + rows // 7 % 176, 0).astype(np.uint8)


def outlined(picture: Picture, instances: NDArray[np.uint16]) -> Picture:
    """Return a picture in which the outermost pixels of every instance are coloured."""
    edge = np.zeros(instances.shape, np.bool_)
    edge[1:] |= instances[1:] != instances[:-1]
    edge[:-1] |= instances[:-1] != instances[1:]
    edge[:, 1:] |= instances[:, 1:] != instances[:, :-1]
    edge[:, :-1] |= instances[:, :-1] != instances[:, 1:]
    return np.where((edge & (instances > 0))[..., None], OUTLINE, picture).astype(np.uint8)


def keep(picture: Picture, mask: Mask) -> Picture:
    """Return a picture that is black outside a mask."""
    return np.where(mask[..., None], picture, 0).astype(np.uint8)


def marked(found: Mask, wanted: Mask) -> Picture:
    """Return the found pixels as a picture: green where they are wanted, red elsewhere."""
    colours = np.where(wanted[..., None], TRUE_POSITIVE, FALSE_POSITIVE)
    return np.where(found[..., None], colours, NEGATIVE).astype(np.uint8)


def around(picture: Picture, mask: Mask, margin: float, shape: tuple[int, int]) -> Picture:
    """Return the part of a picture around a mask.

    Args:
        picture: The picture.
        mask: The pixels that the part is to show.
        margin: What is shown on each side of the mask, as a share of its size.
        shape: Width and height of the part, of which only the ratio counts.
    """
    y, x = np.nonzero(mask)
    span = max(np.ptp(x) / shape[0], np.ptp(y) / shape[1]) * (1 + 2 * margin)
    width, height = (min(int(span * side), limit) for side, limit in zip(shape, mask.shape[::-1], strict=True))
    left = min(max((int(x.min()) + int(x.max()) - width) // 2, 0), mask.shape[1] - width)
    top = min(max((int(y.min()) + int(y.max()) - height) // 2, 0), mask.shape[0] - height)
    return picture[top : top + height, left : left + width]


def save(sheet: Sheet, path: Path) -> None:
    """Write a sheet as a JPEG file of less than 100 KB."""
    width, height = sheet.size
    rows = -(-len(sheet.cells) // sheet.columns)
    size = (sheet.columns * (width + GAP) - GAP, rows * (height + CAPTION) + (rows - 1) * GAP)
    page, font = Image.new("RGB", size, BACKGROUND), ImageFont.load_default(15)
    pen = ImageDraw.Draw(page)
    for number, (caption, picture) in enumerate(sheet.cells):
        left, top = number % sheet.columns * (width + GAP), number // sheet.columns * (height + CAPTION + GAP)
        page.paste(Image.fromarray(picture).resize(sheet.size, Image.Resampling.LANCZOS), (left, top))
        pen.text((left + width / 2, top + height + 3), caption, fill=TEXT, font=font, anchor="ma")
    path.parent.mkdir(parents=True, exist_ok=True)
    for quality in range(90, 20, -3):
        page.save(path, quality=quality, optimize=True)
        if path.stat().st_size < MAX_BYTES:
            return
