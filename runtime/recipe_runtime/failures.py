"""Failures of the host, told from faults of ours: by what an exception is, and by what engines write into theirs."""

from __future__ import annotations

import errno

_WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG)  # of an engine's own file, which it does not name


def told(error: Exception, again: str) -> str:
    """What failed, and what to do before `again`; an error that nobody but us can mend keeps its own words."""
    if isinstance(error, OSError) and (error.filename is not None or error.errno in _WRITING):
        return f"cannot write: {error.strerror}; free some space or allow writing, then {again}"
    if isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and "Failed to allocate" in str(error)):
        return f"out of memory; with fewer workers, {again}"
    return f"{type(error).__name__}: {error}"
