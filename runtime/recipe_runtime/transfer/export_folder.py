"""The folder in which an export works, beside its output, and from which one rename publishes it."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from recipe_compiler.ir.errors import InputError, RunError

from recipe_runtime.core.files import is_folder, open_folder, read_inside

MARKER = ".dataset-recipe-export"  # in a folder in which an export works


@contextmanager
def work_folder(out: Path, is_leftover: Callable[[Path], bool]) -> Iterator[Path]:
    """Yield an empty work folder beside `out`, which no other process uses, and remove it afterwards.

    Args:
        out: the folder that the export will become.
        is_leftover: whether a folder with the marker has only what a stopped export can have left there.

    Raises:
        InputError: something else has the folder's name.
        RunError: another export uses it.
    """
    work = out.with_name(f".{out.name}.export")
    if work.is_symlink() or (work.exists() and not _is_ours(work, is_leftover)):
        raise InputError(f"{work} is in the way and is not an export's work; move it away")
    work.mkdir(parents=True, exist_ok=True)
    handle = open_folder(work)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunError(f"another export is writing {out}; wait for it, or name another folder") from None
        (work / MARKER).touch()
        try:
            for path in sorted(work.iterdir()):
                if path.name != MARKER:
                    remove(path)
            yield work
        finally:
            shutil.rmtree(work, ignore_errors=True)
    finally:
        os.close(handle)


def read_index(out: Path, name: str, most: int) -> object:
    """Return the JSON index of an export, of at most `most` bytes; None if it is absent or damaged."""
    try:
        return json.loads(read_inside(out, name, most)) if is_folder(out) else None
    except (OSError, ValueError, RecursionError):
        return None


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with all that is in it; links are not followed."""
    if is_folder(path):
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def is_empty(folder: Path) -> bool:
    """Return whether a path is an empty folder."""
    return folder.is_dir() and not any(folder.iterdir())


def _is_ours(work: Path, is_leftover: Callable[[Path], bool]) -> bool:
    """Whether a folder is empty, or has the marker and nothing else than leftovers."""
    found = sorted(work.iterdir()) if is_folder(work) else [work]
    return not found or ((work / MARKER).is_file() and is_leftover(work))
