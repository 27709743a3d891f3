"""Leases of the cache: one file per user of the cache, created when its use begins and locked while its process lives.

Builds, locks, verifications, shots and opened scenarios take leases. An entry's time stamp is updated whenever it is
read, so entries read since the oldest active lease began may be in use, and older ones are not. The kernel releases the
lock when the process ends for any reason; stale lease files are deleted.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from recipe_runtime.cache.cache_folder import LEASES, create_cache_folder, lease_files
from recipe_runtime.core.files import make_folder, open_no_follow


@contextmanager
def lease(root: Path) -> Iterator[None]:
    """Protect entries that are read from the cache at `root` inside the block from automatic pruning.

    A cache that cannot be written is not pruned, so it needs no lease. A forked process shares the lock; only the
    process that took it releases it.

    Raises:
        InputError: The folder has no marker and contains other files.
    """
    owner = os.getpid()
    handle, path = -1, root / LEASES / str(owner)
    with suppress(OSError):
        create_cache_folder(root)
        make_folder(path.parent)
        for number in range(1000):  # another host or thread may use the same number
            path = path.with_name(f"{owner}.{number}")
            with suppress(FileExistsError):
                handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
                fcntl.flock(handle, fcntl.LOCK_EX)
                if _still_there(path, handle):
                    break
                os.close(handle)  # deleted as stale before it was locked: try again
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


def oldest_lease_in(root: Path) -> float:
    """Return when the oldest active lease began, in seconds since the epoch; infinity if there is none."""
    oldest = float("inf")
    for path in lease_files(root):
        with suppress(OSError), open_no_follow(path) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                oldest = min(oldest, os.fstat(file.fileno()).st_mtime)
            else:
                path.unlink()
    return oldest
