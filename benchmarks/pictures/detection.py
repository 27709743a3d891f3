"""Detections of people and vehicles in whole pictures: in overlapping square pieces, joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.pictures.crowd import CLASSES, Row
from examples.attacks.detector import SAME_OBJECT, Detector, intersection_over_union
from examples.attacks.ssd import LABELS

_SSD = {"person": (LABELS.index("Person"),), "vehicle": (LABELS.index("Car"), LABELS.index("Vehicle"))}
LABELS_OF: dict[str, dict[str, tuple[int, ...]]] = {
    "SSD": _SSD,
    "SSD in pieces": _SSD,
    "CenterNet": {"person": (0,), "vehicle": (2, 5, 7)},  # COCO's car, bus and truck
}
WHOLE = 0.0  # stands for the picture itself, resized to the detector's input
SIDES = {"SSD": (WHOLE,), "SSD in pieces": (1.0, 0.5), "CenterNet": (1.0,)}
"""How each row of the tables shows a picture: the sides of square pieces, as shares of the picture's height."""

_MIN_SCORE, _AT_ONCE = 0.05, 8


def detections(name: str, detector: Detector, pixels: NDArray[np.uint8]) -> list[Row]:
    """Return the detections in a picture, best first in each class.

    Args:
        name: The detector's name in `LABELS_OF`.
        detector: The detector.
        pixels: uint8 [H, W, 3].
    """
    picture = torch.from_numpy(pixels).permute(2, 0, 1).float() / 255.0
    found: dict[str, list[torch.Tensor]] = {label: [] for label in CLASSES}
    for share in SIDES[name]:
        tall, wide = picture.shape[1:] if share == WHOLE else 2 * (round(share * picture.shape[1]),)
        places = [(x, y) for y in _steps(picture.shape[1], tall) for x in _steps(picture.shape[2], wide)]
        for first in range(0, len(places), _AT_ONCE):
            batch = places[first : first + _AT_ONCE]
            pieces = torch.stack([picture[:, y : y + tall, x : x + wide] for x, y in batch])
            with torch.no_grad():
                boxes, logits = detector.raw(pieces)
                scores = detector.scores(logits)
            for (x, y), near, strength in zip(batch, boxes, scores, strict=True):
                whole = _complete(near, x, y, tall, wide, picture)
                for label in CLASSES:
                    best = strength[:, list(LABELS_OF[name][label])].amax(dim=1)
                    rows = torch.cat([near + torch.tensor([x, y, x, y]), best[:, None]], dim=1)
                    found[label].append(rows[(best >= _MIN_SCORE) & whole])
    best_rows = {label: _suppressed(torch.cat(found[label])) for label in CLASSES}
    return [(label, x0, y0, x1, y1, s) for label, rows in best_rows.items() for x0, y0, x1, y1, s in rows]


def _complete(boxes: torch.Tensor, x: int, y: int, tall: int, wide: int, picture: torch.Tensor) -> torch.Tensor:
    """Return which boxes end within a piece, or with the picture: of others, a neighbour sees more."""
    margin = 0.02 * tall
    sides = [x > 0, y > 0, x + wide < picture.shape[2], y + tall < picture.shape[1]]
    ends = [boxes[:, 0] > margin, boxes[:, 1] > margin, boxes[:, 2] < wide - margin, boxes[:, 3] < tall - margin]
    cut = [~end for inner, end in zip(sides, ends, strict=True) if inner]
    return ~torch.stack(cut).any(dim=0) if cut else torch.ones(len(boxes), dtype=torch.bool)


def _steps(length: int, side: int) -> Sequence[int]:
    """Return the starts of pieces that cover a length and overlap by a third at least."""
    count = max(1, -(-(length - side) * 3 // (2 * side)) + 1)
    return [round(k * (length - side) / max(count - 1, 1)) for k in range(count)]


def _suppressed(rows: torch.Tensor) -> list[list[float]]:
    """Return the rows [N, 5] after non-maximum suppression, best first."""
    kept: list[list[float]] = []
    while len(rows):
        best = rows[rows[:, 4].argmax()]
        kept.append(best.tolist())
        rows = rows[intersection_over_union(rows[:, :4], best[:4]) < SAME_OBJECT]
    return kept
