"""95 % intervals by a bootstrap over seeds and moments, for means and for scores of many pictures together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from examples.attacks.statistics import success

DRAWS = 1000


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


def rate(found: NDArray[np.bool_]) -> str:
    """Return the percentage of successes [seeds, moments, weathers], and its interval in brackets."""
    interval = success(found[None].astype(np.float64))
    return Range(*(100 * value for value in (interval.value, interval.low, interval.high))).text(0, " %")


def stacked(rows: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    """Return one row a seed as an array."""
    return np.array(rows, np.float64)
