"""Means over seeds and their confidence intervals, compared with textbook values."""

from __future__ import annotations

import math

import pytest

from examples.attacks.intervals import over_seeds, paired


def test_an_interval_follows_students_t_distribution() -> None:
    """Five values with mean 3 and variance 2.5: 2.776 * sqrt(2.5 / 5)."""
    found = over_seeds([1, 2, 3, 4, 5])
    assert found.mean == 3 and found.half == pytest.approx(1.963, abs=1e-3) and found.excludes_zero


def test_equal_values_have_no_width_and_one_value_has_no_interval() -> None:
    assert over_seeds([0.5, 0.5, 0.5]).half == 0
    assert math.isnan(over_seeds([0.5]).half) and not over_seeds([0.5]).excludes_zero


def test_pairing_removes_the_variance_that_seeds_share() -> None:
    values, baseline = [10.0, 50.0, 90.0], [9.0, 48.9, 89.1]
    assert paired(values, baseline).excludes_zero and not over_seeds([v - 49 for v in values]).excludes_zero
    with pytest.raises(ValueError, match="shorter"):
        paired([1.0, 2.0], [1.0])


@pytest.mark.parametrize("count", [0, 11])
def test_too_few_or_many_seeds_are_refused(count: int) -> None:
    with pytest.raises(ValueError, match=f"{count} seeds are given"):
        over_seeds([1.0] * count)
