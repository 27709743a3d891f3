"""The work folder of an export, next to its output, from which a rename publishes the export atomically."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.core.files import is_folder, open_folder, read_inside, regular_file
from recipe_runtime.dataset.json_stream import loads
from recipe_runtime.dataset.manifest_reader import check_outside_datasets
from recipe_runtime.dataset.reader import Dataset

MARKER = ".dataset-recipe-export"  # a file in work folders of exports
_MIN_BYTES_PER_VALUE = 20  # of an index: rows hold names and digests
_MIN_INDEX_LIMIT = 16 << 20  # bytes


def check_destination(out: Path) -> None:
    """Check that an export can take the place of a path.

    Raises:
        InputError: The path is the current folder, or in a dataset.
    """
    if not out.name or (out.exists() and out.samefile(Path.cwd())):
        raise InputError(
            f"{out} is the current folder, which an export cannot replace",
            help="name another folder",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    check_outside_datasets(out)


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


def read_index(out: Path, name: str, dataset: Dataset, bytes_per_frame: int) -> object:
    """Return the JSON index of an export; None if it is absent, damaged or too large.

    Args:
        out: The folder of the export.
        name: The name of its index.
        dataset: The dataset to export, which determines how long an index may be.
        bytes_per_frame: Bytes of an index for each frame of the dataset, at most.
    """
    frames = sum(len(s.frames(v.scene.clock.frames)) for v in dataset.plan.variants for s in v.rig.sensors)
    try:
        body = read_inside(out, name, max(_MIN_INDEX_LIMIT, bytes_per_frame * frames)) if is_folder(out) else b""
        return loads(body, 1000 + len(body) // _MIN_BYTES_PER_VALUE) if body else None
    except (OSError, ValueError):
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
    return not found or (regular_file(work, MARKER) is not None and is_leftover(work))
