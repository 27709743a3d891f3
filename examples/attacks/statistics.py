"""Intervals of success rates whose trials are not independent, and of their differences.

A trial is one picture. Pictures of one scene, seed, moment or weather resemble each other, so they are resampled by
these units: scenes; the seeds and moments of each scene; weathers, which all scenes share (a bootstrap for crossed and
nested factors, after Owen, "The pigeonhole bootstrap", 2007). The variance gives the number of independent pictures
that would have it, and Wilson's interval (1927) for that number stays within 0 and 1, also where all attacks succeed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

DRAWS = 2000  # of the bootstrap
_QUANTILE = 1.959964  # of the normal distribution, at 97.5 %


@dataclass(frozen=True)
class Interval:
    """A value and the ends of its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def excludes_zero(self) -> bool:
        """Whether the value differs from 0 at the 5 % level."""
        return self.low > 0 or self.high < 0


def wilson(rate: float, count: float) -> Interval:
    """Return Wilson's score interval of a rate, 0 to 1, of `count` independent trials."""
    squared = _QUANTILE**2 / count
    middle = (rate + squared / 2) / (1 + squared)
    half = _QUANTILE * math.sqrt(rate * (1 - rate) / count + squared / (4 * count)) / (1 + squared)
    return Interval(rate, min(max(middle - half, 0.0), rate), max(min(middle + half, 1.0), rate))


def success(found: Values, draws: int = DRAWS) -> Interval:
    """Return the mean of trials and its interval.

    Args:
        found: 1 where an attack succeeded, else 0: [scenes, seeds, moments, weathers].
        draws: Of the bootstrap.
    """
    return _interval(found, _resampled(found, draws))


def difference(found: Values, baseline: Values, draws: int = DRAWS) -> Interval:
    """Return the difference of two means of paired trials, and its interval.

    Both are resampled together. The intervals of both rates and the correlation of their resampled means give that of
    the difference (the method of variance estimates recovery, Zou and Donner, 2008).

    Args:
        found: As for `success`.
        baseline: The same trials of another attack.
        draws: Of the bootstrap.
    """
    if found.shape != baseline.shape:
        raise ValueError(f"trials of the shapes {found.shape} and {baseline.shape} are not paired")
    means = _resampled(found, draws), _resampled(baseline, draws)
    one, other = _interval(found, means[0]), _interval(baseline, means[1])
    together = float(np.corrcoef(*means)[0, 1]) if min(np.ptp(means[0]), np.ptp(means[1])) > 0 else 0.0
    below, above = one.value - one.low, one.high - one.value
    less, more = other.value - other.low, other.high - other.value
    value = one.value - other.value
    low = value - math.sqrt(max(below**2 + more**2 - 2 * together * below * more, 0.0))
    return Interval(value, low, value + math.sqrt(max(above**2 + less**2 - 2 * together * above * less, 0.0)))


def _interval(found: Values, means: Values) -> Interval:
    """Return Wilson's interval for as many trials as the variance of resampled means stands for.

    At most one a scene, seed and moment: weathers of a moment are not counted as independent.
    """
    rate, variance = float(found.mean()), float(means.var())
    most = found.shape[0] * found.shape[1] * found.shape[2]
    return wilson(rate, min(rate * (1 - rate) / variance, most) if variance > 0 else most)


def _resampled(found: Values, draws: int) -> Values:
    """Return the means [draws] of resampled trials; the same units are drawn for all arrays of one shape."""
    scenes, seeds, moments, weathers = found.shape
    generator = np.random.default_rng(1)
    by_scene, by_weather = _counts(generator, (draws,), scenes), _counts(generator, (draws,), weathers)
    by_seed, by_moment = (_counts(generator, (draws, scenes), size) for size in (seeds, moments))
    total = np.zeros(draws)
    for scene in range(scenes):
        seen = np.tensordot(found[scene], by_weather, axes=([2], [1]))  # [seeds, moments, draws]
        drawn = np.einsum("kmd,dk,dm->d", seen, by_seed[:, scene], by_moment[:, scene])
        total += by_scene[:, scene] * drawn
    return total / found.size


def _counts(generator: np.random.Generator, shape: tuple[int, ...], size: int) -> Values:
    """Return how often each of `size` units is drawn in `size` draws: [..., size]."""
    return generator.multinomial(size, [1 / size] * size, shape).astype(np.float64)
