"""Compares the versions that a lockfile or manifest lists with those of this release and host.

Versions are not part of the identity, and anyone can write them. They are checked by form, and shown if they differ.
"""

from __future__ import annotations

import re

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plurals import count

from recipe_runtime.core.versions import STAGES, host_versions, tool_versions

_RELEASE = "dataset-recipe"
_FORM = re.compile(r"none|[0-9][0-9A-Za-z.+-]{0,60}")
_SHOWN = 40  # characters of an invalid row in messages


def tool_faults(lock: Lockfile) -> list[str]:
    """Return messages on the rows of tools that no release writes: unknown names, and malformed versions.

    A lockfile of another release may name other tools.
    """
    ours = host_versions()
    other_release = _is_other_release(lock.tools.get(_RELEASE), ours[_RELEASE])
    unknown = [] if other_release else sorted(tool for tool in lock.tools if tool not in ours)
    malformed = sorted(tool for tool, version in lock.tools.items() if not _FORM.fullmatch(version))
    found = []
    if unknown:
        found.append(f"it lists {count(len(unknown), 'unknown tool')} (first: {_quoted(unknown[0])})")
    if malformed:
        version = _quoted(lock.tools[malformed[0]])
        found.append(
            f"it lists {count(len(malformed), 'malformed version')} (first: {version} of {_quoted(malformed[0])})"
        )
    return found


def version_notes(lock: Lockfile) -> list[str]:
    """Return a note of one line each on versions of stages and tools that differ from those here or are missing."""
    ours, notes = host_versions(), []
    stages = [f"{stage} {lock.stages[stage]} (here {STAGES[stage]})" for stage in STAGES if _differs(lock, stage)]
    if stages:
        notes.append(f"the recorded versions of stages differ from those of this release: {', '.join(stages)}")
    tools = [
        f"{tool} {lock.tools[tool]} (here {ours[tool]})"
        for tool in sorted(lock.tools)
        if tool in ours and lock.tools[tool] != ours[tool] and _FORM.fullmatch(lock.tools[tool])
    ]
    if tools:
        notes.append(f"the recorded versions of tools differ from those here: {', '.join(tools)}")
    missing = [tool for tool in tool_versions() if tool not in lock.tools]
    if missing:
        notes.append(f"versions of tools are not recorded: {', '.join(missing)}")
    return notes


def _differs(lock: Lockfile, stage: str) -> bool:
    return stage in lock.stages and lock.stages[stage] != STAGES[stage]


def _is_other_release(theirs: str | None, ours: str) -> bool:
    return theirs is not None and theirs != ours and _FORM.fullmatch(theirs) is not None


def _quoted(text: str) -> str:
    """Return text of a lockfile quoted and escaped, cut to a limit."""
    return ascii(text if len(text) <= _SHOWN else f"{text[:_SHOWN]}...")
