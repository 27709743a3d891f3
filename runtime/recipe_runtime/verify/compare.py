"""Compares what two recipes, lockfiles or datasets record: files, plans, motion and frames, digest by digest.

`recipe diff` compares any two sides; `recipe verify` and `recipe build` compare a recipe's plan with a lockfile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.modalities import CHOICES, LABEL_MODALITIES, form_of
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.plurals import count, form

from recipe_runtime.core import layout
from recipe_runtime.core.versions import STAGES
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.verify.documents import plan_fields
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.verdict import ORDER, Difference
from recipe_runtime.verify.version_comparison import tool_faults

Excuse = Callable[[str, Lockfile], str | None]  # (stage, lockfile) -> reason why the stage may differ, as in `excuses`


def stage_of(name: str) -> str:
    """Return the stage that produces a modality, or the labels."""
    return "observation" if name in LABEL_MODALITIES else "labels" if name == "labels" else "shading"


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
    plan: DatasetPlan | None = None
    listed: Mapping[str, str] | None = None
    plan_digests: Mapping[str, str] = field(default_factory=dict)
    note: str | None = None
    finished: bool = False

    @property
    def locked(self) -> bool:
        """Whether it has digests of motion and pixels."""
        return self.finished or bool(self.lock.frames or self.lock.traces)


def new_files(files: Mapping[str, str], others: Mapping[str, str]) -> list[str]:
    """Return the files whose content does not occur among the others, under any name."""
    known = set(others.values())
    return [path for path, value in sorted(files.items()) if value not in known]


def file_differences(a: Side, b: Side, changed: str = "differs") -> Iterator[Difference]:
    """Yield the recipe's files that differ; none if the plans are equal or one side lists no files.

    Args:
        a: the first side.
        b: the second side.
        changed: what a message says of a file that both sides have.
    """
    if not a.lock.files or not b.lock.files or a.lock.plan == b.lock.plan:
        return
    first, second = ({*new_files(x.lock.files, y.lock.files)} for x, y in ((a, b), (b, a)))
    for path in sorted(first & second):
        yield Difference("recipe", f"{path} {changed}")
    only_first, only_second = sorted(first - second), sorted(second - first)
    if len(only_first) == len(only_second) == 1:  # the recipe itself, under two names
        yield Difference("recipe", f"{only_first[0]} and {only_second[0]} differ")
        return
    for side, paths in ((a, only_first), (b, only_second)):
        yield from (Difference("recipe", f"{path} is in {side.name} only") for path in paths)


def plan_differences(a: Side, b: Side, excuse: str | None = None) -> Iterator[Difference]:
    """Yield differences of the variants: field by field if both plans are known, else by the digests of their parts.

    Two plans of one variant each are compared although its names differ.
    """
    ours, theirs = a.lock.variants, b.lock.variants
    pairs = [(name, name) for name in ours if name in theirs]
    if a.plan and b.plan and len(ours) == len(theirs) == 1 and not pairs:
        pairs = list(zip(ours, theirs, strict=True))
        yield Difference("plan", f"{a.name} is variant {pairs[0][0]}, and {b.name} is variant {pairs[0][1]}")
    else:
        for side, other in ((a, theirs), (b, ours)):
            only = [name for name in side.lock.variants if name not in other]
            yield from (Difference("plan", f"variant {name} is in {side.name} only", excuse, name) for name in only)
    if a.plan and b.plan:
        plans = [{v.variant: v for v in plan.variants} for plan in (a.plan, b.plan)]
        for message, names in plan_fields([(one, plans[0][one], plans[1][two]) for one, two in pairs]).items():
            yield Difference("plan", f"{names[0] if len(names) == 1 else some(names, 'variant')}: {message}")
    else:
        for name, _ in pairs:
            parts = [p for p in ("scene", "rig", "appearance") if getattr(ours[name], p) != getattr(theirs[name], p)]
            if parts:
                yield Difference("plan", f"{name}: different {' and '.join(parts)} plan", excuse, name)
    if [name for name in ours if name in theirs] != [name for name in theirs if name in ours]:
        yield Difference("plan", "the variants are in another order", excuse)
    if a.plan and b.plan:
        for what, first, second in (
            ("output.annotations", ", ".join(a.plan.annotations), ", ".join(b.plan.annotations)),
            *((f"output.{m}", form_of(m, a.plan.forms).name, form_of(m, b.plan.forms).name) for m in CHOICES),
        ):
            if first != second:
                yield Difference("plan", f"{what}: {first or 'none'} in {a.name}, {second or 'none'} in {b.name}")


def trace_differences(a: Lockfile, b: Lockfile, excuse: str | None = None) -> Iterator[Difference]:
    """Yield scenes with equal plans and different motion, with the first body that differs, and its frames."""
    found: dict[str, list[tuple[int, str, int]]] = {}  # by scene
    for (scene, actor), motion in a.bodies.items():
        other = b.bodies.get((scene, actor))
        at = digests.first_divergence(motion, other) if other else None
        if at:
            found.setdefault(scene, []).append((at[0], actor, at[1]))
    for scene, value in a.traces.items():
        if b.traces.get(scene, value) == value:
            continue
        message = f"scene {scene[:16]} has different motion"
        if scene in found:
            first, actor, last = min(found[scene])
            bodies = f"{count(len(found[scene]), 'body', 'bodies')} {form(len(found[scene]), 'differs', 'differ')}"
            message = f"body {actor} diverges {digests.divergence_text(first, last)}; {bodies}"
        yield Difference("trace", message, excuse)


def frame_differences(a: Lockfile, b: Lockfile, excuse: Callable[[str], str | None]) -> Iterator[Difference]:
    """Yield the frames that both have, with other digests; `excuse` returns a reason for differences at a stage."""
    names = {row.frame_key(m): name for name, row in reversed(b.variants.items()) for m in ("rgb", "labels")}
    for row, value in b.frames.items():
        if a.frames.get(row, value) != value:
            key, sensor, modality, frame = row
            stage, name = stage_of(modality), names.get(key, key)
            message = f"{name}, {sensor}, frame {frame}: {modality} differs"
            yield Difference(stage, message, excuse(stage), name, sensor, frame, modality)


def some(names: Sequence[str], what: str) -> str:
    """Return a name in words, or the number of several and the first."""
    return f"{what} {names[0]}" if len(names) == 1 else f"{count(len(names), what)} (first: {names[0]})"


def compare_files(plan: DatasetPlan, lock: Lockfile, files: dict[str, str]) -> list[Difference]:
    """Compare the bytes of the recipe's files, if the plan differs from the locked one.

    Comments and file names are not part of the identity. If only the text changed, `text_note` reports it.
    """
    recipe = Side("the recipe", digests.bare(plan, "", files))
    changed = "has changed since it was locked; lock the recipe again to accept it"
    return list(file_differences(Side("the lockfile", lock), recipe, changed))


def text_note(lock: Lockfile, plan: str, files: Mapping[str, str]) -> str | None:
    """Return a one-line note if files were changed or renamed since they were locked and the plan is equal, or None.

    Args:
        lock: the lockfile.
        plan: the digest of the plan that the files compile to now.
        files: SHA-256 of the recipe's files, by path.
    """
    if lock.plan != plan or not lock.files:
        return None
    locked = set(lock.files.values())
    changed = sorted(path for path, value in files.items() if value not in locked)
    source = PurePosixPath(lock.source).name
    renamed = source in lock.files and source not in files
    new = sorted(files.keys() - lock.files.keys()) if renamed else []
    names = [path for path in new if PurePosixPath(path).suffix == PurePosixPath(source).suffix]  # not of a picture
    if names:
        text = ", with another text" if names[0] in changed else ""
        return f"{names[0]} was locked as {source}{text}; the plan is equal"
    if not changed:
        return None
    rest = f" and {count(len(changed) - 1, 'more file')}" if len(changed) > 1 else ""
    return f"the text of {changed[0]}{rest} has changed since it was locked; the plan has not"


def compare_plans(plan: DatasetPlan, lock: Lockfile, excuse_for: Excuse = excuse_of) -> list[Difference]:
    """Compare the digests of every variant's three plans."""
    excuse = excuse_for("plan", lock)
    recipe = Side("the recipe", digests.bare(plan, lock.source, {}))
    found = list(plan_differences(Side("the lockfile", lock), recipe, excuse))
    if not found and plan.digest != lock.plan:
        found.append(Difference("plan", "the variants are equal, but the requested outputs differ", excuse))
    return found


def compare_manifest(plan: DatasetPlan, dataset: Dataset) -> list[Difference]:
    """Compare the parts of a dataset that no identity covers: description, `about`, outputs, and the plans in it.

    Args:
        plan: the plan of the recipe or, without a recipe, the dataset's own. A recipe's plan is compared with the
            manifest's digests; here, these are compared with the dataset's own plan, which determines its files.
        dataset: the dataset; each plan digest is compared with the plan in its folder.
    """
    found, excuse = [], excuse_of("plan", dataset.lock)
    for key in ("description", "about"):
        if getattr(dataset.plan, key) != getattr(plan, key):
            found.append(Difference("recipe", f"{layout.MANIFEST}: the {key} of the dataset is not the recipe's"))
    own = compare_plans(dataset.plan, dataset.lock) if dataset.plan is not plan else []
    found += [replace(difference, message=f"{layout.MANIFEST}: {difference.message}") for difference in own]
    return found + [
        Difference("plan", f"{layout.MANIFEST}: the plan digest of {v.variant} is not that of its plan", excuse)
        for v in dataset.plan.variants
        if dataset.plan_digests.get(v.variant) != v.digest
    ]


def compare_rows(plan: DatasetPlan, lock: Lockfile, *, from_manifest: bool = False) -> list[Difference]:
    """Check that a lockfile is complete and has exactly the rows of motion and frames that the plan requires.

    Args:
        plan: the plan.
        lock: the lockfile.
        from_manifest: whether the rows were read from a dataset's manifest, which has none of bodies.
    """
    found = _faults(plan, lock)
    agreed = {name: row for name, row in digests.bare(plan, "", {}).variants.items() if lock.variants.get(name) == row}
    if len(agreed) == len(plan.variants) == len(lock.variants):
        kinds = (
            ("stage", set(STAGES), set(lock.stages)),
            ("trace", {v.scene.digest for v in plan.variants}, set(lock.traces)),
            ("body", set() if from_manifest else _body_keys(plan), set(lock.bodies)),
            ("frame", set(digests.frame_keys(plan)), set(lock.frames)),
        )
        for kind, ours, theirs in kinds:
            found += _uneven(kind, sorted(map(str, ours - theirs)), sorted(map(str, theirs - ours)))
    return [Difference("lockfile", message) for message in found]


def _faults(plan: DatasetPlan, lock: Lockfile) -> list[str]:
    """Return messages on a broken seal, another recipe's name, and rows of tools that no release writes."""
    damage = [] if lock.sealed else ["it was damaged or edited: its digests do not add up"]
    named = [] if lock.recipe == plan.recipe else [f"it is of the recipe {lock.recipe!r}, and this is {plan.recipe!r}"]
    return [*damage, *named, *tool_faults(lock)]


def _body_keys(plan: DatasetPlan) -> set[tuple[str, str]]:
    return {(v.scene.digest, actor.name) for v in plan.variants for actor in v.scene.actors}


def lacks_frames(plan: DatasetPlan, lock: Lockfile) -> bool:
    """Return whether a lockfile of exactly this plan lacks the digests of some frames."""
    if digests.bare(plan, "", {}).variants != lock.variants:
        return False
    return any(key not in lock.frames for key in digests.frame_keys(plan))


def _uneven(kind: str, missing: list[str], surplus: list[str]) -> list[str]:
    rows = ((missing, "lacks", f"{kind} row"), (surplus, "has", f"surplus {kind} row"))
    return [f"it {verb} {count(len(keys), what)} (first: {keys[0]})" for keys, verb, what in rows if keys]


def compare_locks(
    plan: DatasetPlan, lock: Lockfile, made: Lockfile, excuse_for: Excuse = excuse_of
) -> list[Difference]:
    """Compare a finished build with a lockfile, stage by stage."""
    found = compare_rows(plan, lock) + compare_files(plan, lock, made.files) + compare_plans(plan, lock, excuse_for)
    found += _digests(lock, made, excuse_for)
    if not found and (lock.traces.keys(), lock.frames.keys()) != (made.traces.keys(), made.frames.keys()):
        found.append(Difference("lockfile", "the dataset has digests of other frames or scenes"))
    return sorted(found, key=lambda difference: ORDER.index(difference.stage))


def compare_datasets(plan: DatasetPlan, lock: Lockfile, held: Lockfile, name: str) -> list[Difference]:
    """Compare the digests `held` of a dataset called `name` with a recipe's plan and its lockfile."""
    missing, surplus = sorted(STAGES.keys() - held.stages.keys()), sorted(held.stages.keys() - STAGES.keys())
    messages = [*_faults(plan, held), *_uneven("stage", missing, surplus)]
    found = compare_plans(plan, held) + _digests(lock, held, excuse_of)
    found += [Difference("lockfile", message) for message in messages]
    return [replace(difference, message=f"{name}: {difference.message}") for difference in found]


def _digests(lock: Lockfile, made: Lockfile, excuse_for: Excuse) -> list[Difference]:
    """Compare the motion and the frames that both contain."""
    found = trace_differences(lock, made, excuse_for("trace", lock))
    return [*found, *frame_differences(lock, made, lambda stage: excuse_for(stage, lock))]
