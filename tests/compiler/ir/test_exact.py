"""exact.py is accurate (compared with libm), and its bits are pinned (by digests of many values)."""

import hashlib
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir import exact

ANGLES = st.floats(-1e4, 1e4)


@given(ANGLES)
def test_sine_and_cosine_agree_with_libm(angle: float) -> None:
    turned = math.radians(math.fmod(angle, 360.0))
    assert exact.sin_deg(angle) == pytest.approx(math.sin(turned), abs=2e-15)
    assert exact.cos_deg(angle) == pytest.approx(math.cos(turned), abs=2e-15)


# Without -0.0, which libm distinguishes at the branch cut and plans cannot represent.
SIDES = st.floats(-1e3, 1e3).map(lambda value: value + 0.0)


@given(SIDES, SIDES)
def test_arc_tangent_agrees_with_libm(y: float, x: float) -> None:
    assert exact.atan2_deg(y, x) == pytest.approx(math.degrees(math.atan2(y, x)) if (x, y) != (0, 0) else 0, abs=1e-12)


@given(st.floats(-600, 600))
def test_exponential_agrees_with_libm(x: float) -> None:
    assert exact.exp(x) == pytest.approx(math.exp(x), rel=1e-15)


@given(st.floats(1e-300, 1e300))
def test_logarithm_agrees_with_libm(x: float) -> None:
    assert exact.log(x) == pytest.approx(math.log(x), rel=1e-14, abs=1e-15)


def test_right_angles_are_exact() -> None:
    assert [exact.sin_deg(a) for a in (0, 90, 180, 270, 360, -90)] == [0, 1, 0, -1, 0, -1]
    assert [exact.cos_deg(a) for a in (0, 90, 180, 270, 360, -90)] == [1, 0, -1, 0, 1, 0]


@pytest.mark.parametrize("x", [0.0, -1.0])
def test_the_logarithm_of_other_values_is_an_error(x: float) -> None:
    with pytest.raises(ValueError, match="not positive"):
        exact.log(x)


def test_bits_are_the_same_everywhere() -> None:
    """The digest was computed on one machine; a difference of one bit on another fails."""
    hasher = hashlib.sha256()
    for i in range(2000):
        a = (i - 1000) * 0.7310585
        hasher.update(
            struct.pack("<5d", *exact.sin_cos_deg(a), exact.atan2_deg(a, 13.7), exact.exp(a / 2), exact.log(i + 0.3))
        )
    assert hasher.hexdigest() == "3b6c49ea792c33c0cbe26d9ada4795875755bdb642717e8650f457b42106df6f"
