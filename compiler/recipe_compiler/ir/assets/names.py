"""Names of materials as slots of a look: a stranger's text becomes a name that a recipe can write, or a number."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from typing import Any

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}\Z")


def slot(name: Any, otherwise: str) -> str:
    """The name with `_` for blanks, if it is one that a recipe can write."""
    text = name.replace(" ", "_") if isinstance(name, str) else ""
    return text if _NAME.match(text) else otherwise


def slot_names(names: Sequence[Any]) -> list[str]:
    """A slot for each material, no two alike: its own name; `material.N` where that is unfit or taken."""
    taken: dict[str, None] = {}
    spare = itertools.count(len(names))
    for number, name in enumerate(names):
        found = slot(name, f"material.{number}")
        if found in taken:
            found = f"material.{number}"
        while found in taken:
            found = f"material.{next(spare)}"
        taken[found] = None
    return list(taken)
