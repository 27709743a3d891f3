"""Compares a recipe's files, plans and frames with a lockfile, digest by digest."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import PurePosixPath

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.core import layout
from recipe_runtime.core.versions import STAGES
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.verdict import ORDER, Difference
from recipe_runtime.verify.version_comparison import tool_faults

Excuse = Callable[[str, Lockfile], str | None]  # (stage, lockfile) -> reason why the stage may differ, as in `excuses`

_STAGE_OF = {"rgb": "shading", "labels": "labels", "depth": "observation"}


def stage_of(modality: str) -> str:
    """Return the stage that produces a modality."""
    return _STAGE_OF.get(modality, "observation")


def compare_files(plan: DatasetPlan, lock: Lockfile, files: dict[str, str]) -> list[Difference]:
    """Compare the bytes of the recipe's files, if the plan differs from the locked one.

    Comments and file names are not part of the identity. If only the text changed, `text_note` reports it.
    """
    if plan.digest == lock.plan:
        return []
    found = []
    for path in sorted({*lock.files, *files}):
        if lock.files.get(path) != files.get(path):
            how = "is new" if path not in lock.files else "is gone" if path not in files else "has changed"
            found.append(Difference("recipe", f"{path} {how} since it was locked; lock the recipe again to accept it"))
    return found


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
    found, excuse = [], excuse_for("plan", lock)
    ours = digests.bare(plan, lock.source, {}).variants
    for name in [*lock.variants, *(name for name in ours if name not in lock.variants)]:
        if name not in ours or name not in lock.variants:
            where = "the recipe" if name not in ours else "the lockfile"
            found.append(Difference("plan", f"{where} has no variant {name}", excuse, name))
            continue
        a, b = lock.variants[name], ours[name]
        parts = [part for part in ("scene", "rig", "appearance") if getattr(a, part) != getattr(b, part)]
        if parts:
            found.append(Difference("plan", f"{name}: different {' and '.join(parts)} plan", excuse, name))
    if not found and (plan.digest != lock.plan or list(ours) != list(lock.variants)):  # the identity covers the order
        found.append(
            Difference("plan", "the variants are equal, but their order or the requested outputs differ", excuse=excuse)
        )
    return found


def compare_manifest(plan: DatasetPlan, dataset: Dataset) -> list[Difference]:
    """Compare the parts of a dataset that no identity covers: description, outputs, and the plans in its folder.

    Args:
        plan: the plan of the recipe or, without a recipe, the dataset's own. A recipe's plan is compared with the
            manifest's digests; here, these are compared with the dataset's own plan, which determines its files.
        dataset: the dataset; each plan digest is compared with the plan in its folder.
    """
    found, excuse = [], excuse_of("plan", dataset.lock)
    if dataset.plan.description != plan.description:
        message = f"{layout.MANIFEST}: the description of the dataset is not the recipe's"
        found.append(Difference("recipe", message))
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
    found = []
    if not lock.sealed:
        found.append("it was damaged or edited: its digests do not add up")
    if lock.recipe != plan.recipe:
        found.append(f"it is of the recipe {lock.recipe!r}, and this is {plan.recipe!r}")
    found += tool_faults(lock)
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
    found = compare_plans(plan, held) + _digests(lock, held)
    if not held.sealed:
        found.append(Difference("lockfile", "it was damaged or edited: its digests do not add up to its identity"))
    if held.recipe != plan.recipe:
        found.append(Difference("lockfile", f"it is of the recipe {held.recipe!r}, and this is {plan.recipe!r}"))
    missing, surplus = sorted(STAGES.keys() - held.stages.keys()), sorted(held.stages.keys() - STAGES.keys())
    messages = [*tool_faults(held), *_uneven("stage", missing, surplus)]
    found += [Difference("lockfile", message) for message in messages]
    return [replace(difference, message=f"{name}: {difference.message}") for difference in found]


def _digests(lock: Lockfile, made: Lockfile, excuse_for: Excuse = excuse_of) -> list[Difference]:
    """Compare the motion and the frames that both contain."""
    found = []
    for scene, trace in made.traces.items():
        if scene in lock.traces and lock.traces[scene] != trace:
            found.append(Difference("trace", f"scene {scene[:16]} has different motion", excuse_for("trace", lock)))
    names = {v.frame_key(m): n for n, v in reversed(made.variants.items()) for m in ("rgb", "labels")}
    for row, value in made.frames.items():
        if row in lock.frames and lock.frames[row] != value:
            key, sensor, modality, frame = row
            stage, name = stage_of(modality), names[key]
            message = f"{name}, {sensor}, frame {frame}: {modality} differs"
            found.append(Difference(stage, message, excuse_for(stage, lock), name, sensor, frame, modality))
    return found
