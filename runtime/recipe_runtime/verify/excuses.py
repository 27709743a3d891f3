"""Reasons why a difference from a lockfile or dataset is INCONCLUSIVE and not FAIL.

A lockfile may have been written by anyone, and so may each version in it. If any version that differs excused any
difference, an attacker could forge a frame, change a version, and turn FAIL into INCONCLUSIVE. An excuse must therefore
be a version that this project can produce:

- From the Trace onward, all hosts produce equal bytes with any tools. A difference in plans, frames or texts is
  excused only by the version of a stage in another release: a higher version in a newer release, or a lower one in an
  older release. The reason names that release, which can check the frames.
- A simulation may depend on the C library and on Python, which differ among supported hosts. They excuse a difference
  in the Trace, and nowhere else.
- If the pixels are proved equal, another version of the encoder excuses other bytes of the file.
- The text of a dataset's README.md may change with each release.

A missing, malformed or implausible version excuses nothing.
"""

from __future__ import annotations

import re

from recipe_compiler.ir.lockfile import Lockfile

from recipe_runtime.core import host
from recipe_runtime.core.versions import STAGES, host_versions

_RELEASE = "dataset-recipe"

# The stages in versions.STAGES whose outputs may differ; inputs of a stage have been compared before.
_STAGES_OF: dict[str, tuple[str, ...]] = {
    "plan": ("plan",),
    "trace": ("simulate",),
    "observation": ("observe",),
    "labels": ("observe", "annotate"),
    "shading": ("observe", "shade"),
    "texts": ("observe", "annotate"),
    "encoding": ("encode",),
}
# Tools that may excuse a difference from a lockfile of unknown origin.
_TOOLS_OF = {"trace": ("glibc", "python"), "encoding": ("zlib-ng",), "card": (_RELEASE,)}
# Tools that may excuse a difference from the golden lockfile, which is part of this package.
_OWN_TOOLS_OF = {
    "plan": ("astral", "rfc8785"),
    "trace": ("pybullet", "numpy", "glibc", "python"),
    "observation": ("warp-lang", "numpy"),
    "labels": ("pycocotools", "numpy"),
    "shading": ("warp-lang", "numpy"),
    "texts": (_RELEASE, "pycocotools"),
    "encoding": ("zlib-ng", "numpy"),
}
_VERSION = re.compile(r"(\d{1,4})\.(\d{1,4})(?:\.(\d{1,4}))?(?:\.?[a-z]+\d{0,6})?")
_SPANS = {"glibc": ((2, 17), (2, 99)), "python": ((3, 6), (3, 99))}  # plausible versions, existing and future
_MAX_STAGE = 1000


def excuse_of(stage: str, lock: Lockfile) -> str | None:
    """Return the reason why this host may differ from a lockfile of unknown origin at a stage, or None.

    Args:
        stage: a stage, or `texts` or `card`.
        lock: the lockfile.
    """
    reason = host.unsupported_reason(stage) or release_excuse(stage, lock)
    if reason:
        return reason
    if stage == "trace" and "glibc" not in lock.tools:
        return "it does not state its versions of the C library and of Python"
    return _other_tools(stage, lock, _TOOLS_OF)


def own_excuse_of(stage: str, golden: Lockfile) -> str | None:
    """Return the reason why this host may differ from the golden lockfile, whose origin is known, or None."""
    return excuse_of(stage, golden) or _other_tools(stage, golden, _OWN_TOOLS_OF)


def release_excuse(stage: str, lock: Lockfile) -> str | None:
    """Return the first stage version that belongs to another release, in words; None if there is none."""
    theirs, ours = lock.tools.get(_RELEASE, ""), host_versions()[_RELEASE]
    released, here = _parsed(_RELEASE, theirs), _parsed(_RELEASE, ours)
    for name in _STAGES_OF.get(stage, ()):
        version = lock.stages.get(name, 0)
        if version == STAGES[name] or not 1 <= version <= _MAX_STAGE or released is None or here is None:
            continue
        if (version > STAGES[name]) == (released > here) and released != here:
            return (
                f"the lockfile is of {name} version {version}, this is {STAGES[name]}; dataset-recipe {theirs}"
                " reproduces it, if the lockfile is genuine: verify it with that release"
            )
    return None


def _other_tools(stage: str, lock: Lockfile, tools: dict[str, tuple[str, ...]]) -> str | None:
    """Return the tools of a stage whose version differs, in words."""
    ours = host_versions()
    found = []
    for tool in tools.get(stage, ()):
        theirs = lock.tools.get(tool)
        if theirs is not None and theirs != ours[tool] and _parsed(tool, theirs) is not None:
            found.append(f"{tool} {theirs}, here {ours[tool]}")
    return "the lockfile was made with " + ", ".join(found) if found else None


def _parsed(tool: str, version: str) -> tuple[int, int, int] | None:
    """Return the numbers of a version; None if it is malformed or implausible."""
    match = _VERSION.fullmatch(version)
    if match is None:
        return None
    major, minor, patch = (int(part or 0) for part in match.groups())
    low, high = _SPANS.get(tool, ((0, 0), (9999, 9999)))
    return (major, minor, patch) if low <= (major, minor) <= high else None
