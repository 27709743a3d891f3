"""Random changes of a texture's light, by which attacks on a picture prepare for the scene's light."""

from __future__ import annotations

from dataclasses import dataclass

import torch


@dataclass(frozen=True)
class Augmentation:
    """Ranges of uniform random numbers: a texture becomes texture * contrast + brightness + noise, from 0 to 1.

    Contrast and brightness are drawn for each picture, noise for each texel and channel, from -noise to noise.
    """

    contrast: tuple[float, float]
    brightness: tuple[float, float]
    noise: float

    def __call__(self, texture: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """Return a changed texture [1, 3, h, w]; its gradient reaches the given one."""
        factor, offset = (
            low + (high - low) * torch.rand(1, generator=generator) for low, high in (self.contrast, self.brightness)
        )
        grain = self.noise * (2 * torch.rand(texture.shape, generator=generator) - 1)
        return (texture * factor + offset + grain).clamp(0, 1)


# Thys, Van Ranst and Goedeme, "Fooling automated surveillance cameras", 2019: `PatchTransformer` of their code.
THYS = Augmentation((0.8, 1.2), (-0.1, 0.1), 0.1)
WIDE = Augmentation((0.3, 1.1), (-0.1, 0.4), 0.1)
