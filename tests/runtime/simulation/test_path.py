"""Paths: positions along a line, bends, and interpolation without overshoot."""

from __future__ import annotations

import pytest
from recipe_runtime.meshes.curves import quarter, smooth, straight
from recipe_runtime.simulation.path import Path

CORNER = ((0.0, 0.0), (10.0, 0.0), (10.0, 0.0), (10.0, 10.0))


def test_distance_is_measured_from_the_start() -> None:
    way = Path(CORNER)
    assert way.at(4.0) == (4.0, 0.0)
    assert way.at(13.0) == (10.0, 3.0)
    assert (way.at(-2.0), way.at(25.0)) == ((-2.0, 0.0), (10.0, 15.0))  # paths continue straight beyond their ends


def test_a_path_is_followed_forwards_only() -> None:
    way = Path(CORNER)
    assert way.locate(3.0, 2.0) == (3.0, 2.0, 0)
    assert way.locate(10.0, 6.0) == (16.0, 0.0, 1)
    assert way.locate(3.0, 0.0, leg=1) == (10.0, 7.0, 1)  # the first segment lies behind


def test_a_bend_has_a_side() -> None:
    to_the_left = Path(CORNER).curvature(10.0)
    to_the_right = Path([(x, -y) for x, y in CORNER]).curvature(10.0)
    assert to_the_left == -to_the_right > 0.1
    assert (Path(CORNER).curvature(5.0), Path(CORNER).left(5.0)) == (0.0, (0.0, 1.0))
    assert Path(CORNER).next_bend(2.0, 12.0) == Path(CORNER).curvature(9.0) > 0.0
    assert (Path(CORNER).next_bend(2.0, 8.0), Path(CORNER).next_bend(12.0, 20.0)) == (0.0, 0.0)


def test_a_path_can_have_length_0() -> None:
    way = Path([(1.0, 2.0), (1.0, 2.0)])
    assert (way.locate(5.0, 5.0), way.at(3.0)) == ((0.0, 0.0, 0), (1.0, 2.0))
    assert (way.curvature(0.0), way.next_bend(-5.0, 5.0)) == (0.0, 0.0)


def test_interpolation_passes_its_points_and_never_overshoots() -> None:
    curve = ((0.0, 0.0), (0.2, 1.0), (0.3, 1.0), (0.9, 0.4), (1.0, 0.5))
    assert [smooth(curve, u) for u, _ in curve] == pytest.approx([v for _, v in curve])
    values = [smooth(curve, k / 200) for k in range(-20, 221)]
    assert min(values) >= 0.0 and max(values) <= 1.0
    assert [smooth(curve, 0.2 + k / 100) for k in range(10)] == pytest.approx([1.0] * 10)
    assert straight(curve, 0.1) == 0.5
    assert (quarter(-1.0), quarter(0.0), quarter(1.0), quarter(3.0)) == (0.0, 0.0, 1.0, 1.0)
