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
    """An orange's skin: a pore at a random place in each cell of a grid, darker in its middle than at its rim."""
    height, width, step = 384, 512, 8
    y, x = np.mgrid[0:height, 0:width]
    places = np.random.Generator(np.random.PCG64(6)).integers(2, step - 2, (2, height // step, width // step))
    down, across = np.kron(places, np.ones((1, step, step), np.int64))
    far = (y % step - down) ** 2 + (x % step - across) ** 2
    skin = np.array([255, 132, 10]) - np.maximum(4 - far, 0)[..., None] * np.array([9, 9, 2])
    return np.asarray(skin, np.uint8)


if __name__ == "__main__":
    for name, picture in (("patch", patch()), ("orange", orange())):
        (HERE / f"{name}.png").write_bytes(png(picture))
