"""Colour maps for depth and labels: uint8 [H, W, 3]. For display only; no digest covers them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_NEAR, _FAR = 1.0, 200.0  # metres; range of the logarithmic depth map

# CARLA 0.9.14's palette, by tag (Docs/ref_sensors.md).
PALETTE = np.array(
    [
        (0, 0, 0), (128, 64, 128), (244, 35, 232), (70, 70, 70), (102, 102, 156), (190, 153, 153), (153, 153, 153),
        (250, 170, 30), (220, 220, 0), (107, 142, 35), (152, 251, 152), (70, 130, 180), (220, 20, 60), (255, 0, 0),
        (0, 0, 142), (0, 0, 70), (0, 60, 100), (0, 80, 100), (0, 0, 230), (119, 11, 32), (110, 190, 160),
        (170, 120, 50), (55, 90, 80), (45, 60, 150), (157, 234, 50), (81, 0, 81), (150, 100, 100), (230, 150, 140),
        (180, 165, 180),
    ],
    np.uint8,
)  # fmt: skip


def semantic_picture(tags: NDArray[np.generic]) -> NDArray[np.uint8]:
    """Map CARLA's tags [H, W] to CARLA's palette."""
    picture: NDArray[np.uint8] = PALETTE[np.minimum(tags, len(PALETTE) - 1)]
    return picture


def instance_picture(instances: NDArray[np.generic]) -> NDArray[np.uint8]:
    """Map instances [H, W] to distinct colours, by a hash of the value; black where there is none."""
    spread = instances.astype(np.uint32) * np.uint32(2654435761)
    picture = np.stack([(spread >> shift & 0x7F) + 0x80 for shift in (8, 16, 24)], axis=-1).astype(np.uint8)
    picture[instances == 0] = 0
    return picture


def depth_picture(metres: NDArray[np.generic]) -> NDArray[np.uint8]:
    """Map depth [H, W] in metres logarithmically to grey: white at 1 m, black from 200 m on."""
    share = np.log(np.clip(metres, _NEAR, _FAR) / _NEAR) / np.log(_FAR / _NEAR)
    grey = (255.0 * (1.0 - share)).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=-1)
