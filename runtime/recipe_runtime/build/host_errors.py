"""Describes exceptions caused by the host, such as a full disk, with a remedy."""

from __future__ import annotations

import errno

_WRITING = (
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EROFS,
    errno.EFBIG,
    errno.EACCES,
    errno.EPERM,
)  # of an engine's own file, which it does not name


def describe(error: Exception, again: str) -> str:
    """Return a message for an exception, with a remedy if the host is the cause.

    Args:
        error: the exception.
        again: how to repeat the operation, such as "build again"; it ends the remedy.
    """
    if isinstance(error, OSError) and error.errno in _WRITING:
        where = f" {error.filename}" if error.filename is not None else ""
        return f"cannot write{where}: {error.strerror}; free some space or allow writing, then {again}"
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}; see to that, then {again}"
    if isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and "Failed to allocate" in str(error)):
        return f"out of memory; with fewer workers, {again}"
    return f"{type(error).__name__}: {error}"
