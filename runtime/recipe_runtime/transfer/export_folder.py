"""The work folder of an export, next to its output, from which a rename publishes the export atomically."""

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

MARKER = ".dataset-recipe-export"  # a file in work folders of exports


@contextmanager
def work_folder(out: Path, is_leftover: Callable[[Path], bool]) -> Iterator[Path]:
    """Yield an empty, locked work folder next to `out`, and remove it afterwards.

    Args:
        out: the output folder of the export.
        is_leftover: returns whether a folder with the marker contains only files that a stopped export may have left.

    Raises:
        InputError: the folder exists and is not the work folder of an export.
        RunError: another export uses it.
    """
    work = out.with_name(f".{out.name}.export")
    if work.is_symlink() or (work.exists() and not _is_work_folder(work, is_leftover)):
        raise InputError(f"{work} exists and is not the work folder of an export; move it away")
    work.mkdir(parents=True, exist_ok=True)
    handle = open_folder(work)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunError(f"another export is writing {out}; wait for it, or choose another folder") from None
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


def read_index(out: Path, name: str, max_bytes: int) -> object:
    """Return the JSON index of an export, of at most `max_bytes`; None if it is absent or damaged."""
    try:
        return json.loads(read_inside(out, name, max_bytes)) if is_folder(out) else None
    except (OSError, ValueError, RecursionError):
        return None


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with its content; links are not followed."""
    if is_folder(path):
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def is_empty(folder: Path) -> bool:
    """Return whether a path is an empty folder."""
    return folder.is_dir() and not any(folder.iterdir())


def _is_work_folder(work: Path, is_leftover: Callable[[Path], bool]) -> bool:
    """Return whether a folder is empty, or contains only the marker and leftovers."""
    found = sorted(work.iterdir()) if is_folder(work) else [work]
    return not found or ((work / MARKER).is_file() and is_leftover(work))
