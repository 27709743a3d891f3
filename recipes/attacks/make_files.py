"""Makes the texture of the recipe beside it: a bright pattern of rings, stripes and squares.

It comes from this code alone, and may be used for anything (CC0). Run it from anywhere; it writes beside itself.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from recipe_runtime.core.codecs import png

HERE = Path(__file__).parent


def poster() -> NDArray[np.uint8]:
    """Rings over stripes, 320 x 240: coarse and fine detail, saturated colours, no symmetry."""
    height, width = 240, 320
    y, x = np.mgrid[0:height, 0:width]
    picture = np.where((((x + y) // 20) % 2)[..., None], (244, 206, 40), (232, 96, 30))
    far = (x - 190) * (x - 190) + (y - 120) * (y - 120)
    for radius, colour in (
        (92, (20, 40, 120)),
        (76, (250, 250, 246)),
        (58, (196, 20, 48)),
        (38, (24, 160, 90)),
        (16, (0, 0, 0)),
    ):
        picture[far < radius * radius] = colour
    picture[(x >= 12) & (x < 84) & (y >= 12) & (y < 84)] = (250, 250, 246)
    squares = (x >= 18) & (x < 78) & (y >= 18) & (y < 78) & ((x // 6 + y // 6) % 2 == 0)
    picture[squares] = (0, 0, 0)
    picture[(x >= 18) & (x < 78) & (y >= 180) & (y < 222)] = (60, 20, 130)
    rim = (x < 6) | (y < 6) | (x >= width - 6) | (y >= height - 6)
    picture[rim] = (16, 16, 20)
    return picture.astype(np.uint8)


if __name__ == "__main__":
    (HERE / "poster.png").write_bytes(png(poster()))
