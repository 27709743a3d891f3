"""Describe exceptions that are failures of the host, such as a full disk, with a remedy."""

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
    """What failed, and what to do before `again`; other errors keep their own text."""
    if isinstance(error, OSError) and error.errno in _WRITING:
        where = f" {error.filename}" if error.filename is not None else ""
        return f"cannot write{where}: {error.strerror}; free some space or allow writing, then {again}"
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}; see to that, then {again}"
    if isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and "Failed to allocate" in str(error)):
        return f"out of memory; with fewer workers, {again}"
    return f"{type(error).__name__}: {error}"
