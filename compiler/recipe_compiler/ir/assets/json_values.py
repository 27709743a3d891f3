"""Values of an untrusted JSON document, by their type. TypeError if a value has another type."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from recipe_compiler.ir.assets.geometry import AssetError

JsonObject = Mapping[str, object]


def as_object(value: object) -> JsonObject:
    """Return a value that is an object."""
    if not isinstance(value, dict):
        raise TypeError(f"{type(value).__name__} in place of an object")
    return value


def as_list(value: object) -> Sequence[object]:
    """Return a value that is a list."""
    if not isinstance(value, list):
        raise TypeError(f"{type(value).__name__} in place of a list")
    return value


def as_number(value: object) -> float:
    """Return a value that is a number."""
    if not isinstance(value, int | float):
        raise TypeError(f"{type(value).__name__} in place of a number")
    return float(value)


def as_whole(value: object) -> int:
    """Return a value that is a count or an offset; AssetError for any other."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 40:
        raise AssetError("a count or an offset is invalid; export it again")
    return value
