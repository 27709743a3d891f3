"""Remedies for paths on the command line that lead nowhere: the nearest file, folder or URL that exists."""

from __future__ import annotations

import os
import re
from pathlib import Path

_PLACES = ("datasets/{}", "lockfiles/{}", "lockfiles/{}.lock")


def url_with_one_slash(text: str) -> str | None:
    """Return the URL probably meant by text such as `s3:/bucket/name`; None if it is a path."""
    scheme = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):/(?!/)", text)
    if scheme is None or os.path.lexists(f"{scheme[1]}:"):
        return None
    return f"{scheme[1]}://{text[scheme.end() :]}"


def nearest_place(path: Path) -> str | None:
    """Return an existing path of which a missing one is probably a misspelling, or None.

    This is a dataset or lockfile of that name, or else the most similar name in its folder.
    """
    from recipe_compiler.source.file_help import nearest_entry

    places = [Path(place.format(path.name)) for place in _PLACES if path.name]
    found = next((place for place in places if place.exists()), None) or nearest_entry(path)
    return str(found) if found else None


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
