"""Lateral motion: quintics against a linear solver and finite differences, and changes that are revised."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.library import blueprints
from recipe_runtime.simulation.traffic.lateral import Lateral, Quintic

LANE, DT = 3.6, 1.0 / 30.0
offsets, durations = st.floats(-6.0, 6.0), st.floats(1.0, 10.0)
states = st.tuples(offsets, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))


def _shape(glob: str) -> dict[str, float]:
    return dict(blueprints.match(glob)[0].shape)


def _run(lateral: Lateral, seconds: float, speed: float) -> list[float]:
    lines = []
    for _ in range(round(seconds / DT)):
        lateral.advance(speed, DT)
        lines.append(lateral.line)
    return lines


@given(start=offsets, target=offsets, duration=durations)
def test_a_change_between_states_of_rest(start: float, target: float, duration: float) -> None:
    """Its ends are at rest without acceleration, it never goes back, and its peak is 10 / sqrt(3) d / T^2."""
    curve, way = Quintic.to_rest((start, 0.0, 0.0), target, duration), target - start
    assert curve.at(0.0) == pytest.approx((start, 0.0, 0.0), abs=1e-9)
    assert curve.at(duration) == pytest.approx((target, 0.0, 0.0), abs=1e-9)
    assert curve.at(2.0 * duration) == curve.at(duration)
    samples = np.array([curve.at(duration * k / 300.0) for k in range(301)])
    assert (np.diff(samples[:, 0]) * np.sign(way) >= -1e-9).all()
    assert np.abs(samples[:, 1]).max() == pytest.approx(1.875 * abs(way) / duration, rel=1e-3, abs=1e-9)
    assert np.abs(samples[:, 2]).max() == pytest.approx(10 / math.sqrt(3) * abs(way) / duration**2, rel=1e-3, abs=1e-9)


@given(state=states, target=offsets, duration=durations)
@settings(max_examples=50)
def test_a_change_from_any_state_solves_its_six_conditions(
    state: tuple[float, float, float], target: float, duration: float
) -> None:
    t = duration
    conditions = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 2, 0, 0, 0], [t**k for k in range(6)],
                  [0, *(k * t ** (k - 1) for k in range(1, 6))],
                  [0, 0, *(k * (k - 1) * t ** (k - 2) for k in range(2, 6))]]  # fmt: skip
    solved = np.linalg.solve(np.array(conditions, float), np.array([*state, target, 0.0, 0.0]))
    curve = Quintic.to_rest(state, target, duration)
    for seconds in np.linspace(0.0, duration, 9):
        polynomial = np.polynomial.Polynomial(solved)
        expected = [polynomial.deriv(n)(seconds) if n else polynomial(seconds) for n in range(3)]
        assert curve.at(float(seconds)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("glob", "least", "most"),
    [("vehicle.motorcycle.a", 4.0, 4.5), ("vehicle.sedan.a", 4.4, 5.0), ("vehicle.bus.city", 5.5, 6.0)],
)
def test_the_duration_of_a_lane_change_depends_on_the_kind_of_vehicle(glob: str, least: float, most: float) -> None:
    lateral = Lateral(_shape(glob), 0.0, street=False)
    lateral.move_to(LANE)
    lines = _run(lateral, 8.0, 25.0)
    acceleration = np.abs(np.diff(lines, 2)).max() / DT**2
    assert least < (lines.index(LANE) + 1) * DT < most
    assert 0.5 < acceleration < 1.5
    assert lateral.slope == 0.0


def test_a_slow_vehicle_needs_distance_instead_of_time() -> None:
    """Below some speed the curve in space is the same, which a steering lock of 0.27 1/m permits; at rest it stops."""
    curves = []
    for speed in (0.5, 1.0, 2.0):
        lateral = Lateral(_shape("vehicle.bus.city"), 0.0, street=True)
        lateral.move_to(2.7)
        assert _run(lateral, 2.0, 0.0) == [0.0] * 60
        curves.append([_run(lateral, 1.0 / speed, speed)[-1] for _ in range(14)])  # at each metre
        assert curves[-1][-1] == 2.7
    assert curves[0] == pytest.approx(curves[1], abs=1e-6) and curves[1] == pytest.approx(curves[2], abs=1e-6)
    assert np.abs(np.diff(curves[0], 2)).max() < 0.14  # 1/m


@given(
    revisions=st.lists(st.tuples(st.sampled_from([0.0, LANE, -LANE]), st.floats(0.1, 6.0)), min_size=2, max_size=6),
    glob=st.sampled_from(["vehicle.sedan.a", "vehicle.truck.box", "vehicle.motorcycle.a"]),
)
@settings(max_examples=60, deadline=None)
def test_a_revised_change_stays_smooth(revisions: list[tuple[float, float]], glob: str) -> None:
    """Its acceleration by finite differences is bounded, and it overshoots by less than the width of a lane."""
    lateral = Lateral(_shape(glob), 0.0, street=False)
    lines = [0.0, 0.0]
    for target, seconds in revisions:
        lateral.move_to(target)
        lines += _run(lateral, seconds, 25.0)
    lines += _run(lateral, 30.0, 25.0)
    assert lines[-1] == revisions[-1][0]
    assert np.abs(np.diff(lines, 2)).max() / DT**2 < 2.0
    assert np.abs(lines).max() < 2.0 * LANE
    for metres in (0.0, 3.0):
        assert lateral.ahead(metres, 25.0) == lateral.target


def test_an_aborted_change_returns_without_a_jump() -> None:
    lateral = Lateral(_shape("vehicle.sedan.a"), 0.0, street=False)
    lateral.move_to(LANE)
    begun = _run(lateral, 1.3, 25.0)
    assert 0.3 < begun[-1] < 0.9
    lateral.move_to(0.0)
    back = _run(lateral, 8.0, 25.0)
    assert max(back) < 1.3 and min(back) >= -1e-9 and back[-1] == 0.0
    assert np.abs(np.diff([*begun, *back], 2)).max() / DT**2 < 1.8


def test_a_plan_for_another_target_changes_nothing() -> None:
    lateral = Lateral(_shape("vehicle.sedan.a"), 0.0, street=True)
    lateral.move_to(LANE)
    _run(lateral, 1.0, 10.0)
    before = lateral.line, lateral.slope, lateral.target, lateral.ahead(5.0, 10.0)
    plan = lateral.plan(0.0)
    assert plan.target == 0.0 and plan.ahead(0.0, 10.0) == pytest.approx(lateral.line)
    assert (lateral.line, lateral.slope, lateral.target, lateral.ahead(5.0, 10.0)) == before
    assert lateral.plan(LANE) is lateral
