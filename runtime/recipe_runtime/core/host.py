"""Properties of this host that may affect bytes."""

from __future__ import annotations

import os
import platform
import sys

REQUIRED_CPU_FEATURE = "AVX"  # Warp's machine code uses it even for the generic x86-64 target


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
