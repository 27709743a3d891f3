"""A lock by which threads take turns, which a forked process does not inherit."""

from __future__ import annotations

import os
import threading
from contextlib import AbstractContextManager


class ProcessLock:
    """Returns the lock of this process, which a thread may hold several times.

    A forked process has a lock of its own, since the thread that holds its parent's is not there. So has a copy.
    """

    def __init__(self) -> None:
        self._locks: dict[int, AbstractContextManager[bool]] = {}

    def __call__(self) -> AbstractContextManager[bool]:
        """Return the lock."""
        return self._locks.setdefault(os.getpid(), threading.RLock())

    def __reduce__(self) -> tuple[type[ProcessLock], tuple[()]]:
        return ProcessLock, ()
