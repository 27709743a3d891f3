"""Labels in the form of torchvision's detection models."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from recipe_runtime.annotate.records import LabelRecord


def target_of(records: Sequence[LabelRecord]) -> dict[str, torch.Tensor]:
    """Return the labels of a frame as `RecipeDataset` describes them."""
    boxes = [[x, y, x + w, y + h] for x, y, w, h in (record["bbox"] for record in records)]
    return {
        "boxes": torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4),
        "labels": torch.tensor([record["instance"] // 1000 for record in records], dtype=torch.int64),
        "instances": torch.tensor([record["instance"] for record in records], dtype=torch.int64),
        "area": torch.tensor([record["area"] for record in records], dtype=torch.int64),
        "iscrowd": torch.zeros(len(records), dtype=torch.int64),
        "visible_fraction": torch.tensor([record["visible_fraction"] for record in records], dtype=torch.float32),
    }
