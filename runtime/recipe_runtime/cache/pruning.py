"""Lists and prunes the cache, least recently used entries first, and keeps what is in use.

All of the cache can be regenerated: traces by simulation, kernels by compilation. A build that added entries prunes
automatically to RECIPE_CACHE_LIMIT (10 GiB by default, `none` for no limit).

Builds, locks, verifications, shots and opened scenarios hold a shared lock on the marker of the cache, which the kernel
releases when their process ends. An entry's time stamp is updated whenever it is read, and the marker's when the first
of several processes begins to use the cache. While the lock is held, only entries older than the marker are removed.
"""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from recipe_compiler.ir.errors import InputError

from recipe_runtime.cache.store import (
    KERNELS,
    KINDS,
    MARKER,
    create_cache_folder,
    default_cache,
    is_cache_folder,
    kernel_cache,
)
from recipe_runtime.core.files import remove_tree

DEFAULT_LIMIT = 10 * 2**30
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


@dataclass(frozen=True)
class Entry:
    """A file of the store, or the compiled kernels of a release. `used`: last use, in seconds since the epoch."""

    kind: str
    path: Path
    size: int
    used: float


def folders() -> list[Path]:
    """Return the cache folders: that of traces and, if RECIPE_KERNEL_CACHE names another one, that of kernels."""
    return list(dict.fromkeys([default_cache(), kernel_cache()]))


def entries(roots: Iterable[Path]) -> list[Entry]:
    """Return all entries in these folders, the least recently used first.

    Raises:
        InputError: A folder has no marker and contains other files.
    """
    return sorted((e for root in roots for e in _entries(root)), key=lambda entry: (entry.used, str(entry.path)))


def sizes(found: list[Entry]) -> dict[str, tuple[int, int]]:
    """Return the number of entries and their total bytes, by kind."""
    totals: dict[str, tuple[int, int]] = {}
    for entry in found:
        count, size = totals.get(entry.kind, (0, 0))
        totals[entry.kind] = (count + 1, size + entry.size)
    return dict(sorted(totals.items()))


def prune(roots: Iterable[Path], limit: int) -> list[Entry]:
    """Remove the least recently used entries that are not in use, until at most `limit` bytes are left.

    Args:
        roots: The cache folders.
        limit: Bytes.

    Returns:
        The removed entries.

    Raises:
        InputError: A folder has no marker and contains other files; no entry is removed.
        OSError: A folder cannot be written to.
    """
    roots, removed = [root for root in roots if is_cache_folder(root)], list[Entry]()
    with ExitStack() as stack:
        since = min((stack.enter_context(_used_since(root)) for root in roots), default=0.0)
        found = entries(roots)
        left = sum(entry.size for entry in found)
        for entry in found:
            if left <= limit:
                break
            with suppress(FileNotFoundError):
                if entry.path.stat().st_mtime < since:  # it may have been read after it was listed
                    remove_tree(entry.path)
                    removed.append(entry)
                    left -= entry.size
    return removed


def limit() -> int | None:
    """Return RECIPE_CACHE_LIMIT in bytes; None for no limit.

    Raises:
        InputError: Its value is not a size.
    """
    text = os.environ.get("RECIPE_CACHE_LIMIT", "").strip()
    if text.lower() == "none":
        return None
    try:
        return bytes_of(text) if text else DEFAULT_LIMIT
    except InputError as error:
        raise InputError(f"RECIPE_CACHE_LIMIT: {error}, or none for no bound") from None


def auto_prune(roots: Iterable[Path], max_bytes: int | None) -> list[Entry]:
    """Prune automatically after a build, to `max_bytes`, except entries in use.

    Errors, such as a read-only cache, are ignored: the build itself has succeeded.

    Args:
        roots: The cache folders.
        max_bytes: None for no limit.

    Returns:
        The removed entries.
    """
    with suppress(OSError, InputError):
        return [] if max_bytes is None else prune(roots, max_bytes)
    return []


@contextmanager
def leased(*more: Path) -> Iterator[None]:
    """Keep what is read from the cache folders, and from these, from being pruned inside the block."""
    with ExitStack() as stack:
        for root in dict.fromkeys([*more, *folders()]):
            stack.enter_context(lease(root))
        yield


@contextmanager
def lease(root: Path) -> Iterator[None]:
    """Keep entries that are read from the cache at `root` inside the block from being pruned.

    A cache that cannot be written is not pruned. A forked process shares the lock; only the process that took it
    releases it.

    Raises:
        InputError: The folder has no marker and contains other files.
    """
    owner, handle = os.getpid(), -1
    with suppress(OSError):
        create_cache_folder(root)
        handle = os.open(root / MARKER, os.O_RDWR | os.O_CLOEXEC)
        if _lock_alone(handle):
            os.utime(handle)
        fcntl.flock(handle, fcntl.LOCK_SH)
    try:
        yield
    finally:
        if handle >= 0:
            if os.getpid() == owner:
                fcntl.flock(handle, fcntl.LOCK_UN)
            os.close(handle)


@contextmanager
def _used_since(root: Path) -> Iterator[float]:
    """Yield since when processes have used a cache without a break, in seconds since the epoch.

    Infinity if none does; then none begins to use it inside the block.
    """
    with (root / MARKER).open("r+b") as file:
        yield float("inf") if _lock_alone(file.fileno()) else os.fstat(file.fileno()).st_mtime


def _lock_alone(handle: int) -> bool:
    """Lock a file exclusively, and return whether that succeeded."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def bytes_of(text: str) -> int:
    """Parse a size such as `500M`, `1.5 GiB` or `0`.

    Raises:
        InputError: The text is not a size.
    """
    match = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,15})?)\s*([KMGT]?)(?:i?B)?\s*", text, re.IGNORECASE)
    if match is None:
        raise InputError(f"{text!r} is not a size; write for example 500M or 10G")
    return int(float(match[1]) * _UNITS[match[2].upper()])


def _entries(root: Path) -> Iterator[Entry]:
    if not is_cache_folder(root):
        return
    for kind in KINDS:
        for path in _files(root / kind):
            with suppress(FileNotFoundError):
                found = path.stat()
                yield Entry(kind, path, found.st_size, found.st_mtime)
    for release in sorted((root / KERNELS).glob("*")):
        with suppress(FileNotFoundError):  # its time stamp is updated by each process that may load its kernels
            size = sum(path.stat().st_size for path in _files(release))
            yield Entry(KERNELS, release, size, release.stat().st_mtime)


def _files(folder: Path) -> Iterator[Path]:
    """Yield all files below a folder, also temporary files of killed processes."""
    for place, _, names in os.walk(folder):
        yield from (Path(place) / name for name in names)
