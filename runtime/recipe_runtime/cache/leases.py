"""Who uses the cache now: a file a user, locked for as long as its process lives, made when the use began.

Builds use it, and locks, verifications, shots and opened scenarios. An entry's time is renewed whenever it is read. So
whatever was read since the oldest living use began may be in use, and what is older is not. A lock ends with its
process, whatever ended that: what a dead one left is cleared away.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from recipe_runtime.cache.cache_folder import LEASES, claim, lease_files


@contextmanager
def lease(root: Path) -> Iterator[None]:
    """While inside, nothing read from the cache at `root` is tidied away. One that cannot be written needs no lease.

    InputError if the folder holds what is not of a cache.

    A fork of this process shares the lock; to give it back is for this one alone.
    """
    owner = os.getpid()
    handle, path = -1, root / LEASES / str(owner)
    with suppress(OSError):
        claim(root)
        path.parent.mkdir(parents=True, exist_ok=True)
        for number in range(1000):  # another host's or thread's may have our number
            path = path.with_name(f"{owner}.{number}")
            with suppress(FileExistsError):
                handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
                fcntl.flock(handle, fcntl.LOCK_EX)
                if _still_there(path, handle):
                    break
                os.close(handle)  # tidied away before it was locked: once more
                handle = -1
    try:
        yield
    finally:
        if handle >= 0:
            if os.getpid() == owner:
                with suppress(OSError):
                    path.unlink()
            os.close(handle)


def _still_there(path: Path, handle: int) -> bool:
    with suppress(FileNotFoundError):
        return os.path.samestat(path.stat(), os.fstat(handle))
    return False


def in_use_since(root: Path) -> float:
    """When the oldest of the living uses began, in seconds; infinity if there is none."""
    oldest = float("inf")
    for path in lease_files(root):
        with suppress(OSError):
            handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                oldest = min(oldest, os.fstat(handle).st_mtime)
            else:
                path.unlink()
            finally:
                os.close(handle)
    return oldest
