"""A tracker by a discriminative correlation filter with colour and edges, through which gradients flow.

It is the linear form of kernelised correlation filters (Henriques et al., 2015), with the update of MOSSE (Bolme et
al., 2010): the filter is a ridge regression, solved in the frequency domain, of a Gaussian peak on the target's
surroundings; the numerator and the denominator are averaged over the frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch.nn import functional

GRID = 48  # samples along each side of a search window
WINDOW = 2.2  # side of the window, heights of the target

_RIDGE, _UPDATE, _PEAK = 1e-3, 0.08, 2.5  # of the regression; share of a new frame; width of the peak, samples


@dataclass(frozen=True)
class Filter:
    """Numerator [n, channels, GRID, GRID / 2 + 1] and denominator [n, 1, GRID, GRID / 2 + 1] of a filter."""

    numerator: torch.Tensor
    denominator: torch.Tensor

    def response(self, windows: torch.Tensor) -> torch.Tensor:
        """Return the response [n, GRID, GRID] of search windows [n, 3, GRID, GRID]: about 1 where the target is."""
        seen = torch.fft.rfft2(features(windows))
        filtered = (self.numerator * seen).sum(dim=1) / (self.denominator[:, 0] + _RIDGE)
        return torch.fft.irfft2(filtered, s=(GRID, GRID))

    def mixed(self, other: Filter, share: float) -> Filter:
        """Return the average with another filter, which has a share from 0 to 1."""
        numerator = (1 - share) * self.numerator + share * other.numerator
        return Filter(numerator, (1 - share) * self.denominator + share * other.denominator)


def trained(windows: torch.Tensor) -> Filter:
    """Return the filter whose response to windows [n, 3, GRID, GRID] is a peak in their middle."""
    seen, wanted = torch.fft.rfft2(features(windows)), torch.fft.rfft2(_peak())
    energy = (seen.abs() ** 2).sum(dim=1, keepdim=True)
    return Filter(wanted * seen.conj(), energy)


def features(windows: torch.Tensor) -> torch.Tensor:
    """Return colour and edges of windows [n, 3, GRID, GRID], tapered to 0 at the rim: [n, 5, GRID, GRID]."""
    grey = functional.pad(windows.mean(dim=1, keepdim=True), (1, 1, 1, 1), mode="replicate")
    edges = torch.cat([grey[..., 1:-1, 2:] - grey[..., 1:-1, :-2], grey[..., 2:, 1:-1] - grey[..., :-2, 1:-1]], dim=1)
    centred = windows - windows.mean(dim=(2, 3), keepdim=True)
    taper = torch.hann_window(GRID, periodic=False)
    return torch.cat([centred, edges], dim=1) * taper * taper[:, None] / GRID


def windows(pictures: torch.Tensor, centres: torch.Tensor, sides: torch.Tensor) -> torch.Tensor:
    """Return square windows [n, 3, GRID, GRID] of pictures [n, 3, H, W]; beyond the picture, its rim is repeated.

    Args:
        pictures: Pictures.
        centres: x and y, pixels, [n, 2].
        sides: Of the windows, pixels, [n].
    """
    height, width = pictures.shape[2:]
    steps = (torch.arange(GRID) + 0.5) / GRID - 0.5
    x = (centres[:, 0, None] + steps * sides[:, None]) * 2 / width - 1
    y = (centres[:, 1, None] + steps * sides[:, None]) * 2 / height - 1
    grid = torch.stack([x[:, None].expand(-1, GRID, -1), y[:, :, None].expand(-1, -1, GRID)], dim=-1)
    return functional.grid_sample(pictures, grid, padding_mode="border", align_corners=False)


def track(pictures: torch.Tensor, centre: torch.Tensor, side: float) -> torch.Tensor:
    """Return where the tracker sees the target in each picture, x and y in pixels, [n, 2].

    Args:
        pictures: A video, [n, 3, H, W].
        centre: Of the target in the first picture, [2].
        side: Of the search window, pixels.
    """
    sides, places = torch.tensor([side]), [centre]
    kept = trained(windows(pictures[:1], centre[None], sides))
    for picture in pictures[1:]:
        response = kept.response(windows(picture[None], places[-1][None], sides))[0]
        best = int(response.argmax())
        moved = torch.tensor([best % GRID, best // GRID]) - GRID // 2
        places.append(places[-1] + moved * side / GRID)
        kept = kept.mixed(trained(windows(picture[None], places[-1][None], sides)), _UPDATE)
    return torch.stack(places)


def _peak() -> torch.Tensor:
    """Return a Gaussian in the middle of a window."""
    steps = (torch.arange(GRID) - GRID // 2) ** 2 / (2 * _PEAK**2)
    return torch.exp(-steps - steps[:, None])
