"""The modalities of a frame: the only table of their names and of their order."""

from __future__ import annotations

from typing import Literal, get_args

Modality = Literal["rgb", "depth", "instance", "semantic"]

MODALITIES: tuple[Modality, ...] = get_args(Modality)
"""All modalities, in the order of a plan's `capture`."""

LABEL_MODALITIES: tuple[Modality, ...] = tuple(modality for modality in MODALITIES if modality != "rgb")
"""The modalities that depend on the scene and the rig only, and not on the appearance."""

DIGEST_KINDS: tuple[str, ...] = (*LABEL_MODALITIES, "labels", "rgb")
"""What a lockfile has digests of for each frame, in pipeline order; `labels` are the annotations."""
