"""JSON of tables: a row a line, keys sorted, so that a diff reads well and the bytes are always the same."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def tables(sections: Mapping[str, Any]) -> str:
    """A JSON object: sections in the given order, each list with a row a line. ValueError for NaN and infinities."""
    parts = []
    for name, value in sections.items():
        if isinstance(value, list) and value:
            body = "[\n" + ",\n".join(_row(row) for row in value) + "\n]"
        else:
            body = _row(value)
        parts.append(f"{json.dumps(name)}: {body}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _row(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
