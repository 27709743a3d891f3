"""What bytes depend on: the version of each stage, raised when its bytes change on purpose, and the tools."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

# In the order in which things are made; a difference is reported at the first stage where it shows.
STAGES: dict[str, int] = {"plan": 1, "simulate": 1, "observe": 1, "shade": 1, "encode": 1, "annotate": 1}

_TOOLS = ("dataset-recipe", "astral", "deflate", "numpy", "pybullet", "pycocotools", "rfc8785", "warp-lang")


def tool_versions() -> dict[str, str]:
    """The installed version of every package that bytes depend on."""
    versions = {}
    for tool in _TOOLS:
        try:
            versions[tool] = version(tool)
        except PackageNotFoundError:
            versions[tool] = "none"
    return versions


def host_versions() -> dict[str, str]:
    """The same, with the interpreter and the C library, on which simulation may depend."""
    python, glibc = ".".join(platform.python_version_tuple()[:2]), platform.libc_ver()[1] or "none"
    return {**tool_versions(), "python": python, "glibc": glibc}
