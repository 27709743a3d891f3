"""A detector whose boxes and scores have gradients, with the interface of torchvision's detectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch.nn import functional

SAME_OBJECT = 0.5  # intersection over union from which two boxes show the same object

_MIN_SCORE, _MAX_DETECTIONS = 0.05, 100


class Detector(torch.nn.Module):
    """A detector in terms of `raw`, which a subclass defines.

    Pictures of any size are accepted; a detector that has one size resizes them by bilinear interpolation.

    Attributes:
        person: The label of a person.
    """

    person: int

    def raw(self, pictures: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return boxes [n, K, 4], x0, y0, x1, y1 in pixels, and logits [n, K, labels].

        Args:
            pictures: [n, 3, H, W], 0 to 1.
        """
        raise NotImplementedError

    def scores(self, logits: torch.Tensor) -> torch.Tensor:
        """Return the scores of boxes, 0 to 1, [n, K, labels], from their logits; 0 for those that are no candidates."""
        return logits.sigmoid()

    def object_logits(
        self, pictures: torch.Tensor, boxes: torch.Tensor, labels: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the greatest logit of a label among the boxes that show the same object as a given box.

        Where there is no such box, the one nearest to it counts.

        Args:
            pictures: [n, 3, H, W], 0 to 1.
            boxes: One a picture, [n, 4], x0, y0, x1, y1 in pixels.
            labels: One a picture, int64 [n].

        Returns:
            The logits [n], and the detector's boxes [n, 4] that have them.
        """
        found, logits = self.raw(pictures)
        overlap = intersection_over_union(found.detach(), boxes[:, None])
        near = overlap >= overlap.amax(dim=1, keepdim=True).clamp(max=SAME_OBJECT)
        wanted = logits.gather(2, labels[:, None, None].expand(-1, logits.shape[1], 1))[..., 0]
        best, places = wanted.masked_fill(~near, -torch.inf).max(dim=1)
        return best, found[torch.arange(len(found)), places]

    def forward(
        self, pictures: Sequence[torch.Tensor], targets: Sequence[dict[str, torch.Tensor]] | None = None
    ) -> Any:
        """Return the loss of the targets in training mode, and the detections of each picture in evaluation mode.

        Args:
            pictures: Each [3, H, W], 0 to 1, of one size.
            targets: For training mode: `boxes` [N, 4] and `labels` [N] of each picture.
        """
        batch = torch.stack(list(pictures))
        if not self.training:
            boxes, logits = self.raw(batch)
            return [_detections(found, scores) for found, scores in zip(boxes, self.scores(logits), strict=True)]
        rows = [(k, box, label) for k, t in enumerate(targets or ()) for box, label in zip(t["boxes"], t["labels"])]  # noqa: B905
        if not rows:
            return {"classification": batch.sum() * 0}
        shown, found, labels = zip(*rows, strict=True)
        wanted, _ = self.object_logits(batch[list(shown)], torch.stack(found), torch.stack(labels))
        return {"classification": functional.softplus(-wanted).mean()}


def resized(pictures: torch.Tensor, side: int) -> torch.Tensor:
    """Return pictures [n, 3, H, W] with a height and width of `side` pixels."""
    if pictures.shape[2:] == (side, side):
        return pictures
    return functional.interpolate(pictures, (side, side), mode="bilinear", align_corners=False)


def scaled(boxes: torch.Tensor, pictures: torch.Tensor, side: int) -> torch.Tensor:
    """Return boxes [n, K, 4] of pictures [n, 3, H, W] that were resized to `side`, in pixels of the originals."""
    height, width = pictures.shape[2:]
    return boxes * torch.tensor([width / side, height / side, width / side, height / side])


def intersection_over_union(one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """Return the overlap [...] of boxes [..., 4], which broadcast."""
    low, high = torch.maximum(one[..., :2], other[..., :2]), torch.minimum(one[..., 2:], other[..., 2:])
    shared = (high - low).clamp(min=0).prod(-1)
    areas = [(boxes[..., 2:] - boxes[..., :2]).prod(-1) for boxes in (one, other)]
    return shared / (areas[0] + areas[1] - shared)


def _detections(boxes: torch.Tensor, scores: torch.Tensor) -> dict[str, torch.Tensor]:
    """Return the boxes [N, 4], labels [N] and scores [N] of a picture after non-maximum suppression, best first."""
    boxes, scores = boxes.detach(), scores.detach()
    kept: list[tuple[float, int, int]] = []
    for label in range(scores.shape[1]):
        places = (scores[:, label] >= _MIN_SCORE).nonzero()[:, 0]
        left, near = scores[places, label].clone(), boxes[places]
        while len(places) and float(left.max()) > 0:
            best = int(left.argmax())
            kept.append((float(left[best]), int(places[best]), label))
            left[intersection_over_union(near, near[best]) >= SAME_OBJECT] = 0
            left[best] = 0
    kept = sorted(kept, reverse=True)[:_MAX_DETECTIONS]
    chosen = [place for _, place, _ in kept]
    return {
        "boxes": boxes[chosen].reshape(-1, 4),
        "labels": torch.tensor([label for *_, label in kept], dtype=torch.int64),
        "scores": torch.tensor([score for score, *_ in kept]),
    }
