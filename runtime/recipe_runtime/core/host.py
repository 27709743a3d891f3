"""Properties of this host: those that may affect bytes, its memory, and its source of entropy.

Memory available to a process is the machine's, limited by its control groups and by the process' own limits.
"""

from __future__ import annotations

import os
import platform
import resource
import secrets
import sys
from collections.abc import Iterator
from pathlib import Path

REQUIRED_CPU_FEATURE = "AVX"  # Warp's machine code uses it even for the generic x86-64 target
_UNLIMITED = 1 << 60  # control groups version 1 write a very large number for "no limit"


def unsupported_reason(stage: str) -> str | None:
    """Return the reason why the bytes of a stage are not promised on this host; None if they are."""
    if stage not in {"trace", "observation", "labels", "shading", "encoding"}:
        return None
    if sys.platform != "linux":
        return f"bytes are promised on Linux, this is {sys.platform}"
    if stage == "trace" and platform.machine() != "x86_64":
        return f"simulation is promised on x86-64, this is {platform.machine()}"
    return None


def host_identity() -> list[str]:
    """Return an identity of this host among those that share its cache: name, architecture, CPU features."""
    return [platform.node(), platform.machine(), *features()]


def features() -> list[str]:
    """Return the CPU features, as detected by NumPy, that are known to change floating-point results of programs."""
    from numpy._core._multiarray_umath import __cpu_features__ as found

    names = ("SSE41", "SSE42", "AVX", "F16C", "FMA3", "AVX2", "AVX512F", "AVX512_SKX", "NEON", "ASIMD")
    return [name for name in names if found.get(name)]


def cannot_render_reason() -> str | None:
    """Return the reason why kernels cannot run on this CPU; None if they can."""
    if platform.machine() != "x86_64":
        return None
    from numpy._core._multiarray_umath import __cpu_features__ as features

    hidden = REQUIRED_CPU_FEATURE in os.environ.get("NPY_DISABLE_CPU_FEATURES", "").replace(",", " ").split()
    if features.get(REQUIRED_CPU_FEATURE, True) or hidden:  # hidden from NumPy, but possibly present
        return None
    return f"rendering needs a CPU with {REQUIRED_CPU_FEATURE} (any since 2011), and this one has none"


def total_memory(root: Path = Path("/")) -> int:
    """Return the bytes of memory available to this process and its children together.

    Args:
        root: the folder that contains `proc` and `sys`.
    """
    return min([os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"), *_group_limits(root)])


def process_memory_limit() -> int | None:
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


def fresh_nonce() -> int:
    """Return a number that the author of a dataset could not have predicted; no byte of a dataset depends on it."""
    return secrets.randbits(53)
