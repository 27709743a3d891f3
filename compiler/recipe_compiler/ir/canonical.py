"""Canonical bytes and the digests over them.

A digest is SHA-256 over a domain line, so that two kinds of thing never share one, and canonical bytes: RFC 8785
JSON for documents; for arrays a header line and little-endian C-order bytes. NaN, infinities and -0 are refused,
so that equal values have equal bytes.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from json.encoder import encode_basestring
from typing import TYPE_CHECKING, TypeAlias

import rfc8785

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_quoted: Callable[[str], str] = encode_basestring
_plain = json.JSONEncoder(ensure_ascii=False).encode

JsonValue: TypeAlias = bool | int | float | str | Sequence[object] | Mapping[str, object] | None
"""A value with a JSON form. Sequences are lists or tuples, mappings are dicts, and their items are such values too."""


def canonical_bytes(value: JsonValue) -> bytes:
    """Return the RFC 8785 bytes of a JSON value.

    Raises:
        ValueError: the value or a part of it has no canonical form: NaN, infinity, -0.0, or no JSON type.
    """
    try:
        return _text(value).encode()
    except (TypeError, ValueError) as error:
        raise ValueError(f"no canonical form: {error}") from None


def _text(value: object) -> str:
    """Return the text of `rfc8785.dumps`, many times as fast for the colours of a town or the boxes of a frame."""
    kind = type(value)
    if kind is float:
        return _float_text(value)  # type: ignore[arg-type]  # mypy does not narrow by `kind`
    if kind is str:
        return _quoted(value)  # type: ignore[arg-type]
    if isinstance(value, dict):
        by_name = sorted(value.items(), key=None if all(map(str.isascii, value)) else _utf_16)
        return "{" + ",".join([f"{_quoted(key)}:{_text(item)}" for key, item in by_name]) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join([_text(item) for item in value]) + "]"
    return _float_text(value) if isinstance(value, float) else _scalar(value)


def _float_text(value: float) -> str:
    """Return the shortest digits, without an exponent where Python and RFC 8785 both write none."""
    if 1e-4 <= abs(value) < 1e16:
        return float.__repr__(value).removesuffix(".0")
    if value == 0.0 and math.copysign(1.0, value) < 0:
        raise ValueError("-0.0")
    return _scalar(value)


def _utf_16(entry: tuple[str, object]) -> bytes:
    return entry[0].encode("utf-16-be")


@lru_cache(maxsize=1 << 14, typed=True)
def _scalar(value: object) -> str:
    return rfc8785.dumps(value).decode()  # type: ignore[arg-type]  # it refuses what it cannot write


def digest(domain: str, value: JsonValue) -> str:
    """SHA-256, in hex, of a JSON value within a domain such as `plan/scene/1`."""
    return digest_bytes(domain, canonical_bytes(value))


def digest_chunks(domain: str, chunks: Iterable[bytes | memoryview]) -> str:
    """SHA-256, in hex, of bytes within a domain, given in pieces of any size."""
    hasher = hashlib.sha256(f"recipe/{domain}\n".encode())
    for chunk in chunks:
        hasher.update(chunk)
    return hasher.hexdigest()


def digest_bytes(domain: str, *chunks: bytes | memoryview) -> str:
    """SHA-256, in hex, of bytes within a domain."""
    return digest_chunks(domain, chunks)


def digest_array(domain: str, array: NDArray[np.generic]) -> str:
    """SHA-256, in hex, of an array: its dtype and shape, then its little-endian C-order bytes."""
    import numpy as np

    plain = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    hasher = array_hasher(domain, plain.dtype, plain.shape)
    hasher.update(plain.data.cast("B") if plain.size else b"")
    return hasher.hexdigest()


def array_hasher(domain: str, kind: np.dtype[np.generic], shape: tuple[int, ...]) -> hashlib._Hash:
    """A hasher for an array of this dtype and shape, to be updated with its bytes in pieces of any size."""
    header = json.dumps([kind.str.replace("=", "<"), list(shape)], separators=(",", ":"))
    hasher = hashlib.sha256(f"recipe/{domain}\n".encode())
    hasher.update(header.encode() + b"\n")
    return hasher


def pretty(value: JsonValue) -> str:
    """Format a JSON value for review in diffs: sorted keys, short lists on one line."""
    canonical_bytes(value)  # raises ValueError for a value without a canonical form
    return _pretty(value, 0) + "\n"


def _pretty(value: object, indent: int) -> str:
    """Format a value; it stands on one line if that and the indentation have no more than 110 characters.

    A list or dict that fits on one line has parts that fit on one line too, so the parts are formatted first.
    """
    if not isinstance(value, dict | list | tuple) or not value:
        return _plain(value)
    if isinstance(value, dict):
        begin, finish = "{", "}"
        rows = [f"{_quoted(key)}: {_pretty(item, indent + 2)}" for key, item in sorted(value.items())]
    else:
        begin, finish = "[", "]"
        rows = [_pretty(item, indent + 2) for item in value]
    flat = sum(map(len, rows)) + 2 * len(rows) + indent <= 110 and not any("\n" in row for row in rows)
    if flat:
        return begin + ", ".join(rows) + finish
    pad = " " * (indent + 2)
    return f"{begin}\n{pad}" + f",\n{pad}".join(rows) + f"\n{' ' * indent}{finish}"
