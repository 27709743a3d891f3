"""JSON tables with one row per line and sorted keys: readable in a diff, and equal bytes for equal values."""

from __future__ import annotations

import json
from collections.abc import Mapping


def tables(sections: Mapping[str, object]) -> str:
    """Return a JSON object with the sections in the given order and each list with one row per line.

    Raises:
        ValueError: A number is NaN or infinite.
    """
    parts = []
    for name, value in sections.items():
        if isinstance(value, list) and value:
            body = "[\n" + ",\n".join(_row(row) for row in value) + "\n]"
        else:
            body = _row(value)
        parts.append(f"{json.dumps(name)}: {body}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _row(value: object) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
