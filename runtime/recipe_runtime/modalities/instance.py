"""The actor that each pixel shows: CARLA tag * 1000 + number, uint16 [H, W]; 0 for town and sky."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core.interfaces import Observed
from recipe_runtime.modalities.modality import Array, FileForm, Modality, Screen


def _seen(observed: Observed) -> Array:
    return observed.instance


def picture(instances: Array) -> NDArray[np.uint8]:
    """Map instances [H, W] to distinct colours, by a hash of the value; black where there is none."""
    spread = instances.astype(np.uint32) * np.uint32(2654435761)
    colours = np.stack([(spread >> shift & 0x7F) + 0x80 for shift in (8, 16, 24)], axis=-1).astype(np.uint8)
    colours[instances == 0] = 0
    return colours


def _card(dataset: DatasetPlan) -> str:
    return (
        "- instance: 16-bit PNG, CARLA tag * 1000 + number; the same actor in every sensor, frame, variant and file; "
        "0 for town and sky."
    )


MODALITY = Modality(
    name="instance",
    dtype="uint16",
    files={"png": FileForm("uint16", "instance")},
    picture=picture,
    screen=Screen("masks"),
    card=_card,
    seen=_seen,
)
