"""The work folder of an export, next to its output, from which a rename publishes the export atomically.

An export that is replaced is moved to a second folder there, and removed when the new one is in its place. If the
process is killed in between, the next export moves it back.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.core.files import (
    has_content,
    holds_current_folder,
    is_folder,
    open_folder,
    plain_path,
    regular_file,
    remove_tree,
)
from recipe_runtime.dataset.plan_checks import byte_count
from recipe_runtime.dataset.reader import Dataset

MARKER = ".dataset-recipe-export"  # a file in the folders that exports make next to their outputs
_REPLACED = "export"  # the replaced export, in the second folder


def check_destination(out: Path) -> Path:
    """Check that an export can take the place of a path, and return the path without `..`.

    Raises:
        InputError: The path is the current folder, or contains it.
    """
    out = plain_path(out)
    if not out.name or holds_current_folder(out):
        raise InputError(
            f"{out} is the current folder or contains it, and an export cannot replace that",
            help="name another folder",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    return out


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
    with _locked(work, out) as handle:
        (work / MARKER).touch()
        try:
            _remove_content(work)
            yield work
        finally:
            if _is_at(handle, work):  # else it was published, and a folder there is the next export's
                with suppress(OSError, InputError):
                    _remove_content(work)
                    (work / MARKER).unlink()
                    work.rmdir()


def publish(work: Path, out: Path, is_replaceable: Callable[[Path], bool] | None) -> None:
    """Rename a work folder to `out`, in the place of the export that is there.

    Args:
        work: The work folder, with a complete export.
        out: The output folder.
        is_replaceable: Returns whether a folder still contains only the export to replace; None if there is none.

    Raises:
        InputError: The export to replace has other files by now, or another program has made a folder there; all stay.
        OSError: The host cannot rename a folder; the old export stays.
    """
    if is_replaceable is None:
        try:
            work.rename(out)
        except OSError:
            if not os.path.lexists(out):
                raise
            raise _made_meanwhile(out, "export again") from None
    else:
        aside = _aside(out)
        aside.mkdir(exist_ok=True)
        with _locked(aside, out):
            (aside / MARKER).touch()
            out.rename(aside / _REPLACED)
            try:
                if not is_replaceable(aside / _REPLACED):
                    raise InputError(
                        f"{out} was changed during the export",
                        help="move the files away that do not belong to it, or choose another folder",
                        code=Code.OUTPUT_IN_THE_WAY,
                    )
                work.rename(out)
            finally:
                _settle(aside, out)
    (out / MARKER).unlink()


def recover(out: Path) -> None:
    """Complete what an export that was killed while it replaced another one left.

    If the new export is not in its place, the old one is moved back; else the old one is removed.

    Raises:
        InputError: The folder for replaced exports exists and was not made by an export.
        RunError: Another export uses it.
    """
    aside = _aside(out)
    if aside.is_symlink() or (aside.exists() and not _is_aside(aside)):
        raise InputError(f"{aside} exists and is not the folder of a replaced export; move it away")
    if aside.exists():
        with _locked(aside, out):
            _settle(aside, out)
    if is_folder(out) and regular_file(out, MARKER) is not None:
        (out / MARKER).unlink()


def holds_files(out: Path, rows: Iterable[tuple[str, int, str]], dataset: Dataset) -> bool:
    """Return whether a folder has the files of an index, which may have been written by anyone.

    Args:
        out: The folder of the export.
        rows: Path, size in bytes and SHA-256 of each file.
        dataset: The dataset, which determines how many bytes are hashed at most.
    """
    known = list(rows)
    if any(size < 0 for _, size, _ in known) or sum(size for _, size, _ in known) > 2 * byte_count(dataset.plan):
        return False
    return all(has_content(out, path, size, sha256) for path, size, sha256 in known)


def is_empty(folder: Path) -> bool:
    """Return whether a path is an empty folder."""
    return folder.is_dir() and not any(folder.iterdir())


def _is_work_folder(work: Path, is_leftover: Callable[[Path], bool]) -> bool:
    """Return whether a folder is empty, or contains only the marker and leftovers."""
    found = sorted(work.iterdir()) if is_folder(work) else [work]
    return not found or (regular_file(work, MARKER) is not None and is_leftover(work))


def _remove_content(work: Path) -> None:
    """Remove everything but the marker, by which the next export recognises the folder if this one is killed."""
    for path in sorted(work.iterdir()):
        if path.name != MARKER:
            remove_tree(path)


def _aside(out: Path) -> Path:
    """Return the folder to which a replaced export is moved."""
    return out.with_name(f".{out.name}.replaced")


def _is_aside(aside: Path) -> bool:
    """Return whether a folder is empty, or contains only the marker and a replaced export."""
    found = {path.name for path in sorted(aside.iterdir())} if is_folder(aside) else {aside.name}
    marked = regular_file(aside, MARKER) is not None and found <= {MARKER, _REPLACED}
    return not found or (marked and (_REPLACED not in found or is_folder(aside / _REPLACED)))


def _settle(aside: Path, out: Path) -> None:
    """Move a replaced export back if nothing is in its place, or remove it if the new one is; the marker goes last.

    Raises:
        InputError: A folder is in its place that another program made; both stay.
    """
    if is_folder(aside / _REPLACED):
        if not os.path.lexists(out):
            (aside / _REPLACED).rename(out)
        elif regular_file(out, MARKER) is not None:  # of the new export, until the end
            remove_tree(aside / _REPLACED)
        else:
            raise _made_meanwhile(out, f"move it away and {aside / _REPLACED} back, then export again")
    (aside / MARKER).unlink(missing_ok=True)
    aside.rmdir()


def _made_meanwhile(out: Path, remedy: str) -> InputError:
    message = f"{out} was made by another program during the export"
    return InputError(message, help=f"{remedy}, or choose another folder", code=Code.OUTPUT_IN_THE_WAY)


@contextmanager
def _locked(folder: Path, out: Path) -> Iterator[int]:
    """Hold the lock of a folder next to `out`, and yield its descriptor; RunError if another export holds it."""
    handle = open_folder(folder)
    try:
        busy = RunError(f"another export is writing {out}; wait for it, or choose another folder")
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise busy from None
        if not _is_at(handle, folder):  # it was published or removed before it was locked
            raise busy
        yield handle
    finally:
        os.close(handle)


def _is_at(handle: int, folder: Path) -> bool:
    """Return whether an open folder is still at a path."""
    try:
        return os.path.samestat(os.fstat(handle), folder.lstat())
    except FileNotFoundError:
        return False
