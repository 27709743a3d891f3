"""Compares two recipes, plans, lockfiles or datasets, and reports the differences in causal order.

The order is that of the stages: files, versions of stages and tools, plans field by field, motion body by body, pixels
frame by frame, and for two datasets the files that their manifests list. Items that only one side has are reported but
not compared. Of a dataset, only the manifest and the plans are read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from recipe_compiler.ir.modalities import DIGEST_KINDS
from recipe_compiler.ir.plurals import count, form

from recipe_runtime.core import layout
from recipe_runtime.verify.compare import (
    Side,
    file_differences,
    frame_differences,
    new_files,
    plan_differences,
    some,
    stage_of,
    trace_differences,
)
from recipe_runtime.verify.verdict import Difference


def differences(a: Side, b: Side) -> list[Difference]:
    """Return all differences, ordered by stage: recipe, tools, plan, trace, observation, labels, shading, file."""
    found = [*_seals(a, b), *file_differences(a, b), *_versions(a, b), *plan_differences(a, b)]
    if a.locked and b.locked:
        found += [*trace_differences(a.lock, b.lock), *_frames(a, b)]
        found += _rows_of_one_side(a, b)
        if not found and a.lock.identity != b.lock.identity:
            found.append(Difference("lockfile", f"the identities differ: {a.lock.identity} and {b.lock.identity}"))
    elif not found and a.lock.plan != b.lock.plan:
        found.append(Difference("plan", f"the plans have different digests: {a.lock.plan} and {b.lock.plan}"))
    return found + _listed(a, b, only_count=bool(found))


def left_out(a: Side, b: Side) -> list[str]:
    """Return notes on what was not compared, and why."""
    notes = [side.note for side in (a, b) if side.note]
    if a.lock.files and b.lock.files and a.lock.plan == b.lock.plan:
        others = new_files(a.lock.files, b.lock.files), new_files(b.lock.files, a.lock.files)
        if any(others):
            notes.append(f"the text of {a.name} and {b.name} differs; the plan does not")
    silent = [side for side in (a, b) if not side.locked]
    if silent:
        which = f"{' and '.join(side.name for side in silent)} {form(len(silent), 'holds', 'hold')} none"
        remedy = "" if any(side.note for side in silent) else "; `recipe lock` makes a lockfile"
        notes.append(f"motion and pixels were not compared: {which}{remedy}")
    folders = [side.name for side in (a, b) if side.listed is not None]
    if folders:
        whose = form(len(folders), "its manifest", "their manifests")
        what = f"{' and '.join(folders)} {form(len(folders), 'was', 'were')} compared by {whose}"
        notes.append(f"{what}; `recipe verify` checks the files themselves")
    return notes


def _seals(a: Side, b: Side) -> Iterator[Difference]:
    """Yield lockfiles and manifests that were edited, and a difference of the name, which is part of the identity."""
    for side in (a, b):
        if not side.lock.sealed:
            yield Difference("lockfile", f"{side.name} was damaged or edited: its digests do not add up")
        elif side.listed is not None and side.plan is not None and side.plan.digest != side.lock.plan:
            message = f"{side.name} was damaged or edited: its plans and outputs do not have its plan digest"
            yield Difference("lockfile", message)
        variants = side.plan.variants if side.plan is not None else ()
        edited = [v.variant for v in variants if side.plan_digests.get(v.variant, v.digest) != v.digest]
        if edited:
            where = some(edited, "variant")
            message = f"{side.name} was damaged or edited: its manifest has another plan digest for {where}"
            yield Difference("lockfile", message)
    if a.locked and b.locked and a.lock.recipe != b.lock.recipe:
        yield Difference("recipe", f"{a.name} is of the recipe {a.lock.recipe!r}, {b.name} of {b.lock.recipe!r}")


def _rows_of_one_side(a: Side, b: Side) -> Iterator[Difference]:
    """Yield rows that only one side has although the variants are equal, and bodies that contradict their Trace."""
    if a.lock.variants != b.lock.variants:
        return
    lockfiles = a.listed is None and b.listed is None  # a dataset has no rows of bodies, and fewer tools
    kinds: list[tuple[str, Mapping[Any, Any], Mapping[Any, Any]]] = [("stage", a.lock.stages, b.lock.stages)]
    kinds += [("tool", a.lock.tools, b.lock.tools)] if lockfiles else []
    kinds += [("trace", a.lock.traces, b.lock.traces)]
    kinds += [("body", a.lock.bodies, b.lock.bodies)] if lockfiles else []
    kinds += [("frame", a.lock.frames, b.lock.frames)]
    for kind, ours, theirs in kinds:
        for side, only in ((a, ours.keys() - theirs.keys()), (b, theirs.keys() - ours.keys())):
            if only:
                rows = f"{count(len(only), f'{kind} row')} {form(len(only), 'is', 'are')}"
                yield Difference("lockfile", f"{rows} in {side.name} only (first: {min(map(str, only))})")
    other = [key for key in a.lock.bodies.keys() & b.lock.bodies.keys() if a.lock.bodies[key] != b.lock.bodies[key]]
    other = [(scene, actor) for scene, actor in other if a.lock.traces.get(scene) == b.lock.traces.get(scene)]
    if other:
        rows = f"{count(len(other), 'body row')} {form(len(other), 'differs', 'differ')}"
        yield Difference("lockfile", f"{rows} although the trace rows agree (first: {min(other)[1]})")


def _versions(a: Side, b: Side) -> Iterator[Difference]:
    """Yield differing versions of stages and tools that both sides list.

    A dataset, unlike a lockfile, lists no interpreter.
    """
    for what, ours, theirs in (("stage ", a.lock.stages, b.lock.stages), ("", a.lock.tools, b.lock.tools)):
        for name in sorted(ours):
            if name in theirs and ours[name] != theirs[name]:
                yield Difference("tools", f"{what}{name}: {ours[name]} and {theirs[name]}")


def _frames(a: Side, b: Side) -> Iterator[Difference]:
    """Yield frames that differ although plan and motion agree: one line per variant, sensor and modality."""
    rows = Counter((key, sensor, modality) for key, sensor, modality, _ in a.lock.frames.keys() & b.lock.frames.keys())
    found: dict[tuple[str, str, str], list[int]] = {}
    for d in frame_differences(a.lock, b.lock, lambda stage: None):
        found.setdefault((str(d.modality), str(d.sensor), str(d.variant)), []).append(int(d.frame or 0))
    for modality, sensor, name in sorted(found, key=lambda place: (_order(place[0]), *place)):
        frames, row = found[modality, sensor, name], b.lock.variants.get(name)
        total = rows[row.frame_key(modality) if row else name, sensor, modality]
        what = f"{modality} of {len(frames)} of {count(total, 'frame')} differs (first: frame {min(frames)})"
        yield Difference(stage_of(modality), f"{name}, {sensor}: {what}")


def _listed(a: Side, b: Side, only_count: bool) -> list[Difference]:
    """Return the files of two datasets whose bytes differ, in build order.

    Args:
        a: the first dataset.
        b: the second dataset.
        only_count: whether to report only their number, because an earlier difference is the cause.
    """
    if a.listed is None or b.listed is None:
        return []
    found = []
    for path in sorted({*a.listed, *b.listed}, key=_made):
        if path not in a.listed or path not in b.listed:
            found.append(f"{path} is in {a.name if path in a.listed else b.name} only")
        elif a.listed[path] != b.listed[path]:
            found.append(f"{path} has other bytes")
    if not only_count or not found:
        return [Difference("file", message) for message in found]
    total = count(len({*a.listed, *b.listed}), "file")
    return [
        Difference("file", f"{len(found):,} of {total} {form(len(found), 'differs', 'differ')}, the first: {found[0]}")
    ]


def _made(path: str) -> tuple[int, str]:
    """Return the sort key of a file in build order: plans, tracks, pictures, labels, annotations, sheets, README."""
    order = (
        path.startswith("plans/"),
        path.endswith(("/tracks.csv", "/events.csv")),
        path.count("/") == 3 and not path.startswith("mots/"),
        path.endswith("/labels.jsonl"),
        path.startswith(("annotations/", "mots/")),
        path in (layout.CONTACT_SHEET, layout.OVERLAY_SHEET),
    )
    return (order.index(True) if True in order else len(order)), path


def _order(modality: str) -> int:
    return DIGEST_KINDS.index(modality) if modality in DIGEST_KINDS else len(DIGEST_KINDS)
