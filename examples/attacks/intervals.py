"""Means over attack seeds, with 95 % intervals by Student's t distribution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

# The 97.5 % quantile of Student's t distribution, by degrees of freedom.
_QUANTILES = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}


@dataclass(frozen=True)
class Interval:
    """A mean, and half the width of its 95 % interval; NaN for a single value."""

    mean: float
    half: float

    @property
    def excludes_zero(self) -> bool:
        """Whether the mean differs from 0 at the 5 % level."""
        return abs(self.mean) > self.half


def over_seeds(values: Sequence[float]) -> Interval:
    """Return the mean of one value a seed, and its interval.

    Raises:
        ValueError: There is no value, or more than ten.
    """
    count = len(values)
    if not 1 <= count <= len(_QUANTILES) + 1:
        raise ValueError(f"{count} seeds are given; give 1 to {len(_QUANTILES) + 1}")
    mean = math.fsum(values) / count
    if count == 1:
        return Interval(mean, math.nan)
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1)
    return Interval(mean, _QUANTILES[count - 1] * math.sqrt(variance / count))


def paired(values: Sequence[float], baseline: Sequence[float]) -> Interval:
    """Return the mean difference of two attacks with the same seeds, and its interval.

    Raises:
        ValueError: They have different numbers of seeds.
    """
    return over_seeds([value - other for value, other in zip(values, baseline, strict=True)])
