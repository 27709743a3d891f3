"""Lists and prunes the cache, least recently used entries first.

Only files that `cache_folder` recognises are counted and removed. All of them can be regenerated: traces by simulation,
kernels by compilation. The user may therefore prune at any time, even during a build, which regenerates what it needs.
A build that added entries prunes automatically to RECIPE_CACHE_LIMIT (10 GiB by default, `none` for no limit), except
for entries that a running build, lock, verification, shot or scenario has read since it began.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from recipe_compiler.ir.errors import InputError

from recipe_runtime.cache.cache_folder import contents, create_cache_folder, remove
from recipe_runtime.cache.leases import lease, oldest_lease_in
from recipe_runtime.cache.store import default_cache, kernel_cache

DEFAULT_LIMIT = 10 * 2**30
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


@dataclass(frozen=True)
class Entry:
    """A file of the store, or a folder of compiled kernels. `used`: last read or write, in seconds since the epoch."""

    kind: str
    root: Path  # the cache folder
    path: Path
    size: int
    used: float

    def used_now(self) -> float:
        """Return the current time of the last use."""
        with suppress(OSError):
            found = self.path.lstat()
            return max(self.used, found.st_mtime, found.st_atime if self.kind != "kernels" else 0.0)
        return self.used


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


def prune(roots: Iterable[Path], limit: int, before: float = float("inf")) -> list[Entry]:
    """Remove the least recently used entries until at most `limit` bytes are left.

    Args:
        roots: The cache folders.
        limit: Bytes.
        before: Entries used at or after this time are kept, even if they are used during pruning.

    Returns:
        The removed entries.

    Raises:
        InputError: A folder has no marker and contains other files; no entry is removed.
    """
    found = entries(roots)
    for root in dict.fromkeys(entry.root for entry in found):
        create_cache_folder(root)  # adds the marker to a folder of an earlier version
    left, removed = sum(entry.size for entry in found), []
    for entry in found:
        if left <= limit or entry.used >= before:
            break
        if before < float("inf") and entry.used_now() >= before:
            continue
        remove(entry.path, entry.root)
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
    roots = list(roots)
    with suppress(OSError, InputError):
        return [] if max_bytes is None else prune(roots, max_bytes, oldest_lease(roots))
    return []


@contextmanager
def leased(*more: Path) -> Iterator[None]:
    """Hold leases on the cache folders and on these inside the block."""
    with ExitStack() as stack:
        for root in dict.fromkeys([*more, *folders()]):
            stack.enter_context(lease(root))
        yield


def oldest_lease(roots: Iterable[Path]) -> float:
    """Return when the oldest active lease of any folder began; infinity if there is none."""
    return min((oldest_lease_in(root) for root in roots), default=float("inf"))


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
    found = contents(root)
    for kind, path in found.entries:
        yield from _file(kind, root, path)
    for module in found.modules:
        files = [e for path in sorted(module.iterdir()) for e in _file("kernels", root, path)]
        if files:
            release = module.parent.parent.stat().st_mtime  # updated by each process that may load its kernels
            yield Entry("kernels", root, module, sum(e.size for e in files), max(release, *(e.used for e in files)))


def _file(kind: str, root: Path, path: Path) -> Iterator[Entry]:
    with suppress(OSError):
        found = path.lstat()
        yield Entry(kind, root, path, found.st_size, max(found.st_mtime, found.st_atime))
