"""Paths of lockfiles and datasets, and the free disk space and memory of this host."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_compiler.estimate import Memory
    from recipe_compiler.ir.lockfile import Lockfile
    from recipe_compiler.ir.plan import DatasetPlan
    from recipe_runtime.dataset.reader import Dataset

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
    lock = lockfile.read(path, plan)
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


def check_default_folder(folder: Path, option: str = "--output") -> Path:
    """Return the folder to which a command writes unless `option` names one, such as `datasets`.

    Raises:
        InputError: it is a symbolic link, which may have come with a recipe; only a folder that is named may be one.
    """
    from recipe_compiler.ir.errors import Code, InputError

    if folder.is_symlink():
        raise InputError(
            f"{folder} is a symbolic link, and files are written through a link only if it is named",
            help=f"replace the link with a folder, or choose one with {option}",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    return folder


def check_outside_datasets(path: Path, option: str = "--output") -> None:
    """Check that a file is not inside a dataset, which contains only the files of its manifest.

    Raises:
        InputError: it is, and `option` names another place.
    """
    from dataclasses import replace

    if not any(os.path.lexists(folder / "manifest.json") for folder in Path(os.path.realpath(path)).parents):
        return  # before the import of the library
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.dataset import manifest_reader

    try:
        manifest_reader.check_outside_datasets(path)
    except InputError as error:
        remedy = f"choose a place outside it with {option}"
        raise InputError([replace(problem, help=remedy) for problem in error.problems]) from None


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


def recipe_files(recipe: Path, compiled: Compiled) -> dict[str, bytes]:
    """Return the bytes of the recipe and of every file that it uses, as they were compiled."""
    import hashlib

    from recipe_compiler.ir.errors import RunError

    found = {}
    for path, value in compiled.files.items():
        body = (recipe.parent / path).read_bytes()
        if hashlib.sha256(body).hexdigest() != value:
            raise RunError(f"{recipe.parent / path} changed since it was compiled; start again")
        found[path] = body
    return found


def check_utf8(recipe: Path) -> None:
    """Check that the path of a recipe can be recorded.

    Raises:
        InputError: it has bytes that are not UTF-8.
    """
    from recipe_compiler.ir.errors import InputError

    for path in (str(recipe), os.path.realpath(recipe)):
        try:
            path.encode()
        except UnicodeEncodeError:
            raise InputError(
                f"{path!r}: the path of a recipe is recorded in UTF-8", help="rename the file or its folder"
            ) from None


def used_files(recipe: Path, compiled: Compiled) -> list[Path]:
    """Return the paths of the recipe and of every file that it uses."""
    return [recipe, *(recipe.parent / path for path in compiled.files)]


def free_disk(folder: Path) -> int:
    """Return the free bytes on the file system of a folder, which need not exist yet.

    Raises:
        InputError: no files can be stored there, as in /proc.
    """
    import shutil
    import sys

    there = folder.absolute()
    while True:
        try:
            usage = shutil.disk_usage(there)
            break
        except OSError:  # not there yet, or a name that cannot be
            there = there.parent
    if usage.total:
        return usage.free
    _check_stores_files(folder, there)
    return sys.maxsize


def _check_stores_files(folder: Path, parent: Path) -> None:
    """Raise InputError unless files can be created in `parent`, whose file system reports no size."""
    import tempfile

    from recipe_compiler.ir.errors import Code, InputError

    try:
        tempfile.TemporaryFile(dir=parent).close()
    except OSError as error:
        raise InputError(
            f"{folder}: no files can be stored in {parent}: {error.strerror or error}",
            help="choose another folder",
            code=Code.OUTPUT_IN_THE_WAY,
        ) from None


def check_cost(plan: DatasetPlan, name: str, remedy: str, *, allow_large: bool = False) -> None:
    """Check that rendering the plan of a dataset, which is untrusted, does not exceed the limits of a recipe.

    Args:
        plan: the plan.
        name: the dataset's, for the message.
        remedy: the remedy of the message.
        allow_large: check nothing.

    Raises:
        InputError: its estimate exceeds a limit, and `allow_large` is not set.
    """
    from recipe_compiler.estimate import estimate
    from recipe_compiler.ir.errors import Code, InputError

    reasons = [] if allow_large else estimate(plan).over()
    if reasons:
        raise InputError(f"{name}: to render its plan, {', and '.join(reasons)}", help=remedy, code=Code.SIZE_LIMIT)


def check_bytes(dataset: Dataset, *, copies: int = 0, more: int = 0, allow_large: bool = False) -> None:
    """Check that a dataset, which is untrusted and whose files are all to be read, is not very large.

    Args:
        dataset: the dataset.
        copies: how many times a file is written, at most, under each of its names; 0 if files are only read.
        more: bytes that are written besides.
        allow_large: check nothing.

    Raises:
        InputError: these are more bytes than those of a recipe may have, and `allow_large` is not set.
    """
    from recipe_compiler.estimate import BYTE_LIMIT, size
    from recipe_compiler.ir.errors import Code, InputError

    sizes = dict[object, int]()
    for path in dataset.files:
        with suppress(OSError):
            there = (dataset.root / path).lstat()
            sizes[path if copies else (there.st_dev, there.st_ino)] = there.st_size
    total = sum(sizes.values()) * max(copies, 1) + more
    if total > BYTE_LIMIT and not allow_large:
        times = f", written up to {copies} times" if copies > 1 else ""
        raise InputError(
            f"{dataset.name}: its files have {size(total)}{times}, over {size(BYTE_LIMIT)}",
            help="give --allow-large if that is expected",
            code=Code.SIZE_LIMIT,
        )


def memory(workers: int) -> Memory:
    """Return the memory of this host, for a build with that many workers."""
    from recipe_compiler.estimate import Memory
    from recipe_runtime.core import host

    return Memory(host.total_memory(), host.process_memory_limit(), workers)


def _short(path: Path) -> Path:
    """Return the path relative to the working directory if that is shorter."""
    relative = Path(os.path.relpath(path))
    return relative if len(str(relative)) < len(str(path)) else path
