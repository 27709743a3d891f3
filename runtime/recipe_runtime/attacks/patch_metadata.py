"""The ground truth of a patch in the form that Armory's attacks expect."""

from __future__ import annotations

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.patches import STATIC, PatchPlan

from recipe_runtime.annotate.masks import unpacked
from recipe_runtime.attacks.truth import PatchRecord

# Metres by which an attack may perturb the depth of patches on a street or a sidewalk, and of others: Armory's bounds.
_MAX_PERTURB_GROUND, _MAX_PERTURB_ELSEWHERE = 0.03, 3.0
_MAX_GROUND_HEIGHT = 0.5  # metres: a patch on the ground is lower
_MIN_GROUND_COSINE = 0.5  # and its normal's cosine to the vertical is larger


class PatchMetadata(TypedDict):
    """The fields that Armory's attacks read for a patch in a frame."""

    gs_coords: NDArray[np.int64]  # [4, 2]: x, y, clockwise from the texture's top left
    mask: NDArray[np.uint8]  # [H, W, 3]: 255 where the patch is seen, else 0
    avg_patch_depth: np.float64  # metres
    max_depth_perturb_meters: np.float64


def patch_metadata(record: PatchRecord, patch: PatchPlan, width: int, height: int) -> PatchMetadata | None:
    """Return the metadata of a patch in a frame; None if an attack cannot use it, see `is_usable`.

    Args:
        record: The ground truth of the patch in the frame.
        patch: Its plan.
        width: Of the picture, pixels.
        height: Of the picture, pixels.

    Raises:
        ValueError: The record's mask is damaged.
    """
    if not is_usable(record):
        return None
    return {
        "gs_coords": np.array(record["corners_int"], np.int64).reshape(4, 2),
        "mask": visible_mask(record, width, height),
        "avg_patch_depth": np.float64(record["depth"]),
        "max_depth_perturb_meters": np.float64(_MAX_PERTURB_GROUND if is_on_ground(patch) else _MAX_PERTURB_ELSEWHERE),
    }


def is_usable(record: PatchRecord) -> bool:
    """Return whether a patch is visible and its corners, clipped to the picture, are four different pixels."""
    corners = record["corners_int"]
    return record["area"] > 0 and corners is not None and len({tuple(corner) for corner in corners}) == 4


def visible_mask(record: PatchRecord, width: int, height: int) -> NDArray[np.uint8]:
    """Return the mask of the visible pixels, uint8 [H, W, 3], 0 or 255.

    Raises:
        ValueError: The record's mask is damaged.
    """
    if record["counts"] is None:
        return np.zeros((height, width, 3), np.uint8)
    mask = unpacked(record["counts"], width, height)
    return np.repeat(mask[..., None] * np.uint8(255), 3, axis=2)


def is_on_ground(patch: PatchPlan) -> bool:
    """Return whether a patch lies on a street or a sidewalk: static, facing up and low."""
    face = patch.faces[0]
    low = all(corner[2] < _MAX_GROUND_HEIGHT for corner in face.corners)
    return not patch.whole and face.part == STATIC and face.normal[2] > _MIN_GROUND_COSINE and low
