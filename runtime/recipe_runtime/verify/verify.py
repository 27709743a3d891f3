"""Re-render a sample of frames and compare them, byte for byte, with a lockfile, and with a dataset if there is one.

The stages are compared in the order of the pipeline, and the first one that differs is the verdict's:

    lockfile, recipe, plan, trace, observation, labels, shading, encoding, file
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import NoReturn

from recipe_compiler.ir import canonical
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.lockfile import FrameKey, Lockfile, VariantRow
from recipe_compiler.ir.modalities import DIGEST_KINDS
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.journal import CacheJournal
from recipe_runtime.build.resume import Resumption
from recipe_runtime.build.worker import Job
from recipe_runtime.cache.pruning import leased
from recipe_runtime.cache.store import Store
from recipe_runtime.core import host, layout
from recipe_runtime.core.files import has_content
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import builder_identity
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.reader import Dataset, Fault, damaged_files, text_differences
from recipe_runtime.dataset.schedule import chosen_shards
from recipe_runtime.frames.engines import Engines, devices, real_engines
from recipe_runtime.verify.compare import (
    compare_datasets,
    compare_files,
    compare_manifest,
    compare_plans,
    compare_rows,
    lacks_frames,
    stage_of,
    text_note,
)
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.file_comparison import FileComparison
from recipe_runtime.verify.locking import render_rows
from recipe_runtime.verify.motion_comparison import (
    OtherMotion,
    body_differences,
    matching_traces,
    motion_difference,
    scenes_to_simulate,
    tracks_differ,
)
from recipe_runtime.verify.pictures import draw_differences
from recipe_runtime.verify.recipe_comparison import recipe_differences, unpacked_assets
from recipe_runtime.verify.sampling import Bound, draw, sample_size
from recipe_runtime.verify.verdict import Difference, Report
from recipe_runtime.verify.version_comparison import version_notes

Choice = tuple[str, str, int]  # variant, sensor, frame

_NONE: Mapping[str, NoReturn] = MappingProxyType({})


@dataclass(frozen=True)
class Options:
    """How much to check: `count` frames, or as many as `confidence` and `bound` require, or `everything`."""

    nonce: int
    confidence: float = 0.95
    bound: float = 0.05
    count: int | None = None
    everything: bool = False
    workers: int = 1
    device: str = "cpu"
    pictures: Path | None = None  # a folder for pictures of frames that differ
    allow_large: bool = False  # also for the recipe in a dataset's folder
    cache: Path | None = None  # where a run over `everything` keeps its journal, and finds that of a stopped run


def verify(
    plan: DatasetPlan,
    lock: Lockfile,
    options: Options,
    progress: Progress,
    *,
    files: dict[str, str] | None = None,
    dataset: Dataset | None = None,
    traces: Mapping[str, Trace] | None = None,
    engines: Engines | None = None,
) -> Report:
    """Compare the frames that this host renders from a plan with a lockfile, and with a dataset's files.

    Args:
        lock: the expected digests.
        options: the extent of the comparison.
        files: SHA-256 of the recipe's current files; None if there is only a dataset's plan.
        dataset: the dataset whose files are compared.
        traces: the locked Traces by scene, for hosts whose own simulation need not agree.
        engines: simulation and renderer; None for the real ones.
    """
    choices = all_choices(plan)
    differences = _listed_differences(plan, lock, files, dataset)
    pictures: list[str] = []
    temporary = tempfile.TemporaryDirectory
    with leased(), temporary(prefix="recipe-verify-") as folder, temporary(prefix="recipe-assets-") as assets:
        engines = engines or real_engines(unpacked_assets(dataset, Path(assets)))
        mismatches, locked_traces = matching_traces(plan, lock, traces or {}, engines)
        differences += mismatches
        other = {d.variant for d in differences if d.stage == "plan"}
        chosen = [choice for choice in choose(choices, options) if choice[0] not in other]
        if lacks_frames(plan, lock):  # the verdict is FAIL already, and the plan is untrusted
            chosen = []
        check = _Check(plan, lock, engines, options, progress, Path(folder), dataset, locked_traces)
        compared, found = check.run(chosen)
        differences += found
        if dataset is not None:
            differences += _recipe_and_damage(differences, dataset, options, progress, check.traces)
            excuses = {**dict.fromkeys(layout.DESCRIPTIONS, excuse_of("card", lock)), **check.track_excuses()}
            faults = text_differences(dataset, check.simulated())
            differences += _not_yet_reported(differences, faults, excuse_of("texts", lock), excuses)
        if options.pictures is not None:
            pictures = check.draw(differences, options.pictures)
        check.close()
    bound = Bound(compared, len(choices), options.confidence)
    note = text_note(lock, plan.digest, files or {})
    versions = [row for held in (lock, *([dataset.lock] if dataset is not None else [])) for row in version_notes(held)]
    return Report(
        plan.recipe,
        lock.identity,
        options.nonce,
        bound,
        differences,
        pictures,
        notes=[*([note] if note else []), *check.notes, *dict.fromkeys(versions)],
        resumed=check.resumed,
    )


def verify_files(dataset: Dataset, options: Options, progress: Progress) -> Report:
    """Compare a dataset's files with its manifest, and that with its plan; nothing is simulated or rendered."""
    differences = _listed_differences(dataset.plan, dataset.lock, None, dataset)
    differences += _recipe_and_damage(differences, dataset, options, progress)
    bound = Bound(0, len(all_choices(dataset.plan)), options.confidence)
    return Report(
        dataset.plan.recipe,
        dataset.lock.identity,
        options.nonce,
        bound,
        differences,
        files=len(dataset.files),
        notes=version_notes(dataset.lock),
    )


def _listed_differences(
    plan: DatasetPlan, lock: Lockfile, files: dict[str, str] | None, dataset: Dataset | None
) -> list[Difference]:
    """Compare the digests that recipe, plan, lockfile and dataset list; nothing is rendered."""
    found = compare_rows(plan, lock, from_manifest=dataset is not None and dataset.lock is lock)
    if files is not None:
        found += compare_files(plan, lock, files)
    found += compare_plans(plan, lock)
    if dataset is not None:
        found += compare_manifest(plan, dataset)
        if dataset.lock is not lock:
            found += compare_datasets(plan, lock, dataset.lock, dataset.name)
    return found


def _recipe_and_damage(
    known: list[Difference], dataset: Dataset, options: Options, progress: Progress, traces: Mapping[str, Trace] = _NONE
) -> list[Difference]:
    """Return differences of the recipe in a dataset's folder, and of files from the manifest."""
    found = recipe_differences(dataset, options.allow_large, traces)
    return found + _not_yet_reported([*known, *found], damaged_files(dataset, progress))


def _not_yet_reported(
    known: list[Difference],
    faults: Iterable[Fault],
    excuse: str | None = None,
    excuses: Mapping[str, str | None] = _NONE,
) -> list[Difference]:
    """Return file faults as differences, skipping files already reported by an unexcused difference.

    `excuse` applies to every file, `excuses` to single paths.
    """
    reported = {d.path for d in known if d.stage == "file" and d.excuse is None}
    return [
        Difference("file", line, excuse or excuses.get(path), path=path)
        for path, line in faults
        if path not in reported
    ]


def all_choices(plan: DatasetPlan) -> list[Choice]:
    """Return every frame of every sensor of every variant, in the dataset's order."""
    return [
        (variant.variant, sensor.name, frame)
        for variant in plan.variants
        for sensor in variant.rig.sensors
        for frame in sensor.frames(variant.scene.clock.frames)
    ]


def choose(choices: list[Choice], options: Options) -> list[Choice]:
    """Draw the sample of frames that the options specify."""
    if options.everything:
        return choices
    count = options.count or sample_size(len(choices), options.confidence, options.bound)
    return draw(choices, min(count, len(choices)), options.nonce)


@dataclass
class _Check:
    """The frames of one verification: rendered into a temporary folder and compared."""

    plan: DatasetPlan
    lock: Lockfile
    engines: Engines
    options: Options
    progress: Progress
    folder: Path
    dataset: Dataset | None
    locked_traces: Mapping[str, Trace]
    traces: dict[str, Trace] = field(default_factory=dict)  # by scene, those with the locked digest
    other: dict[str, OtherMotion] = field(default_factory=dict)  # by scene, this host's, where it may differ
    resumed: int = 0  # frames resumed from the journal of a stopped run
    notes: list[str] = field(default_factory=list)
    _journal: CacheJournal | None = None

    def run(self, chosen: list[Choice]) -> tuple[int, list[Difference]]:
        """Simulate scenes and render only the chosen frames; return their number and the differences."""
        by_name = {v.variant: v for v in self.plan.variants}
        drawn = {by_name[name].scene.digest for name, _, _ in chosen}
        scenes, self.notes = scenes_to_simulate(self.plan, self.lock, drawn, self.options.nonce)
        comparable, found = self._motions(scenes)
        reason = host.cannot_render_reason() or self.engines.assets.missing(by_name[name] for name, _, _ in chosen)
        if reason:
            return 0, [*found, Difference("observation", "no frame was rendered", reason)]
        chosen = [c for c in chosen if by_name[c[0]].scene.digest in comparable]
        return len(chosen), found + self._frames(chosen)

    def _motions(self, scenes: dict[str, ScenePlan]) -> tuple[set[str], list[Difference]]:
        """Simulate the scenes; return those whose frames are to be compared, and the differences.

        If this host's simulation may differ, frames are rendered from the locked Trace next to the lockfile if there is
        one, else from this host's own: a digest of other motion, which is untrusted, exempts no frame.
        """
        store, excuse = Store(self.folder), excuse_of("trace", self.lock)
        comparable, found = set(), []
        for number, (digest, scene) in enumerate(scenes.items()):
            self.progress("simulate", number, len(scenes))
            locked_trace = self.locked_traces.get(digest)
            other: OtherMotion | None = None
            try:
                trace = store.keep_trace(scene, self.engines.simulate(scene))
            except RunError as error:
                if locked_trace is None:
                    raise
                message, reason = "it was not simulated here", str(error).splitlines()[0]
            else:
                reason = excuse or ""
                if self.lock.traces.get(digest) == trace.digest:
                    self.traces[digest] = trace
                    comparable.add(digest)
                    continue
                other = motion_difference(self.lock, scene, trace)
                message, reason = other.message, "" if other.contradiction else reason
                recorded = other.recorded or (self.dataset is not None and tracks_differ(self.dataset, scene, trace))
                other = replace(other, reason=reason, recorded=recorded)
            if locked_trace is not None and reason:
                self.traces[digest] = store.keep_trace(scene, locked_trace)
                comparable.add(digest)
                message += "; frames are compared from the locked motion on"
            elif other is not None and reason:
                self.other[digest] = other
                comparable.add(digest)
                message += "; frames are compared with those of this host's motion"
            found.append(Difference("trace", message, reason or None))
        self.progress("simulate", len(scenes), len(scenes))
        return comparable, found + body_differences(self.plan, self.lock, lambda scene: self.traces.get(scene.digest))

    def _frames(self, chosen: list[Choice]) -> list[Difference]:
        root = self.folder / "made" if self.dataset else None
        shards, options = chosen_shards(self.plan, chosen), self.options
        job = Job(self.plan, self.engines, devices(options.device), self.folder, root)
        rows, self.resumed = render_rows(job, shards, options.workers, self.progress, self._resumption(job))
        keys = digests.bare(self.plan, "", {}).variants
        found = [self._frame(choice, keys[choice[0]], rows) for choice in chosen]
        differences = [difference for difference in found if difference is not None]
        if self.dataset is not None and root is not None:
            differences += FileComparison(self.plan, self.lock, self.dataset, root, self.other).differences()
        return differences

    def simulated(self) -> dict[str, Trace]:
        """Return the motion by scene: the locked one, or this host's."""
        return {**self.traces, **{scene: other.trace for scene, other in self.other.items()}}

    def track_excuses(self) -> dict[str, str]:
        """Return, by path, the reason why `tracks.csv` and `events.csv` may differ: motion may differ on this host."""
        found = [(v, self.other.get(v.scene.digest)) for v in self.plan.variants]
        files = layout.tracks_file, layout.events_file
        return {file(v.variant): other.reason for v, other in found if other is not None for file in files}

    def _resumption(self, job: Job) -> Resumption | None:
        """Return the journal of a run with the same plan, motion, code, host and device."""
        if self.options.cache is None or not self.options.everything:
            return None
        traces = {scene: trace.digest for scene, trace in self.simulated().items()}
        parts = [self.plan.digest, builder_identity(), traces, host.host_identity(), list(job.devices)]
        self._journal = CacheJournal(self.options.cache, canonical.digest("journal/verify/1", parts))
        return Resumption(self._journal, self._equals_dataset)

    def _equals_dataset(self, records: list[FrameRecord]) -> bool:
        """Return whether the rendered files of these frames, since deleted, were equal to the dataset's."""
        if self.dataset is None:
            return True
        root, rows = self.dataset.root, [row for record in records for row in record["files"].items()]
        return bool(rows) and all(has_content(root, path, row[0], row[1]) for path, row in rows)

    def close(self) -> None:
        """Delete the journal: the run is finished."""
        if self._journal is not None:
            self._journal.remove()

    def _frame(self, choice: Choice, key: VariantRow, rows: dict[FrameKey, str]) -> Difference | None:
        """Return the first difference of a frame from the lockfile, by modality; later ones follow from it."""
        name, sensor, frame = choice
        rig = next(v.rig for v in self.plan.variants if v.variant == name)
        capture = next(s.capture for s in rig.sensors if s.name == sensor)
        for modality in (m for m in DIGEST_KINDS if m == "labels" or m in capture):
            row = (key.frame_key(modality), sensor, modality, frame)
            if self.lock.frames.get(row) != rows[row]:
                stage, other = stage_of(modality), self.other.get(key.scene)
                excused = other is not None and row in self.lock.frames and other.excuses(modality, frame)
                what = "differs" if row in self.lock.frames else "has no digest there"
                message = f"{name}, {sensor}, frame {frame}: {modality} {what}"
                return Difference(
                    stage,
                    message,
                    other.reason if other is not None and excused else excuse_of(stage, self.lock),
                    *(name, sensor, frame, modality),
                    recorded=self.lock.frames.get(row),
                    rendered=rows[row],
                )
        return None

    def draw(self, differences: list[Difference], out: Path) -> list[str]:
        """Write pictures of the first frames that differ, and return their paths."""
        store, device = Store(self.folder), self.options.device
        return draw_differences(
            differences, self.plan, self.dataset, out, engines=self.engines, store=store, device=device
        )
