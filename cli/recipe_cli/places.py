"""Where lockfiles and datasets lie, seen from a recipe."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.lockfile import Lockfile

FOLDER = "lockfiles"


def lockfile_path(recipe: Path, name: str) -> Path:
    """The lockfile of a recipe: in the nearest `lockfiles` folder above it, else in one beside it."""
    start = recipe.resolve().parent
    for folder in (start, *start.parents):
        if (folder / FOLDER).is_dir():
            return _short(folder / FOLDER / f"{name}.lock")
    return _short(start / FOLDER / f"{name}.lock")


def source_of(recipe: Path, lockfile: Path) -> str:
    """The path from a lockfile's folder to the recipe, as a lockfile records it."""
    return Path(os.path.relpath(recipe.resolve(), lockfile.resolve().parent)).as_posix()


def recipe_of(lockfile: Path, lock: Lockfile) -> Path:
    """The recipe that a lockfile stands for: InputError if that leads out of the lockfile's project.

    The project is the folder that holds `lockfiles/`; of a lockfile elsewhere, its own folder.
    """
    from recipe_compiler.errors import InputError

    folder = lockfile.resolve().parent
    project = folder.parent if folder.name == FOLDER else folder
    try:
        recipe = (folder / lock.source).resolve()
    except (OSError, ValueError, RuntimeError):
        recipe = Path("/")
    if Path(lock.source).is_absolute() or not recipe.is_relative_to(project) or recipe == project:
        raise InputError(
            f"{lockfile}: its recipe {lock.source[:100]!r} is not a file of the folder {project}; name the recipe"
        )
    return _short(recipe)


def free_disk(folder: Path) -> int:
    """Bytes free where a folder is or would be."""
    import shutil

    there = folder.absolute()
    while True:
        try:
            return shutil.disk_usage(there).free
        except OSError:  # not there yet, or a name that cannot be
            there = there.parent


def _short(path: Path) -> Path:
    """The path from here where that is shorter to read."""
    relative = Path(os.path.relpath(path))
    return relative if len(str(relative)) < len(str(path)) else path
