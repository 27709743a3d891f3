"""What the cache holds, and how it is kept small: entries that nobody used for longest go first.

Only what `cache_folder` recognises is counted and removed. All of that can be made again: traces by simulation, kernels
by compiling. So it may be pruned by hand at any time, under a running build too, which then makes again what it misses.
After a build that made something it is tidied: what exceeds RECIPE_CACHE_LIMIT (10 GiB by default, `none` for no bound)
goes, but nothing that a living build, lock, verification, shot or scenario has read since it began.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from recipe_compiler.ir.errors import InputError

from recipe_runtime.cache.cache_folder import claim, contents, remove
from recipe_runtime.cache.leases import in_use_since, lease
from recipe_runtime.cache.store import default_cache, kernel_cache

DEFAULT_LIMIT = 10 * 2**30
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


@dataclass(frozen=True)
class Entry:
    """A file of the store, or a folder of compiled kernels. `used` is when it was last read or written, in seconds."""

    kind: str
    root: Path  # the cache folder
    path: Path
    size: int
    used: float

    def used_now(self) -> float:
        """When it was used last, looked up again."""
        with suppress(OSError):
            found = self.path.lstat()
            return max(self.used, found.st_mtime, found.st_atime if self.kind != "kernels" else 0.0)
        return self.used


def folders() -> list[Path]:
    """Where things are kept: traces, and compiled kernels, which RECIPE_KERNEL_CACHE may have elsewhere."""
    return list(dict.fromkeys([default_cache(), kernel_cache()]))


def entries(roots: Iterable[Path]) -> list[Entry]:
    """Everything that this project keeps in these folders, the least recently used first.

    InputError if one of them holds other things and was never marked as a cache.
    """
    return sorted((e for root in roots for e in _entries(root)), key=lambda entry: (entry.used, str(entry.path)))


def sizes(found: list[Entry]) -> dict[str, tuple[int, int]]:
    """Kind -> entries, bytes."""
    told: dict[str, tuple[int, int]] = {}
    for entry in found:
        count, size = told.get(entry.kind, (0, 0))
        told[entry.kind] = (count + 1, size + entry.size)
    return dict(sorted(told.items()))


def prune(roots: Iterable[Path], limit: int, before: float = float("inf")) -> list[Entry]:
    """Remove the least recently used entries until no more than `limit` bytes are left; what was removed.

    Entries that were used at `before` or later stay, also if that was while this was at work. InputError, and nothing
    is removed, if one of the folders holds other things and was never marked as a cache.
    """
    found = entries(roots)
    for root in dict.fromkeys(entry.root for entry in found):
        claim(root)  # made by an earlier version
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
    """How much the cache may hold, by RECIPE_CACHE_LIMIT; None: no bound. InputError if that is no size."""
    text = os.environ.get("RECIPE_CACHE_LIMIT", "").strip()
    if text.lower() == "none":
        return None
    try:
        return bytes_of(text) if text else DEFAULT_LIMIT
    except InputError as error:
        raise InputError(f"RECIPE_CACHE_LIMIT: {error}, or none for no bound") from None


def tidy(roots: Iterable[Path], most: int | None) -> list[Entry]:
    """Prune to `most` bytes, but for what running builds have read; never an error, for the work is done by then."""
    roots = list(roots)
    with suppress(OSError, InputError):  # read-only, say
        return [] if most is None else prune(roots, most, in_use(roots))
    return []


@contextmanager
def leased(*more: Path) -> Iterator[None]:
    """While inside, nothing that was read meanwhile is pruned, from these folders or from where things are kept."""
    with ExitStack() as stack:
        for root in dict.fromkeys([*more, *folders()]):
            stack.enter_context(lease(root))
        yield


def in_use(roots: Iterable[Path]) -> float:
    """When the oldest of the running uses began: what was read since may be in use. Infinity if none runs."""
    return min((in_use_since(root) for root in roots), default=float("inf"))


def bytes_of(text: str) -> int:
    """`500M`, `1.5 GiB`, `0` as bytes; InputError for anything else."""
    match = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,15})?)\s*([KMGT]?)(?:i?B)?\s*", text, re.IGNORECASE)
    if match is None:
        raise InputError(f"{text!r} is no size; write for example 500M or 10G")
    return int(float(match[1]) * _UNITS[match[2].upper()])


def _entries(root: Path) -> Iterator[Entry]:
    found = contents(root)
    for kind, path in found.entries:
        yield from _file(kind, root, path)
    for module in found.modules:
        files = [e for path in sorted(module.iterdir()) for e in _file("kernels", root, path)]
        if files:
            release = module.parent.parent.stat().st_mtime  # renewed by each process that may load its kernels
            yield Entry("kernels", root, module, sum(e.size for e in files), max(release, *(e.used for e in files)))


def _file(kind: str, root: Path, path: Path) -> Iterator[Entry]:
    with suppress(OSError):
        found = path.lstat()
        yield Entry(kind, root, path, found.st_size, max(found.st_mtime, found.st_atime))
