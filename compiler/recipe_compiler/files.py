"""Reading a stranger's file: never a pipe, a device or more than a limit."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def read_regular(path: Path, limit: int) -> bytes:
    """A regular file's bytes, at most limit + 1 of them; ValueError for any other kind of file, else OSError."""
    # O_NONBLOCK: opening a pipe must not wait for a writer.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode):
            raise ValueError("it is not a regular file")
        return file.read(min(limit, found.st_size) + 1)  # memory for so many bytes is taken at once
