"""An attack that makes a detector see an object where a patch is, by gradient descent on the patch's texture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from torch.nn import functional

from examples.attacks.detector import Detector
from examples.attacks.views import View

RATE = 0.05  # of Adam
_AT_ONCE = 6  # pictures in a batch where no gradient is needed


@dataclass(frozen=True)
class Goal:
    """What a detector is to see.

    Attributes:
        detector: In evaluation mode.
        boxes: Where, in each frame of a view: [n, 4], x0, y0, x1, y1 in pixels.
        label: What: a label of the detector.
    """

    detector: Detector
    boxes: torch.Tensor
    label: int

    def logits(self, view: View, texture: torch.Tensor, frames: Sequence[int]) -> torch.Tensor:
        """Return the logits [n] of the object in frames of a view, which are given by their index."""
        return self.best(view, texture, frames)[0]

    def best(self, view: View, texture: torch.Tensor, frames: Sequence[int]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return these logits [n], and the boxes [n, 4] in which the detector sees the object."""
        pictures = torch.cat([view.pictures(texture, batch=1, step=frame) for frame in frames])
        labels = torch.full((len(frames),), self.label)
        return self.detector.object_logits(pictures, self.boxes[list(frames)], labels)


@dataclass(frozen=True)
class Bounds:
    """Textures that differ from an image [1, 3, h, w] at most by `reach` per texel and channel, from 0 to 1."""

    image: torch.Tensor
    reach: float

    def clamp(self, texture: torch.Tensor) -> torch.Tensor:
        """Return the nearest texture within the bounds."""
        return texture.clamp(self.image - self.reach, self.image + self.reach).clamp(0, 1)


def optimise(
    view: View, goal: Goal, start: torch.Tensor, bounds: Bounds, *, steps: int, batch: int, seed: int
) -> tuple[torch.Tensor, list[float]]:
    """Return a texture with which a detector sees the goal in the frames of a view, and the loss before each step.

    Args:
        view: The frames.
        goal: What to see in them.
        start: The texture to start from, [1, 3, h, w], 0 to 1.
        bounds: Of the textures.
        steps: Number of steps.
        batch: Frames in a step.
        seed: Of the order of the frames.
    """
    texture = start.clone().requires_grad_()
    optimiser = torch.optim.Adam([texture], lr=RATE)
    order, losses = _shuffled(len(view.frames), seed), []
    for _ in range(steps):
        loss = functional.softplus(-goal.logits(view, texture, [next(order) for _ in range(batch)])).mean()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call, unused-ignore]
        optimiser.step()
        with torch.no_grad():
            texture.copy_(bounds.clamp(texture))
        losses.append(float(loss.detach()))
    return texture.detach(), losses


def scores(view: View, goal: Goal, texture: torch.Tensor) -> list[float]:
    """Return the detector's score of the goal, 0 to 1, in each frame of a view."""
    found: list[float] = []
    with torch.no_grad():
        for first in range(0, len(view.frames), _AT_ONCE):
            frames = range(first, min(first + _AT_ONCE, len(view.frames)))
            found += goal.logits(view, texture, frames).sigmoid().tolist()
    return found


def gradient(view: View, goal: Goal, texture: torch.Tensor, frame: int) -> torch.Tensor:
    """Return the gradient of the attack's loss in one frame, with the shape of the texture."""
    variable = texture.clone().requires_grad_()
    loss = functional.softplus(-goal.logits(view, variable, [frame])).mean()
    return torch.autograd.grad(loss, variable)[0]


def _shuffled(count: int, seed: int) -> Iterator[int]:
    """Yield the numbers from 0 to `count` in a random order, then in another, and so on."""
    generator = torch.Generator().manual_seed(seed)
    while True:
        yield from torch.randperm(count, generator=generator).tolist()
