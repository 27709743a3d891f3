"""The elementary functions over arrays equal the scalar ones bit for bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir import exact
from recipe_runtime.body import exact_arrays

ANGLES = st.floats(-1e7, 1e7) | st.sampled_from([-0.0, 45.0, -45.0, 90.0, 135.0, 180.0, -270.0, 359.999, 720.0])
NUMBERS = st.floats(-1e12, 1e12) | st.sampled_from([0.0, -0.0, 1.0, -1.0])


def bits(value: float) -> str:
    """Return the exact value and its sign."""
    return value.hex()


@pytest.mark.slow
@given(st.lists(ANGLES, min_size=1, max_size=40))
def test_sines_and_cosines(angles: list[float]) -> None:
    sines, cosines = exact_arrays.sin_cos_deg(np.array(angles))
    for angle, s, c in zip(angles, sines.tolist(), cosines.tolist(), strict=True):
        assert [bits(v) for v in (s, c)] == [bits(v) for v in exact.sin_cos_deg(angle)]


@pytest.mark.slow
@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=40))
def test_arc_tangents(vectors: list[tuple[float, float]]) -> None:
    y, x = np.array(vectors).T
    for (a, b), angle in zip(vectors, exact_arrays.atan2_deg(y, x).tolist(), strict=True):
        assert bits(angle) == bits(exact.atan2_deg(a, b))


def test_sines_and_cosines_are_accurate() -> None:
    angles = np.array([0.37 * k for k in range(-2000, 2000)])
    sines, cosines = exact_arrays.sin_cos_deg(angles)
    assert sines == pytest.approx([math.sin(math.radians(a)) for a in angles], abs=1e-14)
    assert cosines == pytest.approx([math.cos(math.radians(a)) for a in angles], abs=1e-14)
