"""A detector of two layers with the interface of torchvision's detectors. Requires `torch`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch.nn import functional

CELL = 8  # pixels


class CellDetector(torch.nn.Module):
    """Return a score for each cell of a picture, from two layers of fixed weights."""

    def __init__(self) -> None:
        super().__init__()
        seeded = torch.Generator().manual_seed(4)
        self.first = torch.nn.Parameter(torch.randn((6, 3, CELL, CELL), generator=seeded) / CELL)
        self.second = torch.nn.Parameter(torch.randn((1, 6, 3, 3), generator=seeded) / 3)

    def forward(self, pictures: list[torch.Tensor], targets: list[dict[str, torch.Tensor]] | None = None) -> Any:
        """Return the losses of targets in training mode, the cells of each picture with scores in evaluation mode.

        Args:
            pictures: [3, h, w] each, of one size.
            targets: `boxes` [n, 4] of each picture: x0, y0, x1, y1 in pixels; their cells are the ones to detect.
        """
        hidden = torch.tanh(functional.conv2d(torch.stack(pictures), self.first, stride=CELL))
        logits = functional.conv2d(hidden, self.second, padding=1)[:, 0]
        cells = self.cells(logits.shape[1:])
        if self.training:
            assert targets is not None and len(targets) == len(pictures)
            wanted = torch.stack([self.covered(cells, target["boxes"]) for target in targets])
            loss = functional.binary_cross_entropy_with_logits(logits.flatten(1), wanted)
            return {"classification": loss, "unused": loss * 1e6}
        labels = torch.ones(len(cells), dtype=torch.int64)
        return [{"boxes": cells, "labels": labels, "scores": scores.sigmoid().flatten()} for scores in logits]

    @staticmethod
    def cells(shape: Sequence[int]) -> torch.Tensor:
        """Return the boxes of all cells [n, 4] for a number of rows and columns."""
        rows, columns = torch.meshgrid(*(torch.arange(side) * float(CELL) for side in shape), indexing="ij")
        corner = torch.stack([columns, rows], dim=-1).reshape(-1, 2)
        return torch.cat([corner, corner + CELL], dim=1)

    @staticmethod
    def covered(cells: torch.Tensor, boxes: torch.Tensor) -> torch.Tensor:
        """Return 1.0 for each cell whose middle is in a box, and 0.0 for others [n]."""
        middle = (cells[:, None, :2] + cells[:, None, 2:]) / 2
        return ((middle > boxes[None, :, :2]) & (middle < boxes[None, :, 2:])).all(dim=2).any(dim=1).float()
