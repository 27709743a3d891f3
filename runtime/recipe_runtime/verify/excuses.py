"""When a difference does not count against a lockfile: what this host need not make alike, and why.

A lockfile may be anyone's, and so may each version in it. If any version that differs excused any difference, whoever
forges a frame would also write another version, and FAIL would become INCONCLUSIVE. So an excuse must be one that this
project can give:

- From the Trace onward all hosts make equal bytes, with whatever tools. A difference in plans, frames or texts is
  excused by the version of a stage alone, and only by one that a release may have: a lockfile of a newer release with a
  higher version, or of an older release with a lower one. The reason names both, since that release can check it.
- A simulation may depend on the C library and Python, which differ among supported hosts, so these excuse a difference
  in the Trace, and nowhere else.
- Where pixels are proved equal, another version of the encoder explains other bytes of the file.
- The words of a dataset's README.md may change with each release.

A version that is missing, malformed or absurd excuses nothing.
"""

from __future__ import annotations

import re

from recipe_compiler.ir.lockfile import Lockfile

from recipe_runtime.core import host
from recipe_runtime.core.versions import STAGES, host_versions

_RELEASE = "dataset-recipe"

# The stages, by their names in versions.STAGES, that make something; what they are made from agrees already.
_STAGES_OF: dict[str, tuple[str, ...]] = {
    "plan": ("plan",),
    "trace": ("simulate",),
    "observation": ("observe",),
    "labels": ("observe", "annotate"),
    "shading": ("observe", "shade"),
    "texts": ("observe", "annotate"),
    "encoding": ("encode",),
}
# Tools that explain a difference to someone who may have forged the lockfile.
_TOOLS_OF = {"trace": ("glibc", "python"), "encoding": ("zlib-ng",), "card": (_RELEASE,)}
# Tools that explain a difference from the golden lockfile, which is this package's own.
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
_SPANS = {"glibc": ((2, 17), (2, 99)), "python": ((3, 6), (3, 99))}  # what there is, and will be for some time
_MAX_STAGE = 1000


def excuse_of(stage: str, lock: Lockfile) -> str | None:
    """Why this host need not agree with a lockfile at a stage, or in `texts` or the `card`; None if it must.

    The lockfile may be anyone's.
    """
    reason = host.unfit(stage) or _other_stage(stage, lock)
    if reason:
        return reason
    if stage == "trace" and "glibc" not in lock.tools:
        return "it is not said with which C library and Python it was made"
    return _other_tools(stage, lock, _TOOLS_OF)


def own_excuse_of(stage: str, golden: Lockfile) -> str | None:
    """Why this host need not agree with the golden lockfile, which nobody else wrote."""
    return excuse_of(stage, golden) or _other_tools(stage, golden, _OWN_TOOLS_OF)


def _other_stage(stage: str, lock: Lockfile) -> str | None:
    """The first version of a stage that is another release's."""
    theirs, ours = lock.tools.get(_RELEASE, ""), host_versions()[_RELEASE]
    released, here = _parsed(_RELEASE, theirs), _parsed(_RELEASE, ours)
    for name in _STAGES_OF.get(stage, ()):
        version = lock.stages.get(name, 0)
        if version == STAGES[name] or not 1 <= version <= _MAX_STAGE or released is None or here is None:
            continue
        if (version > STAGES[name]) == (released > here) and released != here:
            return (
                f"the lockfile is of {name} version {version}, this is {STAGES[name]}; dataset-recipe {theirs}"
                " reproduces it, if the lockfile tells the truth: verify it with that release"
            )
    return None


def _other_tools(stage: str, lock: Lockfile, tools: dict[str, tuple[str, ...]]) -> str | None:
    """The tools of a stage that are of another version."""
    ours = host_versions()
    found = []
    for tool in tools.get(stage, ()):
        theirs = lock.tools.get(tool)
        if theirs is not None and theirs != ours[tool] and _parsed(tool, theirs) is not None:
            found.append(f"{tool} {theirs}, here {ours[tool]}")
    return "the lockfile was made with " + ", ".join(found) if found else None


def _parsed(tool: str, version: str) -> tuple[int, int, int] | None:
    """A version's numbers; None for what cannot be one."""
    match = _VERSION.fullmatch(version)
    if match is None:
        return None
    major, minor, patch = (int(part or 0) for part in match.groups())
    low, high = _SPANS.get(tool, ((0, 0), (9999, 9999)))
    return (major, minor, patch) if low <= (major, minor) <= high else None
