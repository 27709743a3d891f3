"""An attack that makes a detector see an object where a patch is, by gradient descent on the patch's texture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import torch
from torch.nn import functional

from examples.attacks.detector import Detector
from examples.attacks.views import View

RATE = 0.05  # of Adam
_AT_ONCE = 6  # pictures in a batch where no gradient is needed

Change = Callable[[torch.Tensor, torch.Generator], torch.Tensor]  # of a texture, by random numbers


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

    def logits(self, pictures: torch.Tensor, frames: Sequence[int]) -> torch.Tensor:
        """Return the logits [n] of the object in pictures [n, 3, H, W] of frames, which are given by their index."""
        return self.best(pictures, frames)[0]

    def best(self, pictures: torch.Tensor, frames: Sequence[int]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return these logits [n], and the boxes [n, 4] in which the detector sees the object."""
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
    view: View,
    goal: Goal,
    start: torch.Tensor,
    bounds: Bounds,
    *,
    steps: Sequence[int],
    batch: int,
    seed: int,
    change: Change | None = None,
) -> tuple[list[torch.Tensor], list[float]]:
    """Return textures with which a detector sees the goal in the frames of a view, and the loss before each step.

    Args:
        view: The frames.
        goal: What to see in them.
        start: The texture to start from, [1, 3, h, w], 0 to 1.
        bounds: Of the textures.
        steps: Numbers of steps after which to return the texture, in ascending order.
        batch: Frames in a step.
        seed: Of the order of the frames, and of `change`.
        change: Applied to the texture before each picture of a step.
    """
    texture = start.clone().requires_grad_()
    optimiser = torch.optim.Adam([texture], lr=RATE)
    order, random = _shuffled(len(view.frames), seed), torch.Generator().manual_seed(seed)
    found, losses = [], []
    for number in range(1, steps[-1] + 1):
        frames = [next(order) for _ in range(batch)]
        shown = [texture if change is None else change(texture, random) for _ in frames]
        pictures = [view.pictures(given, batch=1, step=frame) for given, frame in zip(shown, frames, strict=True)]
        loss = functional.softplus(-goal.logits(torch.cat(pictures), frames)).mean()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call, unused-ignore]
        optimiser.step()
        with torch.no_grad():
            texture.copy_(bounds.clamp(texture))
        losses.append(float(loss.detach()))
        if number in steps:
            found.append(texture.detach().clone())
    return found, losses


def scores(view: View, goals: Sequence[Goal], texture: torch.Tensor) -> list[list[float]]:
    """Return, for each goal, its score, 0 to 1, in each frame of a view."""
    found: list[list[float]] = [[] for _ in goals]
    with torch.no_grad():
        for first in range(0, len(view.frames), _AT_ONCE):
            frames = range(first, min(first + _AT_ONCE, len(view.frames)))
            pictures = torch.cat([view.pictures(texture, batch=1, step=frame) for frame in frames])
            for goal, row in zip(goals, found, strict=True):
                row += goal.logits(pictures, frames).sigmoid().tolist()
    return found


def gradient(view: View, goal: Goal, texture: torch.Tensor, frame: int) -> torch.Tensor:
    """Return the gradient of the attack's loss in one frame, with the shape of the texture."""
    variable = texture.clone().requires_grad_()
    loss = functional.softplus(-goal.logits(view.pictures(variable, batch=1, step=frame), [frame])).mean()
    return torch.autograd.grad(loss, variable)[0]


def _shuffled(count: int, seed: int) -> Iterator[int]:
    """Yield the numbers from 0 to `count` in a random order, then in another, and so on."""
    generator = torch.Generator().manual_seed(seed)
    while True:
        yield from torch.randperm(count, generator=generator).tolist()
