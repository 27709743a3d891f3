"""Slot names of materials: the material's own name if a recipe can write it, otherwise a numbered name."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}\Z")


def slot(name: object, otherwise: str) -> str:
    """Return the name with `_` for blanks, if a recipe can write it, else `otherwise`."""
    text = name.replace(" ", "_") if isinstance(name, str) else ""
    return text if _NAME.match(text) else otherwise


def slot_names(names: Sequence[object]) -> list[str]:
    """Return a distinct slot for each material: its own name, or `material.N` if that is invalid or taken."""
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
