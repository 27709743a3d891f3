"""Bounded reads of untrusted files: regular files only, never more than a limit, and with bounded memory."""

from __future__ import annotations

import os
import resource
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from recipe_compiler.ir.errors import Code, InputError

_memory: int | None = None  # bytes that reading one document may take


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


def bound_memory(size: int | None) -> None:
    """Set how many bytes of memory this process may take to read one document; None, as at first: any number.

    For programs, not for libraries: while a document is read, the bound applies to all threads.
    """
    global _memory
    _memory = size


@contextmanager
def bounded_memory(what: str) -> Iterator[None]:
    """End a block that reads the document `what` when it takes more memory than `bound_memory` allows.

    Readers limit what they count. This bound is for whatever they do not count.

    Raises:
        InputError: the block takes more memory.
    """
    before = resource.getrlimit(resource.RLIMIT_DATA)
    used = _data_bytes()
    most = None if _memory is None or used is None else used + _memory
    if most is None or any(limit != resource.RLIM_INFINITY and limit <= most for limit in before):
        yield
        return
    failed = False
    resource.setrlimit(resource.RLIMIT_DATA, (most, before[1]))
    try:
        yield
    except MemoryError:
        failed = True
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)
    if failed:
        raise InputError(f"{what} takes too much memory to read: over {_memory:,} bytes", code=Code.INPUT_LIMIT)


def _data_bytes() -> int | None:
    """Return the bytes of private writable memory of this process; None if the host does not report them."""
    try:
        lines = Path("/proc/self/status").read_bytes().splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith(b"VmData:")), None)
