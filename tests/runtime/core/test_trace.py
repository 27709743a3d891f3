"""The Trace: bytes round-trip, damage is detected, and every number affects its digest."""

import hashlib
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from recipe_runtime.core.trace import METRE, UNIT, Trace


def make_trace(frames: int = 4) -> Trace:
    parts = ("a/base", "a/arm", "b/base")
    positions = np.arange(frames * 9, dtype=np.int64).reshape(frames, 3, 3) * METRE
    rotations = np.zeros((frames, 3, 4), np.int32)
    rotations[..., 3] = UNIT
    velocity = np.arange(frames * 6, dtype=np.int64).reshape(frames, 2, 3)
    return Trace(("a", "b"), parts, positions, rotations, velocity, velocity + 1)


def test_bytes_round_trip() -> None:
    trace = make_trace()
    again = Trace.from_bytes(trace.to_bytes())
    assert again.to_bytes() == trace.to_bytes()
    assert again.digest == trace.digest


@pytest.mark.parametrize("at", [0, 40, -1, -40])
def test_a_flipped_bit_is_detected(at: int) -> None:
    data = bytearray(make_trace().to_bytes())
    data[at] ^= 4
    with pytest.raises(ValueError, match="damaged"):
        Trace.from_bytes(bytes(data))


@pytest.mark.parametrize("field", ["positions", "rotations", "linear", "angular"])
def test_every_array_affects_the_digest(field: str) -> None:
    trace = make_trace()
    array = getattr(trace, field).copy()
    array[3, 0, 1] += 1
    changed = replace(trace, **{field: array})
    assert changed.digest != trace.digest
    (found, expected) = (made.prefix_digests([3, 4]) for made in (changed, trace))
    assert found["a"][1] != expected["a"][1]
    assert found["a"][0] == expected["a"][0]
    assert found["b"] == expected["b"]


def test_a_long_header_is_refused_before_it_is_parsed() -> None:
    """The file is untrusted: parsing a line of 1 GiB would create objects of 27 GiB."""
    body = b'{"format":"recipe/trace/1","x":[' + b"[]," * (3 << 20) + b"[]]}\n"
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="header is over 8,388,608 bytes"):
            Trace.from_bytes(body + hashlib.sha256(body).digest())
        assert tracemalloc.get_traced_memory()[1] < 4 * len(body)
    finally:
        tracemalloc.stop()


def test_an_actor_lists_its_parts() -> None:
    assert make_trace().actor_parts("a") == [0, 1]
    assert make_trace().base_part("b") == 2
