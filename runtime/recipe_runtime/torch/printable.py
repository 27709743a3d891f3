"""What a printer can print: a range of values and a list of colours, as a projection and as penalties of an attack."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from recipe_runtime.insertion.color_chart import COLORS

Colour = tuple[float, float, float]


class Printable(torch.nn.Module):
    """The limits of a printer.

        printer = Printable(low=0.05, high=0.9)
        loss = attack + 0.01 * printer.non_printability(texture) + 2.5 * total_variation(texture)
        ...
        texture.data = printer(texture.data)  # after each step

    Args:
        low: The darkest value, 0 to 1.
        high: The brightest value, 0 to 1.
        colours: sRGB of colours that can be printed, 0 to 255; measure those of the printer. By default the 24 fields
            of a ColorChecker Classic.
    """

    def __init__(self, low: float = 0.0, high: float = 1.0, colours: Sequence[Colour] = COLORS) -> None:
        super().__init__()
        self.low, self.high = low, high
        self.register_buffer("colours", torch.tensor(colours, dtype=torch.float64) / 255.0)

    def forward(self, texture: torch.Tensor) -> torch.Tensor:
        """Return the nearest texture within the range; it has a gradient where nothing is clamped."""
        return texture.clamp(self.low, self.high)

    def non_printability(self, texture: torch.Tensor) -> torch.Tensor:
        """Return the non-printability score of Sharif et al. (2016), as the mean over the texels.

        The score of a texel is the product of its distances to all colours: 0 if it has one of them.

        Args:
            texture: sRGB, 0 to 1, [..., 3, h, w].
        """
        colours = self.colours.to(dtype=texture.dtype, device=texture.device)
        apart = texture.unsqueeze(-4) - colours[:, :, None, None]  # [..., colours, 3, h, w]
        return apart.norm(dim=-3).prod(dim=-3).mean()


def total_variation(texture: torch.Tensor) -> torch.Tensor:
    """Return the mean over texels of the length of the difference to the next texel on the right and below.

    As Sharif et al. (2016) use it, after Mahendran and Vedaldi (2015), with the mean in place of the sum: a texture of
    one colour has 0, and the result does not depend on the size.

    Args:
        texture: [..., h, w].
    """
    corner = texture[..., :-1, :-1]
    steps = torch.stack([texture[..., :-1, 1:] - corner, texture[..., 1:, :-1] - corner])
    return steps.norm(dim=0).mean()
