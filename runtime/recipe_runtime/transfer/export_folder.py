"""The work folder of an export, next to its output, from which a rename publishes the export atomically.

An export that is replaced is moved to a second folder there, and removed when the new one is in its place. If the
process is killed in between, the next export moves it back.
"""

from __future__ import annotations

import fcntl
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from recipe_compiler.ir.bounded_reads import bounded_memory
from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.core.files import (
    has_content,
    holds_current_folder,
    is_folder,
    open_folder,
    open_inside,
    plain_path,
    regular_file,
    remove_tree,
)
from recipe_runtime.dataset.json_stream import JsonStream
from recipe_runtime.dataset.limits import byte_count
from recipe_runtime.dataset.manifest_reader import check_outside_datasets
from recipe_runtime.dataset.reader import Dataset

MARKER = ".dataset-recipe-export"  # a file in the folders that exports make next to their outputs
_REPLACED = "export"  # the replaced export, in the second folder
_ROW_BYTES, _BYTES_PER_ROW = 500, 250  # of an index: characters of a row, at most; bytes of a row and its path, about
_MIN_INDEX_LIMIT = 16 << 20  # bytes


def check_destination(out: Path) -> Path:
    """Check that an export can take the place of a path, and return the path without `..`.

    Raises:
        InputError: The path is the current folder, or contains it, or is in a dataset.
    """
    out = plain_path(out)
    if not out.name or holds_current_folder(out):
        raise InputError(
            f"{out} is the current folder or contains it, and an export cannot replace that",
            help="name another folder",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    check_outside_datasets(out)
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


def read_index(out: Path, name: str, dataset: Dataset, bytes_per_frame: int) -> object:
    """Return the JSON index of an export; None if it is absent, damaged or too large.

    Args:
        out: The folder of the export.
        name: The name of its index.
        dataset: The dataset to export, which determines how long an index may be.
        bytes_per_frame: Bytes of an index for each frame of the dataset, at most.
    """
    frames = sum(len(s.frames(v.scene.clock.frames)) for v in dataset.plan.variants for s in v.rig.sensors)
    most = max(_MIN_INDEX_LIMIT, bytes_per_frame * frames)
    try:
        with open_inside(out, name) as file, bounded_memory(str(out / name)):
            return _read_rows(JsonStream(file, most), most) if is_folder(out) else None
    except (OSError, ValueError):
        return None


def _read_rows(stream: JsonStream, most: int) -> object:
    """Return the JSON object at a stream, whose tables `files` and `shards` may have up to `most` bytes together.

    Raises:
        ValueError: it is not the index of an export, or too large.
    """
    found: dict[str, object] = {}
    left = [most // _BYTES_PER_ROW, most]  # rows, and bytes of their paths in memory
    for key in stream.members():
        if key in found:
            raise ValueError("it has a key twice")
        if key == "files":
            rows = found[key] = dict[str, object]()
            for path in stream.members():
                if path in rows:
                    raise ValueError("it has a path twice")
                rows[path] = _row(stream.value(_ROW_BYTES), path, left)
        elif key == "shards":
            found[key] = [_row(value, "", left) for value in stream.items(_ROW_BYTES)]
        else:
            found[key] = stream.value()
    stream.end()
    return found


def _row(value: object, path: str, left: list[int]) -> object:
    """Return a row of an index; ValueError if it is none, or one too many."""
    parts = list(value.values()) if isinstance(value, dict) else value
    left[0], left[1] = left[0] - 1, left[1] - sys.getsizeof(path)
    if min(left) < 0 or not isinstance(parts, list) or not all(isinstance(part, int | str) for part in parts):
        raise ValueError("it has more rows than an index, or others")
    return value


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
