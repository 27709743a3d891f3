"""An object in a scene, hidden from a detector by a texture, and what the detector still sees of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import torch
from recipe_runtime.loading import compiled
from recipe_runtime.scenario import Scenario, Scenes
from recipe_runtime.torch import Place, SceneView
from torch.nn import functional

from examples.attacks.augmentation import Augmentation
from examples.attacks.detector import Detector, intersection_over_union
from examples.attacks.detectors import opened
from examples.attacks.ssd import LABELS
from examples.attacks.views import DigitalView, View

RECIPES = Path(__file__).parents[3] / "recipes" / "attacks"
DETECTORS = ("SSD", "CenterNet")
PERSON = {"SSD": (LABELS.index("Person"),), "CenterNet": (0,)}  # labels that are right
CAR = {"SSD": (LABELS.index("Car"), LABELS.index("Vehicle")), "CenterNet": (2,)}
RATE, BATCH = 0.05, 4  # of Adam; frames in a step

_SAME, _NEAR, _STRONGEST = 0.5, 0.3, 10  # intersections over union; boxes of which an attack lowers the score
_MIN_SCORE, _MAX_DETECTIONS, _AT_ONCE = 0.05, 100, 8


class Detection:
    """A scene with one object that detectors are to miss.

    Args:
        recipe: Name of a recipe of recipes/attacks.
        actor: The object.
        labels: Of each detector: those that are right for the object.
    """

    def __init__(self, recipe: str, actor: str, labels: Mapping[str, Sequence[int]]) -> None:
        plan, scenes = compiled(RECIPES / f"{recipe}.yaml"), Scenes()
        self._scenarios = {variant.variant: Scenario(variant, scenes) for variant in plan.variants}
        self._plan, self._actor, self._labels = plan, actor, labels
        self._detector: Callable[[str], Detector] = cache(opened)
        self._views, self._box = cache(self._view), cache(self._truth)

    def attack(
        self,
        patch: str,
        places: Sequence[Place],
        start: torch.Tensor,
        *,
        steps: int,
        seed: int,
        detector: str = DETECTORS[0],
        digital: bool = False,
        augment: Augmentation | None = None,
    ) -> torch.Tensor:
        """Return a texture with which a detector misses the object, rounded to 8 bits.

        Each step lowers the scores of the strongest boxes that overlap the object, in pictures that are shifted and
        scaled at random, so that the texture fits no single place in the detector's grid.

        Args:
            patch: Which carries the texture.
            places: The frames to optimise in.
            start: The texture to start from, [1, 3, h, w].
            steps: Number of steps of Adam; half as many for CenterNet, which takes five times as long.
            seed: Of the order of the frames and the augmentation.
            detector: Which misses it.
            digital: Warp the texture into the picture instead of rendering it.
            augment: Changes the texture in each step.
        """
        view, texture = self._views(patch, tuple(places), digital), start.clone().requires_grad_()
        optimiser, generator = torch.optim.Adam([texture], lr=RATE), torch.Generator().manual_seed(seed)
        for k in range(len(places)):  # record the frames of a scene together: its renderer is kept for two scenes only
            view.pictures(start, batch=1, step=k)
        for _ in range(max(steps // 2, 1) if detector == "CenterNet" else steps):
            chosen = torch.randperm(len(places), generator=generator)[:BATCH].tolist()
            shown = [texture if augment is None else augment(texture, generator) for _ in chosen]
            pictures = torch.cat(
                [view.pictures(one.clamp(0, 1), batch=1, step=k) for one, k in zip(shown, chosen, strict=True)]
            )
            boxes = torch.stack([self._box(places[k]) for k in chosen])
            loss = self._loss(detector, *reframed(pictures, boxes, generator))
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call, unused-ignore]
            optimiser.step()
            with torch.no_grad():
                texture.clamp_(0, 1)
        return texture.detach().mul(255).round().div(255)

    def test(self, patch: str, places: Sequence[Place], texture: torch.Tensor) -> dict[str, Any]:
        """Return what the detectors see of a texture, in JSON's types.

        Returns:
            `places`; `boxes`, of the object; and for each detector `scores` of the object, and `detections`.
        """
        view = self._views(patch, tuple(places), False)
        boxes = torch.stack([self._box(place) for place in places])
        seen: dict[str, Any] = {name: {"scores": [], "detections": []} for name in self._labels}
        for first in range(0, len(places), _AT_ONCE):
            chosen = range(first, min(first + _AT_ONCE, len(places)))
            with torch.no_grad():
                pictures = torch.cat([view.pictures(texture, batch=1, step=k) for k in chosen])
                for name, rows in seen.items():
                    scores, detections = self._tested(name, pictures, boxes[chosen.start : chosen.stop])
                    rows["scores"] += scores
                    rows["detections"] += detections
        return {"places": list(places), "boxes": boxes.tolist(), **seen}

    def pictures(self, patch: str, places: Sequence[Place], texture: torch.Tensor) -> torch.Tensor:
        """Return frames with a texture, [n, 3, H, W]."""
        with torch.no_grad():
            return self._views(patch, tuple(places), False).pictures(texture)

    def _tested(
        self, detector: str, pictures: torch.Tensor, boxes: torch.Tensor
    ) -> tuple[list[float], list[list[list[float]]]]:
        """Return the object's score and the detections in each picture."""
        found, logits = self._seen(detector, pictures)
        overlap = intersection_over_union(found, boxes[:, None])
        near = overlap >= overlap.amax(dim=1, keepdim=True).clamp(max=_SAME)
        scores: list[float] = logits.masked_fill(~near, -torch.inf).amax(dim=1).sigmoid().tolist()
        return scores, [_detections(b, s) for b, s in zip(found, logits.sigmoid(), strict=True)]

    def _seen(self, detector: str, pictures: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return boxes [n, K, 4] and the greatest logit of the object's labels in each, [n, K]."""
        boxes, logits = self._detector(detector).raw(pictures)
        return boxes, logits[..., list(self._labels[detector])].amax(dim=-1)

    def _loss(self, detector: str, pictures: torch.Tensor, boxes: torch.Tensor) -> torch.Tensor:
        found, logits = self._seen(detector, pictures)
        far = intersection_over_union(found.detach(), boxes[:, None]) < _NEAR
        return functional.softplus(logits.masked_fill(far, -torch.inf).topk(_STRONGEST).values).mean()

    def _view(self, patch: str, places: tuple[Place, ...], digital: bool) -> View:
        return DigitalView(self._scenarios, patch, places) if digital else SceneView(self._plan, patch, places)

    def _truth(self, place: Place) -> torch.Tensor:
        """Return the box [4] of the object's visible pixels, x0, y0, x1, y1."""
        records = self._scenarios[place[0]].labels(place[1])
        x, y, width, height = next(record["bbox"] for record in records if record["actor"] == self._actor)
        return torch.tensor([x, y, x + width, y + height], dtype=torch.float32)


def noise(size: tuple[int, int], seed: int) -> torch.Tensor:
    """Return a random texture [1, 3, h, w] of a size (h, w)."""
    return torch.rand((1, 3, *size), generator=torch.Generator().manual_seed(seed))


def start(size: tuple[int, int], seed: int) -> torch.Tensor:
    """Return grey with some noise, from which attacks start."""
    return 0.5 + 0.2 * (noise(size, seed) - 0.5)


def reframed(
    pictures: torch.Tensor, boxes: torch.Tensor, generator: torch.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return pictures [n, 3, H, W], shifted by up to a tenth and scaled by up to a fifth, and their boxes [n, 4]."""
    count, (height, width) = len(pictures), pictures.shape[2:]
    scale = 0.8 + 0.4 * torch.rand(count, generator=generator)
    shift = 0.2 * (2 * torch.rand(count, 2, generator=generator) - 1)  # of half the picture
    matrices = torch.stack([torch.diag_embed(scale[:, None].expand(-1, 2))[..., k] for k in (0, 1)] + [shift], dim=-1)
    grid = functional.affine_grid(matrices, list(pictures.shape), align_corners=False)
    size = torch.tensor([width, height]) / 2
    corners = (boxes.unflatten(1, (2, 2)) / size - 1 - shift[:, None]) / scale[:, None, None]
    moved = functional.grid_sample(pictures, grid, padding_mode="border", align_corners=False)
    return moved, ((corners + 1) * size).flatten(1)


def _detections(boxes: torch.Tensor, scores: torch.Tensor) -> list[list[float]]:
    """Return boxes and scores of a picture after non-maximum suppression, best first."""
    likely = scores >= _MIN_SCORE
    boxes, left = boxes[likely], scores[likely].clone()
    kept: list[list[float]] = []
    while len(left) and float(left.max()) > 0 and len(kept) < _MAX_DETECTIONS:
        best = int(left.argmax())
        kept.append([*(round(v, 2) for v in boxes[best].tolist()), float(left[best])])
        left[intersection_over_union(boxes, boxes[best]) >= _SAME] = 0
        left[best] = 0
    return kept
