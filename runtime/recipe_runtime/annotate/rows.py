"""JSON tables with one row per line and sorted keys: readable in a diff, and equal bytes for equal values."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping


def tables(sections: Mapping[str, object]) -> Iterator[str]:
    """Yield the text of a JSON object with the sections in the given order; lists and iterators have one row per line.

    Raises:
        ValueError: A number is NaN or infinite.
    """
    yield "{\n"
    for number, (name, value) in enumerate(sections.items()):
        yield (",\n" if number else "") + f"{json.dumps(name)}: "
        if isinstance(value, (list, Iterator)):
            empty = True
            for row in value:
                yield ("[\n" if empty else ",\n") + _row(row)
                empty = False
            yield "[]" if empty else "\n]"
        else:
            yield _row(value)
    yield "\n}\n"


def _row(value: object) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
