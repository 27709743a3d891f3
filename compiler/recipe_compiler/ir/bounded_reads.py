"""Reading a stranger's file: never a pipe, a device or more than a limit."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO


def open_regular(path: Path) -> BinaryIO:
    """A regular file, opened to be read; ValueError for any other kind of file, else OSError."""
    # O_NONBLOCK: opening a pipe must not wait for a writer.
    file = os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb")
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise ValueError("it is not a regular file")
    return file


def read_regular(path: Path, limit: int) -> bytes:
    """A regular file's bytes, at most limit + 1 of them; ValueError for any other kind of file, else OSError."""
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        return file.read(min(limit, size) + 1)  # memory for so many bytes is taken at once
