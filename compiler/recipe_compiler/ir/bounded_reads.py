"""Bounded reads of untrusted files: regular files only, never more than a limit."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO


def open_regular(path: Path, *, follow_links: bool = True) -> BinaryIO:
    """Open a regular file for reading.

    Raises:
        ValueError: it is a pipe, a device or another kind of file.
        OSError: it cannot be opened, or is a symbolic link and `follow_links` is not set.
    """
    # O_NONBLOCK: opening a pipe must not wait for a writer.
    flags = getattr(os, "O_NONBLOCK", 0) | (0 if follow_links else getattr(os, "O_NOFOLLOW", 0))
    file = os.fdopen(os.open(path, os.O_RDONLY | flags), "rb")
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise ValueError("it is not a regular file")
    return file


def read_regular(path: Path, limit: int) -> bytes:
    """Read a regular file.

    Returns:
        Its bytes, at most `limit + 1` of them, so that the caller sees whether it is too large.

    Raises:
        ValueError: it is a pipe, a device or another kind of file.
        OSError: it cannot be read.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        return file.read(min(limit, size) + 1)  # the read allocates this many bytes at once
