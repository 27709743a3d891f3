"""Explains paths that lead to no recipe: a misspelt name, a folder, and files of other kinds."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.source.similar_names import similar_names
from recipe_compiler.source.yaml_reader import MAX_BYTES, printable, show

_MAX_NAMES = 2000  # number of a folder's entries with which a misspelt name is compared
_MAX_READ = 40  # number of a folder's files that are read to find recipes
_MAX_LISTED = 3
_RECIPE = re.compile(rb"^(?:recipe|extends)\s*:", re.MULTILINE)
_KINDS = {  # first bytes of a file -> what it is, and what to name instead
    b"recipe-lock ": ("a lockfile", "name its recipe"),
    b"PK\x03\x04": (
        "a pack or another archive",
        "`recipe check`, `plan`, `shot`, `build`, `verify` and `diff` take packs, all others the recipe in it",
    ),
    b"\x89PNG": ("a picture", "name a recipe file, such as NAME.yaml"),
    b"\xff\xd8\xff": ("a picture", "name a recipe file, such as NAME.yaml"),
}


def nearest_file(path: Path, besides: Collection[Path] = ()) -> str | None:
    """Return a remedy for a path that does not exist: a file with a similar name in its folder; None without one.

    Args:
        path: the path.
        besides: files that are not meant.
    """
    names = [entry.name for entry in _entries(path.parent) if entry.is_file() and entry not in besides]
    recipes = [name for name in names if name in (f"{path.name}.yaml", f"{path.name}.yml")]
    if recipes:
        return f"did you mean {show(recipes[0])}?"
    alike = [name for name in names if Path(name).suffix == path.suffix or Path(name).stem == path.stem]
    close = similar_names(path.name, alike, 1, 0.75)
    return f"did you mean {show(close[0])}?" if close else None


def recipe_of_folder(folder: Path) -> str:
    """A remedy for a folder where a recipe is wanted: the recipe of its name, of its dataset, or those in it."""
    beside = [folder.with_name(f"{folder.name}{suffix}") for suffix in (".yaml", ".yml") if folder.name]
    named = [path for path in beside if path.is_file()]
    found = named or _recipes_in(folder / "recipe") or _recipes_in(folder)
    if not found:
        return "name a recipe file, such as NAME.yaml"
    if len(found) == 1:
        return f"did you mean {_quoted(found[0])}?"
    more = " and others" if len(found) > _MAX_LISTED else ""
    return f"name a recipe in it: {', '.join(map(_quoted, found[:_MAX_LISTED]))}{more}"


def other_kind(content: bytes) -> tuple[str, str] | None:
    """What a file is instead of a recipe, by its first bytes, and the remedy; None if it may be a recipe."""
    return next((words for head, words in _KINDS.items() if content.startswith(head)), None)


def _recipes_in(folder: Path) -> list[Path]:
    files = [entry for entry in _entries(folder) if entry.suffix in (".yaml", ".yml")]
    return [path for path in files[:_MAX_READ] if _is_recipe(path)]


def _is_recipe(path: Path) -> bool:
    try:
        return _RECIPE.search(read_regular(path, MAX_BYTES)) is not None
    except (OSError, ValueError):
        return False


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())[:_MAX_NAMES]
    except (OSError, ValueError):
        return []


def _quoted(path: Path) -> str:
    return f'"{printable(str(path))}"'
