"""Uploads to a folder of this host: which folders are allowed, and one upload at a time."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.core.files import open_folder, resolved


def check_local_place(place: Path, root: Path) -> None:
    """Check that a dataset on a local disk may be copied to another folder there.

    Raises:
        InputError: the folder is that of the dataset, is in it or contains it. Files there
            are removed before they are written again.
    """
    here, there = resolved(root), resolved(place)
    same = there.exists() and here.exists() and there.samefile(here)  # also through a mount
    if same or here.is_relative_to(there) or there.is_relative_to(here):
        raise InputError(
            f"{place} is not apart from {root}, where the dataset is built",
            help="choose a folder outside of it, or build there without a URL",
            code=Code.OUTPUT_IN_THE_WAY,
        )


@contextmanager
def locked(place: Path) -> Iterator[None]:
    """Hold the lock of a folder, which is created if it is absent, during an upload.

    Raises:
        RunError: another upload to the folder runs.
    """
    place.mkdir(parents=True, exist_ok=True)
    handle = open_folder(resolved(place))
    try:
        with suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise RunError(f"another upload to {place} is running; wait for it, then upload again") from None
        yield
    finally:
        os.close(handle)
