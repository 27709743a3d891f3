"""The streaming reader returns the values of `json`, and raises ValueError for invalid documents."""

from __future__ import annotations

import io
import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_runtime.dataset import json_stream
from recipe_runtime.dataset.json_stream import JsonStream

LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
VALUES = st.recursive(LEAVES, lambda v: st.lists(v, max_size=3) | st.dictionaries(st.text(), v, max_size=3))


class Trickle(io.BytesIO):
    """A file that returns a few bytes per read, so that chunks end within numbers, strings and characters."""

    def read(self, size: int | None = -1) -> bytes:
        return super().read(3)


def read(body: bytes) -> Any:
    stream = JsonStream(Trickle(body), len(body))
    found = {key: stream.value() if key != "list" else list(stream.items()) for key in stream.members()}
    stream.end()
    return found


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(st.dictionaries(st.text().filter(lambda key: key != "list"), VALUES), st.lists(VALUES), st.booleans())
def test_chunks_give_the_same_values_as_json(document: dict[str, Any], items: list[Any], indented: bool) -> None:
    document["list"] = items
    body = json.dumps(document, ensure_ascii=indented, indent=2 if indented else None).encode()
    assert read(body) == document
    assert json_stream.loads(body, 10_000) == document


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(
    st.binary(max_size=60) | st.text(alphabet='{}[]":,0e-tru\\ u', max_size=60).map(str.encode), st.binary(max_size=3)
)
def test_any_bytes_are_refused_with_a_value_error(body: bytes, more: bytes) -> None:
    for whole in (body, b'{"list": [' + body, b'{"a": ' + body + b"}" + more):
        try:
            found = read(whole)
        except ValueError:
            continue
        assert found == json.loads(whole, object_pairs_hook=dict) or found


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b'{"a": 1',
        b'{"a": 1]',
        b'{"a" 1}',
        b'{"a": 1,}',
        b'{"a": NaN}',
        b'{"a": {"b": 1, "b": 2}}',
        b'{"a": 1} x',
        b'{"list": [1 2]}',
        b'{"a": "\xff"}',
        b'{"a": ' + b"[" * 100_000,
        b'{"a": ' + b"9" * 10_000 + b"}",
        b'{"a": "' + b"a" * 20_000 + b'"}',
        b'{"a": [' + b"1," * 20_000 + b"1]}",
        b'{"a": ' + b"1" * 20_000,
        b" " * 10,
    ],
    ids=lambda body: body[:20],
)
def test_a_broken_or_long_document_is_refused(body: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        read(body)


def test_an_endless_file_is_read_up_to_the_limit() -> None:
    class Spaces(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            return b" " * (size or 0)

    with pytest.raises(ValueError, match="it is too large"):
        next(JsonStream(Spaces(), 10_000_000).members())


def test_values_are_counted_before_they_are_created() -> None:
    with pytest.raises(ValueError, match="more than 1,000 values"):
        json_stream.loads(b"[" + b"0," * 1_000 + b"0]", 1_000)
