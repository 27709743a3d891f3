"""Canonical bytes: equal values, equal bytes; and nothing without a canonical form gets through."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.canonical import canonical_bytes, digest, digest_array, pretty

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53) + 1, 2**53 - 1) | st.text(max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=12,
)


@given(st.dictionaries(st.text(max_size=4), JSON, max_size=4))
def test_key_order_does_not_matter(value: dict[str, object]) -> None:
    assert canonical_bytes(value) == canonical_bytes(dict(reversed(value.items())))


@given(JSON, JSON)
def test_different_values_have_different_digests(one: object, other: object) -> None:
    assert (digest("d", one) == digest("d", other)) == (canonical_bytes(one) == canonical_bytes(other))


@given(JSON)
def test_pretty_text_holds_the_same_value(value: object) -> None:
    import json

    assert canonical_bytes(json.loads(pretty(value))) == canonical_bytes(value)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -0.0, {"a": [1, float("-inf")]}, {1: 2}, {"a": object()}])
def test_what_has_no_canonical_form_is_refused(bad: object) -> None:
    with pytest.raises(ValueError, match=r"\$"):
        canonical_bytes(bad)


def test_domains_keep_digests_apart() -> None:
    assert digest("plan/scene/1", {}) != digest("plan/rig/1", {})


def test_an_array_is_its_dtype_shape_and_bytes() -> None:
    array = np.arange(6, dtype=np.uint16)
    assert digest_array("a", array) == digest_array("a", array.astype(">u2"))
    assert digest_array("a", array) == digest_array("a", np.arange(12, dtype=np.uint16)[::1][:6])
    assert digest_array("a", array) != digest_array("a", array.reshape(2, 3))
    assert digest_array("a", array) != digest_array("a", array.astype(np.uint8))
    assert digest_array("a", array) != digest_array("b", array)
