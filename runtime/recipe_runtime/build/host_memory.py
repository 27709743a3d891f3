"""Memory available to a process: the machine's, limited by its control groups and by the process' own limits."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from pathlib import Path

_UNLIMITED = 1 << 60  # control groups version 1 write a very large number for "no limit"


def total(root: Path = Path("/")) -> int:
    """Return the bytes of memory available to this process and its children together.

    Args:
        root: the folder that contains `proc` and `sys`.
    """
    return min([os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"), *_group_limits(root)])


def per_process() -> int | None:
    """Return the limit of one process' address space in bytes (RLIMIT_AS), or None if there is none."""
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if soft == resource.RLIM_INFINITY else soft


def _group_limits(root: Path) -> Iterator[int]:
    """Yield the limits of this process' control groups, of versions 1 and 2, and of all groups above them."""
    try:
        rows = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:
        return
    for row in rows:
        _, controllers, path = row.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        top = root / "sys/fs/cgroup" / ("memory" if controllers else "")
        name = "memory.limit_in_bytes" if controllers else "memory.max"
        group = top / path.lstrip("/")  # may not exist in a container, whose own group is then `top`
        for folder in (group, *group.parents):
            if folder.is_relative_to(top):
                yield from _limit(folder / name)


def _limit(file: Path) -> Iterator[int]:
    try:
        text = file.read_text().strip()
    except OSError:
        return
    if text.isdigit() and int(text) < _UNLIMITED:
        yield int(text)
