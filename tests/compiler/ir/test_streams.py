"""Streams depend only on their key, have the right statistics, and never change."""

import hashlib
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.streams import Stream


def test_draws_are_pinned() -> None:
    stream = Stream(30, "hero1", "blueprint")
    assert [stream.bits(), stream.integer(1, 6), stream.choice("abcdef")] == [14034718017890629624, 2, "f"]
    assert stream.uniform(-1, 1) == -0.8040445951938036
    assert stream.normal(1.4, 0.2) == 1.3555796181033701


def test_distributions_have_their_moments() -> None:
    stream = Stream(7, "moments")
    normal = [stream.normal(2.0, 3.0) for _ in range(4000)]
    mean = sum(normal) / len(normal)
    assert abs(mean - 2.0) < 0.2
    assert abs(sum((x - mean) ** 2 for x in normal) / len(normal) - 9.0) < 0.6
    counts = [0] * 6
    for _ in range(6000):
        counts[stream.integer(0, 5)] += 1
    assert min(counts) > 850


def test_the_normal_quantile_is_monotonic_over_its_three_ranges() -> None:
    from recipe_compiler.ir.streams import normal_quantile

    points = [10.0**-k for k in range(15, 1, -1)] + [0.02 * k for k in range(1, 50)]
    values = [normal_quantile(p) for p in points]
    assert all(a < b for a, b in pairwise(values))
    assert abs(normal_quantile(0.975) - 1.959963984540054) < 1e-14


@given(st.integers(0, 2**32 - 1), st.lists(st.text(max_size=6), max_size=3))
def test_a_key_is_canonical_bytes(seed: int, names: list[str]) -> None:
    key = hashlib.sha256(b"recipe/stream/1\n" + canonical_bytes([seed, *names]) + b"\n0").digest()
    assert Stream(seed, *names).bits() == int.from_bytes(key[:8], "little")
