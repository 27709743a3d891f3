"""Compares two recipes, plans, lockfiles or datasets, and reports the differences in causal order.

The order is that of the stages: files, versions of stages and tools, plans field by field, motion body by body, pixels
frame by frame, and for two datasets the files that their manifests list. Items that only one side has are reported but
not compared. Of a dataset, only the manifest and the plans are read.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.modalities import DIGEST_KINDS
from recipe_compiler.ir.plan import AppearancePlan, DatasetPlan, Looks, RigPlan, ScenarioPlan, ScenePlan
from recipe_compiler.ir.plurals import count, form

from recipe_runtime.core import layout
from recipe_runtime.dataset.digests import divergence_text, first_divergence
from recipe_runtime.verify.compare import stage_of
from recipe_runtime.verify.documents import walk
from recipe_runtime.verify.verdict import Difference

MAX_FIELDS = 12  # limit of reported fields per plan; the rest is counted
_PARTS = ("scene", "rig", "appearance")

_Messages: TypeAlias = tuple[list[str], int]
"""The first fields that differ, at most MAX_FIELDS, and the number of all."""
_Part: TypeAlias = "ScenePlan | RigPlan | Looks"


@dataclass(frozen=True)
class Side:
    """One of the two compared items.

    Attributes:
        name: the name in messages.
        lock: the digests; without motion and pixels for a plan, or for a recipe without a lockfile.
        plan: the plan, if there is one.
        listed: SHA-256 by path, of the files that a dataset's manifest lists.
        plan_digests: digests of plans by variant, that a dataset's manifest lists.
        note: a remark on this side for the user.
        finished: whether it is a lockfile or a dataset, in which missing rows of motion and pixels are a difference.
    """

    name: str
    lock: Lockfile
    plan: DatasetPlan | None
    listed: Mapping[str, str] | None = None
    plan_digests: Mapping[str, str] = field(default_factory=dict)
    note: str | None = None
    finished: bool = False

    @property
    def locked(self) -> bool:
        """Whether it has digests of motion and pixels."""
        return self.finished or bool(self.lock.frames or self.lock.traces)


def differences(a: Side, b: Side) -> list[Difference]:
    """Return all differences, ordered by stage: recipe, tools, plan, trace, observation, labels, shading, file."""
    found = [*_seals(a, b), *_files(a, b), *_versions(a, b), *_variants(a, b)]
    if a.locked and b.locked:
        found += [*_traces(a, b), *_frames(a, b)]
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
        others = _alone(a.lock.files, b.lock.files), _alone(b.lock.files, a.lock.files)
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
            where = _some(edited, "variant")
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


def _files(a: Side, b: Side) -> Iterator[Difference]:
    ours, theirs = a.lock.files, b.lock.files
    if not ours or not theirs or a.lock.plan == b.lock.plan:
        return  # a dataset or a plan lists no files; or the same plan with other text
    first, second = _alone(ours, theirs), _alone(theirs, ours)
    for path in sorted({*first} & {*second}):
        yield Difference("recipe", f"{path} differs")
    only_first, only_second = sorted({*first} - {*second}), sorted({*second} - {*first})
    if len(only_first) == len(only_second) == 1:  # the recipe itself, under two names
        yield Difference("recipe", f"{only_first[0]} and {only_second[0]} differ")
        return
    for side, paths in ((a, only_first), (b, only_second)):
        yield from (Difference("recipe", f"{path} is in {side.name} only") for path in paths)


def _alone(files: Mapping[str, str], others: Mapping[str, str]) -> list[str]:
    """Return the files whose content does not occur among the others, under any name."""
    known = set(others.values())
    return [path for path, value in sorted(files.items()) if value not in known]


def _versions(a: Side, b: Side) -> Iterator[Difference]:
    """Yield differing versions of stages and tools that both sides list.

    A dataset, unlike a lockfile, lists no interpreter.
    """
    for what, ours, theirs in (
        ("stage ", a.lock.stages, b.lock.stages),
        ("", a.lock.tools, b.lock.tools),
    ):
        for name in sorted(ours):
            if name in theirs and ours[name] != theirs[name]:
                yield Difference("tools", f"{what}{name}: {ours[name]} and {theirs[name]}")


def _variants(a: Side, b: Side) -> Iterator[Difference]:
    ours, theirs = a.lock.variants, b.lock.variants
    if a.plan and b.plan and len(ours) == len(theirs) == 1 and ours.keys() != theirs.keys():
        one, other_one = a.plan.variants[0], b.plan.variants[0]
        yield Difference("plan", f"{a.name} is variant {one.variant}, and {b.name} is variant {other_one.variant}")
        yield from (Difference("plan", message) for message in _PlanFields().of(one, other_one))
        return
    for side, other in ((a, b), (b, a)):
        only = [name for name in side.lock.variants if name not in other.lock.variants]
        if only:
            yield Difference("plan", f"{_some(only, 'variant')} {form(len(only), 'is', 'are')} in {side.name} only")
    shared = [name for name in ours if name in theirs]
    if a.plan and b.plan:
        yield from _fields(shared, a.plan, b.plan)
    else:
        for name in shared:
            parts = [part for part in _PARTS if getattr(ours[name], part) != getattr(theirs[name], part)]
            if parts:
                yield Difference("plan", f"{name}: different {' and '.join(parts)} plan")
    if [n for n in theirs if n in ours] != shared:
        yield Difference("plan", "the variants are in another order")
    if a.plan and b.plan:
        for what, first, second in (
            ("output.annotations", ", ".join(a.plan.annotations), ", ".join(b.plan.annotations)),
            ("output.depth", a.plan.depth, b.plan.depth),
        ):
            if first != second:
                yield Difference("plan", f"{what}: {first or 'none'} in {a.name}, {second or 'none'} in {b.name}")


def _fields(shared: list[str], a: DatasetPlan, b: DatasetPlan) -> Iterator[Difference]:
    """Yield differences field by field; a difference common to many variants is reported once."""
    seen: dict[str, list[str]] = {}
    fields, ours, theirs = _PlanFields(), *({v.variant: v for v in plan.variants} for plan in (a, b))
    for name in shared:
        for message in fields.of(ours[name], theirs[name]):
            seen.setdefault(message, []).append(name)
    for message, names in seen.items():
        yield Difference("plan", f"{names[0] if len(names) == 1 else _some(names, 'variant')}: {message}")


class _PlanFields:
    """The differing fields of pairs of plans; parts that several variants share are compared once."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str, str], _Messages] = {}

    def of(self, a: ScenarioPlan, b: ScenarioPlan) -> list[str]:
        """Return the fields in which two plans differ, at most MAX_FIELDS of each part, and the number of the rest."""
        found: list[str] = []
        for part, ours, theirs in (("scene", a.scene, b.scene), ("rig", a.rig, b.rig)):
            if ours.digest != theirs.digest:
                found += _shown(self._once(part, ours, theirs), part)
        if a.appearance.digest != b.appearance.digest:
            found += _shown(self._of_appearance(a.appearance, b.appearance), "appearance")
        return found

    def _of_appearance(self, ours: AppearancePlan, theirs: AppearancePlan) -> _Messages:
        """Compare the colours last: they are those of a whole town, and many variants share them."""
        own, other = (plan.model_dump(mode="json", exclude={"looks"}) for plan in (ours, theirs))
        messages, number = _first(walk(own, other, "appearance"))
        if ours.looks.digest != theirs.looks.digest:
            colours, more = self._once("appearance.looks", ours.looks, theirs.looks)
            messages, number = [*messages, *colours][:MAX_FIELDS], number + more
        return messages, number

    def _once(self, path: str, ours: _Part, theirs: _Part) -> _Messages:
        key = path, ours.digest, theirs.digest
        if key not in self._known:
            self._known[key] = _first(walk(ours.model_dump(mode="json"), theirs.model_dump(mode="json"), path))
        return self._known[key]


def _first(messages: Iterator[str]) -> _Messages:
    """Return the first messages, at most MAX_FIELDS, and the number of all."""
    first = list(itertools.islice(messages, MAX_FIELDS))
    return first, len(first) + sum(1 for _ in messages)


def _shown(messages: _Messages, part: str) -> list[str]:
    first, number = messages
    rest = number - len(first)
    return [*first, f"and {count(rest, 'more field', 'more fields')} of the {part} plan"] if rest else first


def _traces(a: Side, b: Side) -> Iterator[Difference]:
    """Yield scenes with equal plans and different motion, with the first body that differs and the frames."""
    found: dict[str, list[tuple[int, str, int]]] = {}  # by scene
    for (scene, actor), motion in a.lock.bodies.items():
        other = b.lock.bodies.get((scene, actor))
        at = first_divergence(motion, other) if other else None
        if at:
            found.setdefault(scene, []).append((at[0], actor, at[1]))
    for scene, value in a.lock.traces.items():
        if b.lock.traces.get(scene, value) == value:
            continue
        divergences = found.get(scene)
        if not divergences:
            yield Difference("trace", f"scene {scene[:16]} has different motion")
            continue
        first, actor, last = min(divergences)
        differ = f"{count(len(divergences), 'body', 'bodies')} {form(len(divergences), 'differs', 'differ')}"
        yield Difference("trace", f"body {actor} diverges {divergence_text(first, last)}; {differ}")


def _frames(a: Side, b: Side) -> Iterator[Difference]:
    """Yield frames that differ although plan and motion agree: one line per variant, sensor and modality."""
    names = {row.frame_key(m): name for name, row in reversed(a.lock.variants.items()) for m in ("rgb", "labels")}
    cases: dict[tuple[str, str, str], list[int]] = {}
    totals: dict[tuple[str, str, str], int] = {}
    for (key, sensor, modality, frame), value in a.lock.frames.items():
        other = b.lock.frames.get((key, sensor, modality, frame))
        if other is None:
            continue
        place = (key, sensor, modality)
        totals[place] = totals.get(place, 0) + 1
        if other != value:
            cases.setdefault(place, []).append(frame)
    for key, sensor, modality in sorted(cases, key=_order):
        frames, place = cases[key, sensor, modality], (key, sensor, modality)
        where = f"{names.get(key, key)}, {sensor}"
        what = f"{modality} of {len(frames)} of {count(totals[place], 'frame')} differs (first: frame {min(frames)})"
        yield Difference(stage_of(modality), f"{where}: {what}")


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


def _order(place: tuple[str, str, str]) -> tuple[int, str, str]:
    return (DIGEST_KINDS.index(place[2]) if place[2] in DIGEST_KINDS else len(DIGEST_KINDS), place[1], place[0])


def _some(names: Iterable[str], what: str) -> str:
    known = list(names)
    return f"{what} {known[0]}" if len(known) == 1 else f"{count(len(known), what)} (first: {known[0]})"
