"""Re-render sample frames and compare them, byte for byte, with a lockfile, and with a dataset if there is one.

The stages are compared in the order in which things are made, and the first one that parts is the verdict's:

    lockfile, recipe, plan, trace, observation, labels, shading, encoding, file

A difference is FAIL if this host promises equal bytes; it is INCONCLUSIVE, with the reason, if a stage's version or
a tool that the stage depends on is another than the lockfile's.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from recipe_compiler.lockfile import Lockfile
from recipe_compiler.plan import DatasetPlan, ScenePlan

from recipe_runtime import host, locking
from recipe_runtime.engines import Engines, Progress, real_engines
from recipe_runtime.sample import Bound, draw, sample_size
from recipe_runtime.schedule import chosen_shards
from recipe_runtime.store import Store
from recipe_runtime.versions import STAGES, tool_versions

Verdict = Literal["PASS", "FAIL", "INCONCLUSIVE"]
Choice = tuple[str, str, int]  # variant, sensor, frame

ORDER = ("lockfile", "recipe", "plan", "trace", "observation", "labels", "shading", "encoding", "file")
# What a stage's bytes depend on: the stage's key in versions.STAGES, and tools.
_DEPENDS = {
    "plan": ("plan", ("astral", "rfc8785")),
    "trace": ("simulate", ("pybullet", "numpy", "glibc", "python")),
    "observation": ("observe", ("warp-lang", "numpy")),
    "labels": ("annotate", ("pycocotools", "numpy")),
    "shading": ("shade", ("warp-lang", "numpy")),
    "encoding": ("encode", ("deflate", "numpy")),
}
_STAGE_OF = {"rgb": "shading", "labels": "labels", "depth": "observation"}


@dataclass(frozen=True)
class Difference:
    """One thing that is not as the lockfile or the dataset says."""

    stage: str
    message: str
    excuse: str | None = None  # why this host need not agree; None: it must
    variant: str | None = None
    sensor: str | None = None
    frame: int | None = None
    modality: str | None = None

    def __str__(self) -> str:
        return f"{self.stage}: {self.message}" + (f" ({self.excuse})" if self.excuse else "")


@dataclass
class Report:
    """What was compared, what differs, and the verdict."""

    name: str
    identity: str
    nonce: int
    bound: Bound
    differences: list[Difference] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)

    @property
    def stage(self) -> str | None:
        """The first stage at which things part."""
        return min((d.stage for d in self.differences), key=ORDER.index, default=None)

    @property
    def verdict(self) -> Verdict:
        """FAIL if anything differs that must not; INCONCLUSIVE if something differs that may."""
        if any(d.excuse is None for d in self.differences):
            return "FAIL"
        return "INCONCLUSIVE" if self.differences else "PASS"

    def document(self) -> dict[str, Any]:
        """The report as plain JSON values."""
        bound = {"checked": self.bound.checked, "total": self.bound.total, "confidence": self.bound.confidence}
        return {
            "name": self.name,
            "identity": self.identity,
            "verdict": self.verdict,
            "stage": self.stage,
            "nonce": self.nonce,
            **bound,
            "differing_below": round(self.bound.differing, 6),
            "differences": [asdict(difference) for difference in self.differences],
            "pictures": self.pictures,
        }


@dataclass(frozen=True)
class Options:
    """How much to check. `count` frames, or as many as `confidence` and `bound` ask for; `everything` takes all."""

    nonce: int
    confidence: float = 0.95
    bound: float = 0.05
    count: int | None = None
    everything: bool = False
    workers: int = 1
    device: str = "cpu"


def verify(
    plan: DatasetPlan,
    lock: Lockfile,
    options: Options,
    progress: Progress,
    *,
    files: dict[str, str] | None = None,
    engines: Engines | None = None,
) -> Report:
    """Compare a compiled recipe with its lockfile, as far as the options ask.

    `files` are the digests of the recipe's files as they are now; None where there is only a dataset's plan.
    """
    engines = engines or real_engines()
    choices = all_choices(plan)
    chosen = choose(choices, options)
    report = Report(plan.recipe, lock.identity, options.nonce, Bound(len(chosen), len(choices), options.confidence))
    if not lock.sealed:
        message = "a digit or a line was changed by hand or damaged: the seal does not hold; `recipe lock --update` "
        report.differences.append(Difference("lockfile", message + "makes it anew"))
    if files is not None:
        report.differences += compare_files(lock, files)
    report.differences += compare_plans(plan, lock)
    other = {d.variant for d in report.differences if d.stage == "plan"}
    chosen = [choice for choice in chosen if choice[0] not in other]
    with tempfile.TemporaryDirectory(prefix="recipe-verify-") as folder:
        report.differences += _compare_made(plan, lock, chosen, engines, Path(folder), options, progress)
    return report


def all_choices(plan: DatasetPlan) -> list[Choice]:
    """Every frame of every sensor of every variant, in the dataset's order."""
    return [
        (variant.variant, sensor.name, frame)
        for variant in plan.variants
        for sensor in variant.rig.sensors
        for frame in range(variant.scene.clock.frames)
    ]


def choose(choices: list[Choice], options: Options) -> list[Choice]:
    """The sample that the options ask for."""
    if options.everything:
        return choices
    count = options.count or sample_size(len(choices), options.confidence, options.bound)
    return draw(choices, min(count, len(choices)), options.nonce)


def compare_files(lock: Lockfile, files: dict[str, str]) -> list[Difference]:
    """The recipe's files, by their bytes."""
    found = []
    for path in sorted({*lock.files, *files}):
        if lock.files.get(path) != files.get(path):
            how = "was added" if path not in lock.files else "is gone" if path not in files else "is another text"
            message = f"{path} {how} than when it was locked" if how.startswith("is a") else f"{path} {how}"
            found.append(Difference("recipe", f"{message}; `recipe lock --update` accepts it"))
    return found


def compare_plans(plan: DatasetPlan, lock: Lockfile) -> list[Difference]:
    """Every variant's three plans, by their digests."""
    found, excuse = [], excuse_of("plan", lock)
    ours = locking.bare(plan, lock.source, {}).variants
    for name in [*lock.variants, *(name for name in ours if name not in lock.variants)]:
        if name not in ours or name not in lock.variants:
            where = "the recipe" if name not in ours else "the lockfile"
            found.append(Difference("plan", f"{where} has no variant {name}", excuse, name))
            continue
        a, b = lock.variants[name], ours[name]
        parts = [part for part in ("scene", "rig", "appearance") if getattr(a, part) != getattr(b, part)]
        if parts:
            found.append(Difference("plan", f"{name}: another {' and '.join(parts)} plan", excuse, name))
    if not found and plan.digest != lock.plan:
        found.append(
            Difference("plan", "the variants are equal, their order or the outputs asked for are not", excuse=excuse)
        )
    return found


def excuse_of(stage: str, lock: Lockfile) -> str | None:
    """Why this host need not agree with the lockfile at a stage; None if it must."""
    key, tools = _DEPENDS.get(stage, ("", ()))
    if key and lock.stages.get(key) != STAGES[key]:
        release = lock.tools.get("dataset-recipe", "of another release")
        versions = f"the lockfile is of {key} version {lock.stages.get(key)}, this is {STAGES[key]}"
        return f"{versions}; dataset-recipe {release} reproduces it"
    reason = host.unfit(stage)
    if reason:
        return reason
    ours = tool_versions()
    others = [f"{t} {lock.tools[t]}, here {ours[t]}" for t in tools if t in lock.tools and lock.tools[t] != ours[t]]
    return "the lockfile was made with " + ", ".join(others) if others else None


def _compare_made(
    plan: DatasetPlan,
    lock: Lockfile,
    chosen: list[Choice],
    engines: Engines,
    folder: Path,
    options: Options,
    progress: Progress,
) -> list[Difference]:
    by_name = {v.variant: v for v in plan.variants}
    scenes = {by_name[name].scene.digest: by_name[name].scene for name, _, _ in chosen}
    traces = locking.fresh_traces(list(scenes.values()), engines, Store(folder), progress)
    found: list[Difference] = []
    for digest, trace in traces.items():
        if lock.traces.get(digest) != trace.digest:
            message = _parting(lock, scenes[digest], {a: locking.body_motion(trace, a) for a in trace.actors})
            found.append(Difference("trace", message, excuse=excuse_of("trace", lock)))
    parted = {digest for digest, trace in traces.items() if lock.traces.get(digest) != trace.digest}
    chosen = [choice for choice in chosen if by_name[choice[0]].scene.digest not in parted]
    shards = chosen_shards(plan, chosen)
    rows = locking.render_rows(plan, shards, engines, folder, options.workers, progress, options.device)
    return found + _compare_frames(plan, lock, chosen, rows)


def _parting(lock: Lockfile, scene: ScenePlan, ours: dict[str, Any]) -> str:
    """Which body parts first, and about when."""
    partings = []
    for actor, motion in ours.items():
        locked = lock.bodies.get((scene.digest, actor))
        at = locking.first_parting(locked, motion) if locked else None
        if at:
            partings.append((at[0], actor, at[1]))
    if not partings:
        return "the motion differs from the one that was locked"
    first, actor, last = min(partings)
    until = f"and {last}" if last >= first else "on"
    where = f"between frames {first} {until} (from step {first * scene.clock.steps_per_frame})"
    return f"body {actor} parts {where}; {len(partings)} of {len(ours)} bodies differ"


def _compare_frames(
    plan: DatasetPlan, lock: Lockfile, chosen: Iterable[Choice], rows: dict[Any, str]
) -> list[Difference]:
    by_name, found = {v.variant: v for v in plan.variants}, []
    keys = locking.bare(plan, lock.source, {}).variants
    for choice in chosen:
        name, sensor, frame = choice
        capture = next(s.capture for s in by_name[name].rig.sensors if s.name == sensor)
        for modality in ("depth", "instance", "semantic", "labels", "rgb"):
            if modality != "labels" and modality not in capture:
                continue
            row = (keys[name].frame_key(modality), sensor, modality, frame)
            if lock.frames.get(row) == rows[row]:
                continue
            stage = _STAGE_OF.get(modality, "observation")
            what = "differs" if row in lock.frames else "is not in the lockfile"
            message = f"{name}, {sensor}, frame {frame}: {modality} {what}"
            found.append(Difference(stage, message, excuse_of(stage, lock), *choice, modality))
            break  # what comes later follows from it
    return found
