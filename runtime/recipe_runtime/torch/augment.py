"""Random changes of textures before they are rendered, against overfitting to the renderer's frames.

Each texture of a batch [n, 3, h, w] gets its own draw. `torch.nn.Sequential(Geometric(g), Photometric(g))` does both.
"""

from __future__ import annotations

import math

import torch

Range = tuple[float, float]


class Photometric(torch.nn.Module):
    """Contrast, brightness and noise of a print: c x + b + noise, clamped to 0 to 1.

    The defaults are those of Thys et al., "Fooling automated surveillance cameras" (2019): c and b are drawn for each
    texture, and noise for each value.

    Args:
        generator: The source of randomness; PyTorch's own by default.
        contrast: Range of c.
        brightness: Range of b.
        noise: Range of the noise.
    """

    def __init__(
        self,
        generator: torch.Generator | None = None,
        *,
        contrast: Range = (0.8, 1.2),
        brightness: Range = (-0.1, 0.1),
        noise: Range = (-0.1, 0.1),
    ) -> None:
        super().__init__()
        self.generator, self.contrast, self.brightness, self.noise = generator, contrast, brightness, noise

    def forward(self, textures: torch.Tensor) -> torch.Tensor:
        """Return changed textures, [n, 3, h, w]."""
        each = (len(textures), 1, 1, 1)
        contrast, brightness = (_drawn(each, r, textures, self.generator) for r in (self.contrast, self.brightness))
        noise = _drawn(tuple(textures.shape), self.noise, textures, self.generator)
        return (textures * contrast + brightness + noise).clamp(0.0, 1.0)


class Geometric(torch.nn.Module):
    """A print that is turned and of another size within its rectangle, in which it is otherwise of one colour.

    View, distance and perspective follow from the frames; this is for errors in fixing a print to its place. Thys et
    al. use 20 degrees in place of views.

    Args:
        generator: The source of randomness; PyTorch's own by default.
        degrees: Range of the rotation, counter-clockwise.
        scale: Range of the scale.
        aspect: Width of the patch divided by its height, in the scene; by default that of the texture.
        fill: The colour beside the print, 0 to 1.
    """

    def __init__(
        self,
        generator: torch.Generator | None = None,
        *,
        degrees: Range = (-5.0, 5.0),
        scale: Range = (0.9, 1.0),
        aspect: float | None = None,
        fill: float = 0.5,
    ) -> None:
        super().__init__()
        self.generator, self.degrees, self.scale, self.aspect, self.fill = generator, degrees, scale, aspect, fill

    def forward(self, textures: torch.Tensor) -> torch.Tensor:
        """Return changed textures, [n, 3, h, w]."""
        count, _, height, width = textures.shape
        angle = _drawn((count,), self.degrees, textures, self.generator) * (math.pi / 180.0)
        scale = _drawn((count,), self.scale, textures, self.generator)
        cosine, sine, aspect = angle.cos() / scale, angle.sin() / scale, self.aspect or width / height
        zero = torch.zeros_like(cosine)
        rows = [torch.stack([cosine, -sine / aspect, zero], -1), torch.stack([sine * aspect, cosine, zero], -1)]
        grid = torch.nn.functional.affine_grid(torch.stack(rows, 1), list(textures.shape), align_corners=False)
        shown = torch.nn.functional.grid_sample(textures - self.fill, grid, align_corners=False)
        return shown + self.fill


def _drawn(
    shape: tuple[int, ...], limits: Range, like: torch.Tensor, generator: torch.Generator | None
) -> torch.Tensor:
    """Return numbers drawn uniformly from a range, of the dtype and on the device of a tensor."""
    device = like.device if generator is None else generator.device
    share = torch.rand(shape, generator=generator, device=device, dtype=torch.float64)
    return (share * (limits[1] - limits[0]) + limits[0]).to(dtype=like.dtype, device=like.device)
