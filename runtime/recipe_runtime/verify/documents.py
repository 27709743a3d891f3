"""The fields in which two JSON documents differ."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

from recipe_compiler.ir.plurals import count


def walk(ours: object, theirs: object, path: str) -> Iterator[str]:
    """Yield the fields in which two documents differ, with both values.

    Named items of lists are matched by name; another order of them is a difference, too.
    """
    if isinstance(ours, Mapping) and isinstance(theirs, Mapping):
        for key in [*ours, *(key for key in theirs if key not in ours)]:
            yield from _pair(ours, theirs, key, f"{path}.{key}")
    elif isinstance(ours, list) and isinstance(theirs, list):
        first, second = (
            {str(item["name"]): item for item in side if isinstance(item, Mapping) and "name" in item}
            for side in (ours, theirs)
        )
        if (len(first), len(second)) == (len(ours), len(theirs)):
            for key in [*first, *(key for key in second if key not in first)]:
                yield from _pair(first, second, key, f"{path}[{key}]")
            if [key for key in first if key in second] != [key for key in second if key in first]:
                yield f"{path}: the entries are in another order"
        elif len(ours) != len(theirs):
            yield f"{path} has {count(len(ours), 'entry', 'entries')} and {len(theirs):,}"
        else:
            for number, pair in enumerate(zip(ours, theirs, strict=True)):
                yield from walk(*pair, f"{path}[{number}]")
    elif ours != theirs:
        yield f"{path}: {_short(ours)} and {_short(theirs)}"


def _pair(ours: Mapping[str, object], theirs: Mapping[str, object], key: str, path: str) -> Iterator[str]:
    if key not in ours or key not in theirs:
        yield f"{path} is in the {'first' if key in ours else 'second'} only"
    elif ours[key] != theirs[key]:
        yield from walk(ours[key], theirs[key], path)


def _short(value: object) -> str:
    """Return a value in the notation of a recipe, shortened."""
    text = value if isinstance(value, str) else "nothing" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."
