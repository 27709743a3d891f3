"""Reads the index of an export that is already at the output folder, which may have been written by anyone."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from recipe_runtime.core.documents import decode_exactly
from recipe_runtime.core.files import is_folder, read_inside
from recipe_runtime.dataset.reader import Dataset

T = TypeVar("T")

_MIN_BYTES = 16 << 20


def read_index(out: Path, name: str, dataset: Dataset, bytes_per_frame: int, kind: type[T]) -> T | None:
    """Return the JSON index of an export; None if it is absent, damaged or too large.

    Args:
        out: The folder of the export.
        name: The name of its index.
        dataset: The dataset to export, which determines how long an index may be.
        bytes_per_frame: Bytes of an index for each frame of the dataset, at most.
        kind: The type of the index.
    """
    frames = sum(len(s.frames(v.scene.clock.frames)) for v in dataset.plan.variants for s in v.rig.sensors)
    try:
        body = read_inside(out, name, max(_MIN_BYTES, bytes_per_frame * frames))
        return decode_exactly(body, kind) if is_folder(out) else None
    except (OSError, ValueError):
        return None
