"""Explains paths that lead to no recipe: a misspelt name, a folder, and files of other kinds."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from recipe_compiler.source.similar_names import similar_names
from recipe_compiler.source.yaml_reader import printable, show

SUFFIXES = (".yaml", ".yml", ".recipe")
_MAX_NAMES = 2000  # number of a folder's entries with which a misspelt name is compared
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
    found = nearest_entry(path, [entry for entry in _entries(path.parent) if entry.is_file() and entry not in besides])
    return f"did you mean {show(found.name)}?" if found else None


def nearest_entry(path: Path, entries: Collection[Path] | None = None) -> Path | None:
    """Return the entry of its folder of which a missing path is probably a misspelling; None if there is none.

    Args:
        path: the path.
        entries: the entries that can be meant; None: all files and folders.
    """
    present = _entries(path.parent) if entries is None else entries
    by_name = {entry.name: entry for entry in present}
    named = [f"{path.name}{suffix}" for suffix in SUFFIXES if f"{path.name}{suffix}" in by_name]
    alike = [name for name in by_name if Path(name).suffix == path.suffix or Path(name).stem == path.stem]
    close = named or similar_names(path.name, alike, 1, 0.7)
    return by_name[close[0]] if close else None


def recipe_of_folder(folder: Path) -> str:
    """A remedy for a folder where a recipe is wanted: the recipe of its name, or one in it."""
    beside = [folder.with_name(f"{folder.name}{suffix}") for suffix in SUFFIXES if folder.name]
    found = [path for path in beside if path.is_file()] or [p for p in _entries(folder) if p.suffix in SUFFIXES]
    if not found:
        return "name a recipe file, such as NAME.yaml"
    return f'did you mean "{printable(str(found[0]))}"?'


def other_kind(content: bytes) -> tuple[str, str] | None:
    """What a file is instead of a recipe, by its first bytes, and the remedy; None if it may be a recipe."""
    return next((words for head, words in _KINDS.items() if content.startswith(head)), None)


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())[:_MAX_NAMES]
    except (OSError, ValueError):
        return []
