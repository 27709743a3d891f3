"""The catalogue of blueprints: portraits on one sheet, with their names.

It is drawn and encoded with Pillow, whose fonts, scaling and JPEG encoder may change; the portraits themselves do not.
"""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

_WIDTH, _CAPTION, _GAP = 200, 20, 6
_PAPER, _INK = (246, 245, 242), (52, 54, 58)
_QUALITY = 82


def sheet(portraits: Sequence[tuple[str, NDArray[np.generic]]]) -> bytes:
    """Return a JPEG with every portrait above its name, with an aspect ratio near 8:5.

    Args:
        portraits: name and pixels [H, W, 3] of each; all have the same size.
    """
    height = _WIDTH * portraits[0][1].shape[0] // portraits[0][1].shape[1]
    cell = _WIDTH + _GAP, height + _CAPTION + _GAP
    columns = next(
        c
        for c in range(1, len(portraits) + 1)
        if c * c * cell[0] * 5 >= len(portraits) * cell[1] * 8 or c == len(portraits)
    )
    rows = -(-len(portraits) // columns)
    page = Image.new("RGB", (columns * cell[0] + _GAP, rows * cell[1] + _GAP), _PAPER)
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(12)
    for n, (name, pixels) in enumerate(portraits):
        x, y = _GAP + n % columns * cell[0], _GAP + n // columns * cell[1]
        page.paste(Image.fromarray(pixels).resize((_WIDTH, height), Image.Resampling.BOX), (x, y))
        pen.text((x + 2, y + height + 3), name, fill=_INK, font=font)
    body = io.BytesIO()
    page.save(body, "JPEG", quality=_QUALITY, optimize=True)
    return body.getvalue()
