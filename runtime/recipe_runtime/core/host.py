"""What this host is, as far as bytes may depend on it."""

from __future__ import annotations

import os
import platform
import sys

NEEDED = "AVX"  # Warp's machine code uses it even for the generic x86-64 target


def unfit(stage: str) -> str | None:
    """Why this host promises nothing for a stage (determinism tiers); None if it does."""
    if stage not in {"trace", "observation", "labels", "shading", "encoding"}:
        return None
    if sys.platform != "linux":
        return f"bytes are promised on Linux, this is {sys.platform}"
    if stage == "trace" and platform.machine() != "x86_64":
        return f"simulation is promised on x86-64, this is {platform.machine()}"
    return None


def name() -> list[str]:
    """What tells this host from others that may share its cache: its name, its architecture, its CPU's features."""
    return [platform.node(), platform.machine(), *features()]


def features() -> list[str]:
    """Those of this CPU's features that have been seen to change other programs' bytes, as numpy detects them."""
    from numpy._core._multiarray_umath import __cpu_features__ as found

    names = ("SSE41", "SSE42", "AVX", "F16C", "FMA3", "AVX2", "AVX512F", "AVX512_SKX", "NEON", "ASIMD")
    return [name for name in names if found.get(name)]


def cannot_render() -> str | None:
    """Why kernels cannot run on this CPU at all; None if they can."""
    if platform.machine() != "x86_64":
        return None
    from numpy._core._multiarray_umath import __cpu_features__ as features

    hidden = NEEDED in os.environ.get("NPY_DISABLE_CPU_FEATURES", "").replace(",", " ").split()
    if features.get(NEEDED, True) or hidden:  # what is hidden from numpy may still be there
        return None
    return f"rendering needs a CPU with {NEEDED} (any since 2011), and this one has none"
