"""Car following: gaps at standstill and in motion, and no collision in a platoon."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.library import blueprints
from recipe_runtime.simulation.traffic.following import (
    HARDEST_BRAKING,
    following_acceleration,
    free_acceleration,
    style_of,
)

CAR = style_of(blueprints.match("vehicle.sedan.a")[0].shape)
BUS = style_of(blueprints.match("vehicle.bus.city")[0].shape)
DT = 0.1


def _drive(gap: float, speed: float, leader: list[float], desired: float = 14.0) -> tuple[float, float, float]:
    """Follow a leader with given speeds; return the last gap, the smallest gap and the hardest braking."""
    least, hardest = gap, 0.0
    for ahead in leader:
        free = free_acceleration(speed, desired, CAR)
        a = following_acceleration(speed, free, gap, ahead, CAR, CAR.gap)
        after = max(0.0, speed + a * DT)
        gap += (ahead - (speed + after) / 2) * DT
        speed, least, hardest = after, min(least, gap), min(hardest, a)
    return gap, least, hardest


def test_a_standing_leader_is_approached_with_comfortable_braking() -> None:
    gap, least, hardest = _drive(120.0, 14.0, [0.0] * 600)
    assert gap == pytest.approx(CAR.gap, abs=0.3) and least > 1.5
    assert hardest > -3.2


def test_braking_is_hard_only_if_necessary() -> None:
    _, least, hardest = _drive(16.0, 14.0, [0.0] * 300)
    assert least > 0.0
    assert -HARDEST_BRAKING <= hardest < -5.0


def test_a_cut_in_at_equal_speed_brakes_gently() -> None:
    free = free_acceleration(25.0, 30.0, CAR)
    assert following_acceleration(25.0, free, 10.0, 25.0, CAR, CAR.gap) > -3.0


def test_braking_to_a_lower_speed_limit_is_bounded() -> None:
    assert free_acceleration(30.0, 8.0, CAR) == -3.0
    assert free_acceleration(8.0, 8.0, CAR) == 0.0
    assert 0.0 < free_acceleration(0.0, 8.0, BUS) < free_acceleration(0.0, 8.0, CAR)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-HARDEST_BRAKING, 2.0), min_size=5, max_size=40), st.integers(2, 8), st.floats(1.0, 20.0))
def test_a_platoon_never_collides(wishes: list[float], count: int, start: float) -> None:
    """For any speeds of the first vehicle, all gaps behind it stay positive."""
    speeds = [start] * count
    places = [-n * (4.5 + CAR.gap + 1.6 * start) for n in range(count)]
    for wish in wishes:
        for _ in range(10):
            chosen = [wish]
            for n in range(1, count):
                free = free_acceleration(speeds[n], 20.0, CAR)
                gap = places[n - 1] - places[n] - 4.5
                chosen.append(following_acceleration(speeds[n], free, gap, speeds[n - 1], CAR, CAR.gap))
            for n, a in enumerate(chosen):
                after = min(20.0, max(0.0, speeds[n] + a * DT))
                places[n] += (speeds[n] + after) / 2 * DT
                speeds[n] = after
            assert all(places[n - 1] - places[n] > 4.5 for n in range(1, count))
