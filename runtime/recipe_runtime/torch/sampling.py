"""Random choice of frames, for the expectation over transformations (Athalye et al. 2018)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import torch
from recipe_compiler.ir.errors import InputError

from recipe_runtime.torch.shots import Shot

Weight = Callable[[Shot], float]


def sampled(shots: Sequence[Shot], generator: torch.Generator, count: int, weights: Weight | None) -> list[int]:
    """Return indices of shots, drawn independently; the arguments are those of `SceneView.sample`.

    Raises:
        InputError: A weight is negative or not finite, or all are 0.
    """
    shares = [1.0 if weights is None else float(weights(shot)) for shot in shots]
    wrong = [share for share in shares if not 0.0 <= share < math.inf]
    if wrong:
        raise InputError(f"a shot has the weight {wrong[0]:g}; weights are finite and not negative")
    if not any(shares):
        raise InputError("all shots have the weight 0; give one of them a larger weight")
    drawn = torch.multinomial(torch.tensor(shares, dtype=torch.float64), count, replacement=True, generator=generator)
    return [int(index) for index in drawn]
