"""Versions that bytes depend on: of each stage, increased when its bytes change on purpose, and of the tools."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from recipe_compiler.ir.canonical import digest, digest_bytes

# In pipeline order; a difference is reported at the first stage that shows it.
STAGES: dict[str, int] = {"plan": 1, "simulate": 2, "observe": 1, "shade": 1, "encode": 1, "annotate": 1}

# Packages whose code affects a Trace, and those whose code affects a frame's record: a stage's and those below it.
SIMULATION_PACKAGES = frozenset({"core", "body", "meshes", "simulation"})
FRAME_PACKAGES = SIMULATION_PACKAGES | {
    "cache", "annotate", "render", "modalities", "insertion", "dataset", "frames", "attacks", "build"
}  # fmt: skip

_TOOLS = ("dataset-recipe", "astral", "numpy", "pybullet", "pycocotools", "rfc8785", "warp-lang", "zlib-ng")


def tool_versions() -> dict[str, str]:
    """The installed version of every package that bytes depend on."""
    return {tool: _installed(tool) for tool in _TOOLS}


@cache
def _installed(tool: str) -> str:
    """Return the version of a package, read once per process: parsing its metadata takes 5 ms."""
    try:
        return version(tool)
    except PackageNotFoundError:
        return "none"


@cache
def simulator_identity() -> str:
    """Return the identity of the simulator: stage version, tools, and the code of simulation and its imports.

    A cached Trace is reused only by an equal simulator; a lockfile records the stage's version alone.
    """
    code = code_of(SIMULATION_PACKAGES)
    return digest("maker/1", {"stage": STAGES["simulate"], "tools": host_versions(), "code": code})


@cache
def builder_identity() -> str:
    """Return the identity of the code that builds: tools, interpreter, and all code that affects a frame's record.

    An unfinished build is resumed only by an equal builder.
    """
    return digest("builder/1", {"tools": host_versions(), "renderer": renderer_identity()})


@cache
def renderer_identity() -> str:
    """Return the identity of the code that renders: tools and code. Hosts with equal identities render equal frames."""
    tools = {**tool_versions(), "pillow": version("pillow")}  # decodes the images of a recipe
    return digest("renderer/1", {"stages": STAGES, "tools": tools, "code": code_of(FRAME_PACKAGES)})


def code_of(packages: frozenset[str], runtime: Path = Path(__file__).parents[1]) -> list[list[str]]:
    """Every module of these packages of the runtime, and of `recipe_compiler.ir`, with its digest.

    Args:
        packages: Names of packages, such as `simulation`.
        runtime: The folder of `recipe_runtime`.
    """
    import recipe_compiler

    compiler = Path(recipe_compiler.__file__).parent
    sources = [("runtime", runtime, packages), ("compiler", compiler, frozenset({"ir"}))]
    return [
        [f"{name}/{path.relative_to(folder).as_posix()}", digest_bytes("source/1", path.read_bytes())]
        for name, folder, parts in sources
        for path in sorted(folder.rglob("*.py"))
        if path.relative_to(folder).parts[0].removesuffix(".py") in parts
    ]


def host_versions() -> dict[str, str]:
    """The tool versions with those of the interpreter and the C library, on which simulation may depend."""
    python, glibc = ".".join(platform.python_version_tuple()[:2]), platform.libc_ver()[1] or "none"
    return {**tool_versions(), "python": python, "glibc": glibc}
