"""Makes the textures of the recipes beside it: a patch of random squares, and a car's paint that looks like an orange.

They come from this code alone, and may be used for anything (CC0). Run it from anywhere; it writes beside itself.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from recipe_runtime.core.codecs import png

HERE = Path(__file__).parent


def patch() -> NDArray[np.uint8]:
    """Random saturated squares of 5 pixels within a dark rim, 160 x 160: the statistics of an optimised patch."""
    cells = np.random.Generator(np.random.PCG64(5)).integers(0, 2, (32, 32, 3)) * 215 + 20
    picture = np.kron(cells, np.ones((5, 5, 1), np.int64))
    picture[:4], picture[-4:], picture[:, :4], picture[:, -4:] = 16, 16, 16, 16
    return picture.astype(np.uint8)


def orange() -> NDArray[np.uint8]:
    """An orange's skin: pores on a regular grid that is shifted from row to row."""
    height, width, step = 384, 512, 8
    y, x = np.mgrid[0:height, 0:width]
    shift = (y // step % 2) * (step // 2)
    far = ((x + shift) % step - step // 2) ** 2 + (y % step - step // 2) ** 2
    skin = np.array([255, 132, 10]) - np.array([4, 16, 2]) * ((x * 7 + y * 13) % 5 % 2)[..., None]
    skin = np.where((far <= 3)[..., None], (196, 84, 0), skin)
    return np.asarray(skin, np.uint8)


if __name__ == "__main__":
    for name, picture in (("patch", patch()), ("orange", orange())):
        (HERE / f"{name}.png").write_bytes(png(picture))
