"""The class that each pixel shows: CARLA's tags, uint8 [H, W]."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.core.interfaces import Observed
from recipe_runtime.modalities.modality import Array, FileForm, Modality, Screen

NAME = "semantic"
# CARLA 0.9.14's palette, by tag (Docs/ref_sensors.md).
_PALETTE = np.array(
    [
        (0, 0, 0), (128, 64, 128), (244, 35, 232), (70, 70, 70), (102, 102, 156), (190, 153, 153), (153, 153, 153),
        (250, 170, 30), (220, 220, 0), (107, 142, 35), (152, 251, 152), (70, 130, 180), (220, 20, 60), (255, 0, 0),
        (0, 0, 142), (0, 0, 70), (0, 60, 100), (0, 80, 100), (0, 0, 230), (119, 11, 32), (110, 190, 160),
        (170, 120, 50), (55, 90, 80), (45, 60, 150), (157, 234, 50), (81, 0, 81), (150, 100, 100), (230, 150, 140),
        (180, 165, 180),
    ],
    np.uint8,
)  # fmt: skip


def _seen(observed: Observed) -> Array:
    return observed.semantic


def _picture(tags: Array) -> NDArray[np.uint8]:
    """Map CARLA's tags [H, W] to CARLA's palette."""
    colours: NDArray[np.uint8] = _PALETTE[np.minimum(tags.astype(np.uint8, copy=False), len(_PALETTE) - 1)]
    return colours


def _card(dataset: DatasetPlan) -> str:
    return "- semantic: 8-bit PNG of CARLA 0.9.14+ tags."


MODALITY = Modality(
    name=NAME,
    dtype="uint8",
    files={"png": FileForm("uint8", "semantic")},
    picture=_picture,
    screen=Screen("palette", tuple((r, g, b) for r, g, b in _PALETTE.tolist()), tuple(tag.label for tag in Tag)),
    card=_card,
    seen=_seen,
)
