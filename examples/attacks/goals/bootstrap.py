"""95 % intervals by a bootstrap over seeds and moments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

DRAWS = 1000
_Z = 1.959964  # the 97.5 % quantile of the normal distribution


@dataclass(frozen=True)
class Range:
    """A value and its 95 % interval."""

    value: float
    low: float
    high: float

    def text(self, digits: int, unit: str = "") -> str:
        """Return the value and its interval in brackets."""
        return f"{self.value:.{digits}f}{unit} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


def resampled(
    statistic: Callable[[NDArray[np.int64], NDArray[np.int64]], float], seeds: int, moments: int, draws: int = DRAWS
) -> Range:
    """Return a statistic of all seeds and moments, and its interval over resampled seeds and moments.

    Args:
        statistic: Of the indices of seeds and of moments, which repeat in a sample.
        seeds: Number of seeds.
        moments: Number of moments. What belongs to one moment (its weathers) is not resampled.
        draws: Number of samples.
    """
    random = np.random.default_rng(0)
    value = statistic(np.arange(seeds), np.arange(moments))
    found = [statistic(random.integers(0, seeds, seeds), random.integers(0, moments, moments)) for _ in range(draws)]
    low, high = np.quantile(found, (0.025, 0.975))
    return Range(value, float(low), float(high))


def mean(values: NDArray[np.float64], draws: int = DRAWS) -> Range:
    """Return the mean of values [seeds, moments], and its interval."""
    seeds, moments = values.shape
    return resampled(lambda s, m: float(values[np.ix_(s, m)].mean()), seeds, moments, draws)


def rate(found: NDArray[np.bool_]) -> Range:
    """Return the percentage of successes [seeds, moments, ...], and its interval.

    Where all are equal, resampling finds no spread: then the interval is Wilson's, with a trial for each moment.
    """
    share = found.reshape(*found.shape[:2], -1).mean(axis=2)
    value = mean(share)
    if value.low == value.high:
        low, high = wilson(round(value.value * share.shape[1]), share.shape[1])
        value = Range(value.value, low, high)
    return Range(100 * value.value, 100 * value.low, 100 * value.high)


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a share by Wilson (1927)."""
    share, spread = successes / trials, _Z * _Z / trials
    middle = (share + spread / 2) / (1 + spread)
    half = _Z / (1 + spread) * (share * (1 - share) / trials + spread / (4 * trials)) ** 0.5
    return max(middle - half, 0.0), min(middle + half, 1.0)


def stacked(rows: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    """Return one row a seed as an array."""
    return np.array(rows, np.float64)
