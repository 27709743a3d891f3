"""What this host is, as far as bytes may depend on it."""

from __future__ import annotations

import platform
import sys
from functools import cache
from pathlib import Path


@cache
def cpu_flags() -> frozenset[str]:
    """The CPU's features as Linux names them; empty where they cannot be read."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return frozenset()
    line = next((line for line in text.splitlines() if line.startswith("flags")), "")
    return frozenset(line.partition(":")[2].split())


def unfit(stage: str) -> str | None:
    """Why this host promises nothing for a stage (determinism tiers); None if it does."""
    if stage not in {"trace", "observation", "labels", "shading", "encoding"}:
        return None
    if sys.platform != "linux":
        return f"bytes are promised on Linux, this is {sys.platform}"
    if stage == "trace" and platform.machine() != "x86_64":
        return f"simulation is promised on x86-64, this is {platform.machine()}"
    return None
