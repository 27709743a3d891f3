"""The path of a recipe's lockfile, and the recipe of a lockfile."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.ir.lockfile import Lockfile
    from recipe_compiler.ir.plan import DatasetPlan

FOLDER = "lockfiles"
_MARKERS = ("pyproject.toml", ".git", FOLDER)  # a folder that holds one of these is a project's root


def lockfile_path(recipe: Path, name: str) -> Path:
    """Return the path at which the lockfile of a recipe is, or is to be written.

    It is NAME.lock beside the recipe if that exists, else lockfiles/NAME.lock of the recipe's project. No other folder
    is searched.
    """
    start = recipe.resolve().parent
    beside = start / f"{name}.lock"
    if os.path.lexists(beside):
        return _short(beside)
    folders = (start, *start.parents)
    project = next((folder for folder in folders if any(os.path.lexists(folder / m) for m in _MARKERS)), start)
    return _short(project / FOLDER / f"{name}.lock")


def read_lockfile(recipe: Path, plan: DatasetPlan) -> tuple[Path, Lockfile] | None:
    """The lockfile of a recipe and its place; None if there is none.

    Raises:
        InputError: it cannot be read, or another recipe of the same name has that lockfile.
    """
    from recipe_compiler.ir import lockfile

    path = lockfile_path(recipe, plan.recipe)
    if not path.exists():
        return None
    lock = lockfile.read(path)
    check_lockfile_is_of(recipe, plan, path, lock)
    return path, lock


def check_lockfile_is_of(recipe: Path, plan: DatasetPlan, path: Path, lock: Lockfile) -> None:
    """Raise InputError, with both recipes and a remedy, if a lockfile belongs to another recipe of the same name."""
    from recipe_compiler.ir.errors import InputError

    other = lock.other_recipe(path, recipe, plan.digest)
    if other is not None:
        own = recipe.parent / FOLDER
        apart = "" if os.path.lexists(own) else f", or create the folder {own} for its lockfile"
        raise InputError(
            f"{path} is the lockfile of {_short(other)}, another recipe that is named {plan.recipe!r} as {recipe} is;"
            f" give one of them another name (`recipe: NAME`){apart};"
            f" `recipe lock {recipe} --replace` assigns this one to {recipe}"
        )


def source_of(recipe: Path, lockfile: Path) -> str:
    """Return the path from a lockfile's folder to the recipe, as a lockfile records it."""
    return Path(os.path.relpath(recipe.resolve(), lockfile.resolve().parent)).as_posix()


def recipe_of(lockfile: Path, source: str) -> Path:
    """Return the recipe that a lockfile names as its `source`.

    Raises:
        InputError: the path leads out of the lockfile's project, which is the folder that contains `lockfiles/`, or the
            lockfile's own folder if it is elsewhere.
    """
    from recipe_compiler.ir.errors import InputError

    folder = lockfile.resolve().parent
    project = folder.parent if folder.name == FOLDER else folder
    try:
        recipe = (folder / source).resolve()
    except (OSError, ValueError, RuntimeError):
        recipe = Path("/")
    if Path(source).is_absolute() or not recipe.is_relative_to(project) or recipe == project:
        raise InputError(
            f"{lockfile}: its recipe {source[:100]!r} is not a file of the folder {project}; name the recipe"
        )
    return _short(recipe)


def _short(path: Path) -> Path:
    """Return the path relative to the working directory if that is shorter."""
    relative = Path(os.path.relpath(path))
    return relative if len(str(relative)) < len(str(path)) else path
