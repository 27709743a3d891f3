"""Canonical bytes: equal values have equal bytes, and values without a canonical form are refused."""

import numpy as np
import pytest
import rfc8785
from hypothesis import example, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.canonical import JsonValue, canonical_bytes, digest, digest_array, pretty
from recipe_compiler.ir.plan import TownPlan

JSON: st.SearchStrategy[JsonValue] = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53) + 1, 2**53 - 1) | st.text(max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=12,
)


@pytest.mark.slow
@given(JSON)
def test_formatted_text_has_the_same_value(value: JsonValue) -> None:
    import json

    assert canonical_bytes(json.loads(pretty(value))) == canonical_bytes(value)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -0.0, {"a": [1, float("-inf")]}, {1: 2}, {"a": object()}])
def test_a_value_without_a_canonical_form_is_refused(bad: JsonValue) -> None:
    with pytest.raises(ValueError, match="no canonical form"):
        canonical_bytes(bad)


FLOATS = st.floats(allow_nan=False, allow_infinity=False).map(lambda x: x + 0.0)


@pytest.mark.slow
@settings(max_examples=50)
@given(st.recursive(JSON | FLOATS, st.lists, max_leaves=12))
def test_the_fast_encoder_follows_rfc_8785(value: JsonValue) -> None:
    assert canonical_bytes(value) == rfc8785.dumps(value)  # type: ignore[arg-type]  # a recursive type


@pytest.mark.slow
@given(st.lists(FLOATS | st.floats(-1e17, 1e17).map(lambda x: x + 0.0), min_size=1, max_size=20))
@example([1e16, 1e15, 9999999999999998.0, 1e-4, 9.999999999999999e-05, 123456789.0, 0.1, 0.0])
def test_numbers_of_any_size_follow_rfc_8785(values: list[float]) -> None:
    """With and without an exponent, on both sides of the limits at which Python uses one."""
    for value in (*values, *(-v for v in values if v)):
        assert canonical_bytes(value) == rfc8785.dumps(value)


def test_keys_are_sorted_by_utf_16_and_types_are_distinguished() -> None:
    numbers = [1, 1.0, True, None, 1e21, 1e-7, "\u007f\n\x1f"]
    value: dict[str, list[float | str | None] | float] = {"\U00010000": numbers, "\ue000": 0, "a": 0.0}
    assert canonical_bytes(value) == rfc8785.dumps(value)
    with pytest.raises(ValueError, match=r"-0\.0"):
        canonical_bytes([0.0, -0.0])  # equal to the earlier value in Python, but refused
    with pytest.raises(ValueError):
        canonical_bytes([2**53])


def test_digests_of_different_domains_differ() -> None:
    assert digest("plan/scene/1", {}) != digest("plan/rig/1", {})


def test_the_digest_of_an_array_covers_dtype_shape_and_bytes() -> None:
    array = np.arange(6, dtype=np.uint16)
    assert digest_array("a", array) == digest_array("a", array.astype(">u2"))
    assert digest_array("a", array) == digest_array("a", np.arange(12, dtype=np.uint16)[::1][:6])
    assert digest_array("a", array) != digest_array("a", array.reshape(2, 3))
    assert digest_array("a", array) != digest_array("a", array.astype(np.uint8))
    assert digest_array("a", array) != digest_array("b", array)


def test_a_copy_of_a_plan_has_a_digest_of_its_own() -> None:
    """Regression: pydantic copies cached properties, so a changed copy had the digest of the original."""
    town = TownPlan(name="plain", elements=())
    before = town.digest
    assert town.model_copy(update={"name": "other"}).digest == TownPlan(name="other", elements=()).digest != before
    assert town.model_copy().digest == before
