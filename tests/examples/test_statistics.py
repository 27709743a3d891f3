"""Intervals of success rates: known values, pairing, and the share of simulated studies in which they hold."""

from __future__ import annotations

import numpy as np
import pytest

from examples.attacks.statistics import difference, success, wilson


@pytest.mark.parametrize(
    ("rate", "count", "low", "high"),
    [
        (0.5, 10, 0.2366, 0.7634),  # (0.5 + 0.19207) / 1.38415, -+ 1.96 * sqrt(0.025 + 0.0096036) / 1.38415
        (1.0, 20, 0.8389, 1.0),  # 20 / (20 + 3.8415)
        (0.0, 20, 0.0, 0.1611),
        (0.1, 50, 0.0435, 0.2136),
    ],
)
def test_wilsons_interval(rate: float, count: int, low: float, high: float) -> None:
    found = wilson(rate, count)
    assert [found.value, found.low, found.high] == pytest.approx([rate, low, high], abs=1e-4)


def test_equal_weathers_of_a_moment_are_one_trial() -> None:
    """Twelve copies of 18 trials have the interval of 18 trials, or a wider one; so do no failures at all."""
    once = np.zeros((3, 1, 6, 1))
    once[:, :, :3] = 1
    found, alone = success(np.repeat(once, 12, axis=3)), wilson(0.5, 18)
    assert found.low <= alone.low + 1e-9 and found.high >= alone.high - 1e-9
    every = success(np.ones((3, 1, 6, 12)))
    assert every.high == 1 and every.low == pytest.approx(18 / (18 + 3.8415), abs=1e-4)


def test_pairing_removes_what_both_attacks_share() -> None:
    """One attack succeeds wherever the other does, and in three moments of each scene always."""
    generator = np.random.default_rng(3)
    other = np.repeat((generator.random((3, 4, 8, 1)) < 0.5).astype(float), 6, axis=3)
    one = other.copy()
    one[:, :, :3] = 1
    paired = difference(one, other)
    shuffled = difference(one, generator.permuted(other, axis=2))
    assert paired.excludes_zero and paired.high - paired.low < shuffled.high - shuffled.low
    same = difference(np.ones((3, 2, 6, 2)), np.ones((3, 2, 6, 2)))
    assert same.value == 0 and -0.2 < same.low < 0 < same.high < 0.2
    with pytest.raises(ValueError, match="not paired"):
        difference(one, other[:2])


@pytest.mark.slow
def test_intervals_hold_as_often_as_they_say() -> None:
    """Studies of three scenes, with effects of seed, moment and weather on the chance of success."""
    generator, held, differences, studies = np.random.default_rng(5), 0, 0, 150
    trials = []
    for _ in range(studies):
        effects = [generator.normal(0, size, shape) for size, shape in _EFFECTS]
        chance = sum(effects)
        pair = [generator.random((3, 4, 6, 6)) < 1 / (1 + np.exp(-(chance + shift))) for shift in (0.5, 1.2)]
        trials.append([found.astype(float) for found in pair])
    expected = [float(np.mean([pair[k] for pair in trials])) for k in (0, 1)]
    for one, other in trials:
        found, apart = success(one, 200), difference(other, one, 200)
        held += found.low <= expected[0] <= found.high
        differences += apart.low <= expected[1] - expected[0] <= apart.high
    assert held >= 0.9 * studies and differences >= 0.9 * studies


_EFFECTS = ((0.3, (3, 1, 1, 1)), (0.5, (3, 4, 1, 1)), (0.8, (3, 1, 6, 1)), (0.5, (1, 1, 1, 6)))
