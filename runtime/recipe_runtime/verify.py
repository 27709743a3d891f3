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

from recipe_compiler.lockfile import FrameKey, Lockfile, VariantRow
from recipe_compiler.plan import DatasetPlan, ScenePlan

from recipe_runtime import host, layout, locking
from recipe_runtime.dataset import Dataset, damaged_files
from recipe_runtime.engines import Engines, Progress, real_engines
from recipe_runtime.report.difference import differing_pixels, write_difference
from recipe_runtime.sample import Bound, draw, sample_size
from recipe_runtime.schedule import chosen_shards
from recipe_runtime.shot import shot
from recipe_runtime.store import Store
from recipe_runtime.versions import STAGES, host_versions
from recipe_runtime.worker import Job

Verdict = Literal["PASS", "FAIL", "INCONCLUSIVE"]
Choice = tuple[str, str, int]  # variant, sensor, frame

ORDER = ("lockfile", "recipe", "plan", "trace", "observation", "labels", "shading", "encoding", "file")
MOST_PICTURES = 8
# What a stage's bytes depend on, once all before it agree: stages by their names in versions.STAGES, and tools.
_DEPENDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "plan": (("plan",), ("astral", "rfc8785")),
    "trace": (("simulate",), ("pybullet", "numpy", "glibc", "python")),
    "observation": (("observe",), ("warp-lang", "numpy")),
    "labels": (("observe", "annotate"), ("pycocotools", "numpy")),
    "shading": (("observe", "shade"), ("warp-lang", "numpy")),
    "encoding": (("encode",), ("deflate", "numpy")),
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
    pictures: Path | None = None  # a folder for pictures of frames that differ


def verify(
    plan: DatasetPlan,
    lock: Lockfile,
    options: Options,
    progress: Progress,
    *,
    files: dict[str, str] | None = None,
    dataset: Dataset | None = None,
    engines: Engines | None = None,
) -> Report:
    """Compare what a plan makes on this host with a lockfile, and with a dataset's files, as far as the options ask.

    `files` are the digests of the recipe's files as they are now; None where there is only a dataset's plan.
    """
    engines = engines or real_engines()
    choices = all_choices(plan)
    chosen = choose(choices, options)
    report = Report(plan.recipe, lock.identity, options.nonce, Bound(len(chosen), len(choices), options.confidence))
    if not lock.sealed:
        what = "the manifest" if dataset else "the lockfile"
        report.differences.append(Difference("lockfile", f"{what} was damaged or edited: its digests do not add up"))
    if files is not None:
        report.differences += compare_files(lock, files)
    report.differences += compare_plans(plan, lock)
    other = {d.variant for d in report.differences if d.stage == "plan"}
    chosen = [choice for choice in chosen if choice[0] not in other]
    with tempfile.TemporaryDirectory(prefix="recipe-verify-") as folder:
        check = _Check(plan, lock, engines, options, progress, Path(folder), dataset)
        report.differences += check.run(chosen)
        if dataset is not None:
            damaged = damaged_files(dataset, progress)
            report.differences += [Difference("file", message) for message in damaged]
        if options.pictures is not None:
            report.pictures = check.draw(report.differences, options.pictures)
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
            how = "is new" if path not in lock.files else "is gone" if path not in files else "has changed"
            found.append(Difference("recipe", f"{path} {how} since it was locked; `recipe lock --update` accepts it"))
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


def compare_locks(plan: DatasetPlan, lock: Lockfile, made: Lockfile) -> list[Difference]:
    """What a finished build differs in from a lockfile, stage by stage."""
    found = compare_files(lock, made.files) + compare_plans(plan, lock)
    for scene, trace in made.traces.items():
        if lock.traces.get(scene, trace) != trace:
            found.append(Difference("trace", f"scene {scene[:16]} moves otherwise", excuse_of("trace", lock)))
    for row, value in made.frames.items():
        if lock.frames.get(row, value) != value:
            key, sensor, modality, frame = row
            stage = _STAGE_OF.get(modality, "observation")
            name = next(n for n, v in made.variants.items() if v.frame_key(modality) == key)
            message = f"{name}, {sensor}, frame {frame}: {modality} differs"
            found.append(Difference(stage, message, excuse_of(stage, lock), name, sensor, frame, modality))
    return sorted(found, key=lambda difference: ORDER.index(difference.stage))


def excuse_of(stage: str, lock: Lockfile) -> str | None:
    """Why this host need not agree with the lockfile at a stage; None if it must."""
    stages, tools = _DEPENDS.get(stage, ((), ()))
    for key in stages:
        if lock.stages.get(key) != STAGES[key]:
            release = lock.tools.get("dataset-recipe", "of another release")
            versions = f"the lockfile is of {key} version {lock.stages.get(key)}, this is {STAGES[key]}"
            return f"{versions}; dataset-recipe {release} reproduces it"
    reason = host.unfit(stage)
    if reason:
        return reason
    ours = host_versions()
    others = [f"{t} {lock.tools[t]}, here {ours[t]}" for t in tools if t in lock.tools and lock.tools[t] != ours[t]]
    return "the lockfile was made with " + ", ".join(others) if others else None


@dataclass
class _Check:
    """The frames of one verification: made anew in a folder of their own, and compared."""

    plan: DatasetPlan
    lock: Lockfile
    engines: Engines
    options: Options
    progress: Progress
    folder: Path
    dataset: Dataset | None

    def run(self, chosen: list[Choice]) -> list[Difference]:
        """Simulate the scenes of the chosen frames, render the frames alone, and say what differs."""
        by_name = {v.variant: v for v in self.plan.variants}
        scenes = {by_name[name].scene.digest: by_name[name].scene for name, _, _ in chosen}
        traces = locking.fresh_traces(list(scenes.values()), self.engines, Store(self.folder), self.progress)
        found = []
        for digest, trace in traces.items():
            if self.lock.traces.get(digest) != trace.digest:
                motions = {actor: locking.body_motion(trace, actor) for actor in trace.actors}
                message = _parting(self.lock, scenes[digest], motions)
                found.append(Difference("trace", message, excuse_of("trace", self.lock)))
        whole = {digest for digest, trace in traces.items() if self.lock.traces.get(digest) == trace.digest}
        reason = host.cannot_render()
        if reason:
            return [*found, Difference("observation", "no frame was rendered", reason)]
        return found + self._frames([c for c in chosen if by_name[c[0]].scene.digest in whole])

    def _frames(self, chosen: list[Choice]) -> list[Difference]:
        root = self.folder / "made" if self.dataset else None
        shards, options = chosen_shards(self.plan, chosen), self.options
        job = Job(self.plan, self.engines, options.device, self.folder, root)
        rows = locking.render_rows(job, shards, options.workers, self.progress)
        keys = locking.bare(self.plan, "", {}).variants
        found = []
        for choice in chosen:
            different = self._frame(choice, keys[choice[0]], rows)
            if different is None and self.dataset:
                different = self._file(choice, self.dataset)
            found += [different] if different else []
        return found

    def _frame(self, choice: Choice, key: VariantRow, rows: dict[FrameKey, str]) -> Difference | None:
        """The first of a frame's modalities that differs from the lockfile; what comes later follows from it."""
        name, sensor, frame = choice
        for modality in self._modalities(choice, ("depth", "instance", "semantic", "labels", "rgb")):
            row = (key.frame_key(modality), sensor, modality, frame)
            if self.lock.frames.get(row) != rows[row]:
                stage = _STAGE_OF.get(modality, "observation")
                what = "differs" if row in self.lock.frames else "has no digest there"
                message = f"{name}, {sensor}, frame {frame}: {modality} {what}"
                return Difference(stage, message, excuse_of(stage, self.lock), name, sensor, frame, modality)
        return None

    def _file(self, choice: Choice, dataset: Dataset) -> Difference | None:
        """The first of a frame's files whose bytes are not those made here; equal pixels are a matter of encoding."""
        name, sensor, frame = choice
        for modality in self._modalities(choice, ("depth", "instance", "semantic", "rgb")):
            path = layout.frame_file(name, sensor, modality, frame, self.plan.depth)
            made, there = self.folder / "made" / path, dataset.root / path
            if not there.is_file() or made.read_bytes() == there.read_bytes():
                continue  # a missing file is reported with the damaged ones
            count = differing_pixels(made, there)
            if count == 0:
                message = f"{path}: equal pixels, encoded otherwise"
                return Difference("encoding", message, excuse_of("encoding", self.lock), name, sensor, frame, modality)
            how = "cannot be read" if count is None else f"{count} pixels differ"
            return Difference("file", f"{path}: {how}", None, name, sensor, frame, modality)
        return None

    def _modalities(self, choice: Choice, order: Iterable[str]) -> list[str]:
        rig = next(v.rig for v in self.plan.variants if v.variant == choice[0])
        capture = next(s.capture for s in rig.sensors if s.name == choice[1])
        return [m for m in order if m == "labels" or m in capture]

    def draw(self, differences: list[Difference], out: Path) -> list[str]:
        """Pictures of the first frames that differ: what is there, what was made here, and where they differ."""
        pictures: list[str] = []
        cases = [d for d in differences if d.modality not in (None, "labels")]
        for case in cases[:MOST_PICTURES]:
            assert case.variant is not None and case.sensor is not None
            scenario = next(v for v in self.plan.variants if v.variant == case.variant)
            made = shot(
                scenario, case.sensor, case.frame, case.modality, engines=self.engines, store=Store(self.folder)
            )
            there = None
            if self.dataset:
                path = layout.frame_file(case.variant, case.sensor, made.modality, made.frame, self.plan.depth)
                there = self.dataset.root / path
            stem = f"{layout.folder(case.variant)}-{layout.folder(case.sensor)}-{made.modality}-{made.frame:06d}"
            pictures += [str(path) for path in write_difference(out / stem, made, there)]
        return pictures


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
