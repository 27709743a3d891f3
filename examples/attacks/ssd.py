"""SSD-MobileNetV2: anchors, boxes, scores, and the interface of torchvision's detectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch.nn import functional

SIZE = 300  # pixels: height and width of a picture
LABELS = (
    "background", "Bicycle", "Boot", "Laptop", "Person", "Chair", "Cattle", "Desk", "Cat", "Computer mouse",
    "Computer monitor", "Box", "Mug", "Coffee cup", "Stationary bicycle", "Table", "Bottle", "High heels", "Vehicle",
    "Footwear", "Dog", "Book", "Camera", "Car",
)  # fmt: skip
PERSON = LABELS.index("Person")
SAME_OBJECT = 0.5  # intersection over union from which two boxes show the same object

_STRIDES = (16, 32, 64, 128, 256, 512)  # pixels between the anchors of a layer
_SCALES = (0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.0)  # side of a layer's anchors, and of an imagined next layer
_BOX_SCALES = (10.0, 10.0, 5.0, 5.0)
_MIN_SCORE, _MAX_DETECTIONS = 0.05, 100


class PhotographDetector(torch.nn.Module):
    """A detector with the interface of torchvision's.

    Args:
        network: From pictures [n, 300, 300, 3], -1 to 1, to box encodings [n, 1917, 4] and logits [n, 1917, 24].
    """

    _anchors: torch.Tensor

    def __init__(self, network: torch.nn.Module) -> None:
        super().__init__()
        self.network = network
        self.register_buffer("_anchors", anchors())

    def raw(self, pictures: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return boxes [n, K, 4], x0, y0, x1, y1 in pixels, and logits [n, K, labels], of pictures [n, 3, 300, 300]."""
        encoded, logits = self.network(pictures.permute(0, 2, 3, 1) * 2 - 1)
        return decode(encoded, self._anchors), logits

    def object_logits(
        self, pictures: torch.Tensor, boxes: torch.Tensor, labels: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the greatest logit of a label among the boxes that show the same object as a given box.

        Where there is no such box, the one nearest to it counts.

        Args:
            pictures: [n, 3, 300, 300], 0 to 1.
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
            pictures: Each [3, 300, 300], 0 to 1.
            targets: For training mode: `boxes` [N, 4] and `labels` [N] of each picture.
        """
        batch = torch.stack(list(pictures))
        if not self.training:
            return [_detections(found, logits.sigmoid()) for found, logits in zip(*self.raw(batch), strict=True)]
        rows = [(k, box, label) for k, t in enumerate(targets or ()) for box, label in zip(t["boxes"], t["labels"])]  # noqa: B905
        if not rows:
            return {"classification": batch.sum() * 0}
        shown, boxes, labels = zip(*rows, strict=True)
        logits, _ = self.object_logits(batch[list(shown)], torch.stack(boxes), torch.stack(labels))
        return {"classification": functional.softplus(-logits).mean()}


def anchors() -> torch.Tensor:
    """Return the anchors [1917, 4]: y and x of the middle, height, width; 0 to 1."""
    rows = []
    for layer, stride in enumerate(_STRIDES):
        scale, side = _SCALES[layer], -(-SIZE // stride)
        shapes = [(scale, 1.0), (scale, 2.0), (scale, 0.5), (scale, 3.0), (scale, 0.3333)]
        shapes.append(((scale * _SCALES[layer + 1]) ** 0.5, 1.0))
        if layer == 0:  # fewer, since it has most places
            shapes = [(0.1, 1.0), (scale, 2.0), (scale, 0.5)]
        rows += [
            ((y + 0.5) / side, (x + 0.5) / side, scale / ratio**0.5, scale * ratio**0.5)
            for y in range(side)
            for x in range(side)
            for scale, ratio in shapes
        ]
    return torch.tensor(rows)


def decode(encoded: torch.Tensor, around: torch.Tensor) -> torch.Tensor:
    """Return boxes [n, K, 4], x0, y0, x1, y1 in pixels, of box encodings [n, K, 4] about anchors [K, 4]."""
    scaled = encoded / torch.tensor(_BOX_SCALES)
    middle = scaled[..., :2] * around[:, 2:] + around[:, :2]
    half = scaled[..., 2:].exp() * around[:, 2:] / 2
    return torch.cat([(middle - half).flip(-1), (middle + half).flip(-1)], dim=-1) * SIZE


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
    for label in range(1, scores.shape[1]):
        left = scores[:, label].clone()
        while float(left.max()) >= _MIN_SCORE:
            best = int(left.argmax())
            kept.append((float(left[best]), best, label))
            left[intersection_over_union(boxes, boxes[best]) >= SAME_OBJECT] = 0
            left[best] = 0
    kept = sorted(kept, reverse=True)[:_MAX_DETECTIONS]
    places = [place for _, place, _ in kept]
    return {
        "boxes": boxes[places].reshape(-1, 4),
        "labels": torch.tensor([label for *_, label in kept], dtype=torch.int64),
        "scores": torch.tensor([score for score, *_ in kept]),
    }
