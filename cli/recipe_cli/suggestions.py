"""Remedies for paths on the command line that lead nowhere: the nearest file, folder or URL that exists."""

from __future__ import annotations

import os
import re
from pathlib import Path

_MAX_NAMES = 2000  # entries of a folder with which a misspelt name is compared
_PLACES = ("datasets/{}", "lockfiles/{}", "lockfiles/{}.lock")


def url_with_one_slash(text: str) -> str | None:
    """Return the URL probably meant by text such as `s3:/bucket/name`; None if it is a path."""
    scheme = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):/(?!/)", text)
    if scheme is None or os.path.lexists(f"{scheme[1]}:"):
        return None
    return f"{scheme[1]}://{text[scheme.end() :]}"


def nearest_place(path: Path) -> str | None:
    """Return an existing path of which a missing one is probably a misspelling, or None.

    This is a recipe, dataset or lockfile of that name, or else the path with the most similar spelling.
    """
    named = [path.with_name(f"{path.name}{suffix}") for suffix in (".yaml", ".yml", ".recipe") if path.name]
    named += [Path(place.format(path.name)) for place in _PLACES if path.parent == Path()]
    found = next((str(place) for place in named if place.exists()), None)
    return found or _respelt(path)


def check_exists(target: Path | str) -> None:
    """Check that a lockfile or dataset exists; the compiler reports a missing recipe.

    Raises:
        InputError: it does not exist.
    """
    from recipe_compiler.ir.errors import Code, InputError

    if not isinstance(target, Path) or target.exists() or target.suffix not in ("", ".lock"):
        return
    near = url_with_one_slash(str(target)) or nearest_place(target)
    what, remedy = "dataset folder", "`recipe build` makes one, in datasets/NAME; or name a recipe or a lockfile"
    if target.suffix:
        what, remedy = "lockfile", "`recipe lock RECIPE` writes one"
    remedy = f"did you mean {near}?" if near else remedy
    raise InputError(f"{target}: there is no such {what}", help=remedy, code=Code.FILE_NOT_FOUND)


def _respelt(path: Path) -> str | None:
    """Return the path with its first missing part replaced by the most similar name; None unless the result exists."""
    folder = Path(path.anchor)
    for number, part in enumerate(path.parts[1 if path.anchor else 0 :], start=1 if path.anchor else 0):
        if not (folder / part).exists():
            from recipe_compiler.source.similar_names import similar_names

            try:
                names = sorted(entry.name for entry in folder.iterdir())[:_MAX_NAMES]
            except OSError:
                return None
            close = similar_names(part, names, 1, 0.7)
            found = folder.joinpath(*close, *path.parts[number + 1 :])
            return str(found) if close and found.exists() else None
        folder /= part
    return None
