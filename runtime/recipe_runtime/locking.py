"""Plans and frames to lockfile rows; the same rows whether a build, `recipe lock` or the verifier asks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from recipe_compiler.canonical import digest
from recipe_compiler.errors import RecipeError
from recipe_compiler.lockfile import BodyMotion, FrameKey, Lockfile, VariantRow, skeleton
from recipe_compiler.plan import DatasetPlan, ScenePlan

from recipe_runtime import pool
from recipe_runtime.admission import check_bounds
from recipe_runtime.engines import Engines, Progress, devices, real_engines
from recipe_runtime.housekeeping import leased
from recipe_runtime.journal import CacheJournal, ShardJournal, digests_only
from recipe_runtime.schedule import Shard, Taken, View, all_shards, missing_shards, simulations, views
from recipe_runtime.store import Store
from recipe_runtime.trace import Trace
from recipe_runtime.versions import STAGES, builder, host_versions
from recipe_runtime.worker import FrameRecord, Job

CHECKPOINTS = 64  # at most so many a body; they tell about when a motion parts
CHECKPOINT_DIGITS = 8

Proof = Callable[[dict[str, str], Progress], Sequence[tuple[Shard, list[FrameRecord]]]]


@dataclass
class Known:
    """Frames that `lock` need not render, because this host has rendered them before.

    `cache`: where the journal of a lock that was stopped is kept, and this one's. `proof`: which frames a dataset
    proves, given the digest of every scene's motion (`reuse.known_frames`).
    """

    cache: Path
    proof: Proof = lambda traces, progress: ()
    taken_frames: int = 0  # from the dataset
    resumed_frames: int = 0  # from the journal
    _journal: CacheJournal | None = field(default=None, init=False)

    def begin(
        self, plan: DatasetPlan, traces: dict[str, str], progress: Progress
    ) -> tuple[dict[FrameKey, str], list[Shard], CacheJournal]:
        """The rows that the dataset proves, the shards without them, and the journal of the rest."""
        seen, rows, taken = views(plan), dict[FrameKey, str](), dict[int, Taken]()
        for shard, records in self.proof(traces, progress):
            taken[shard.view] = Taken(shard.variants, frozenset(shard.frames))
            self.taken_frames += shard.pictures
            rows.update(row for record in records for row in frame_rows(plan, seen[shard.view], record))
        # Every device makes the same bytes, so the journal may be continued on another one.
        key = digest("journal/lock/1", [plan.digest, builder(), traces])
        self._journal = CacheJournal(self.cache, key, plan)
        return rows, missing_shards(all_shards(plan), taken), self._journal

    def kept_frames(self) -> int:
        """The number of frames in the journal of a lock that was stopped."""
        return 0 if self._journal is None else self._journal.frames()

    def close(self) -> None:
        """Delete the journal, once the lockfile is written."""
        if self._journal is not None:
            self._journal.remove()


def lock(
    plan: DatasetPlan,
    source: str,
    files: dict[str, str],
    *,
    workers: int,
    progress: Progress,
    engines: Engines | None = None,
    device: str = "cpu",
    traces: dict[str, Trace] | None = None,
    known: Known | None = None,
) -> Lockfile:
    """Simulate every scene and render every frame that is not `known`, keep none, and list their digests.

    `traces` is filled with the motion of each scene, by its digest.
    """
    check_bounds(plan)  # or the lockfile could not be read again
    engines = engines or real_engines()
    with leased(), tempfile.TemporaryDirectory(prefix="recipe-lock-") as folder:
        made = fresh_traces(simulations(plan), engines, Store(Path(folder)), progress)
        job = Job(plan, engines, devices(device), Path(folder), None)
        if known is None:
            frames = render_rows(job, all_shards(plan), workers, progress)
        else:
            digests = {scene: trace.digest for scene, trace in made.items()}
            rows, shards, journal = known.begin(plan, digests, progress)
            resumption = Resumption(journal)
            frames = rows | render_rows(job, shards, workers, progress, resumption)
            known.resumed_frames = resumption.frames
    if traces is not None:
        traces.update(made)
    return with_rows(bare(plan, source, files), made, simulations(plan), frames)


def bare(plan: DatasetPlan, source: str, files: dict[str, str]) -> Lockfile:
    """The lockfile of a plan before anything was simulated."""
    return skeleton(plan, source, files, host_versions(), STAGES)


def with_rows(
    bare_lock: Lockfile, traces: dict[str, Trace], scenes: list[ScenePlan], frames: dict[FrameKey, str]
) -> Lockfile:
    """The same lockfile with its traces, bodies and frames filled in."""
    bodies = {
        (scene.digest, actor): motion
        for scene in scenes
        for actor, motion in body_motions(traces[scene.digest]).items()
    }
    return replace(bare_lock, traces={key: trace.digest for key, trace in traces.items()}, bodies=bodies, frames=frames)


def fresh_traces(scenes: list[ScenePlan], engines: Engines, store: Store, progress: Progress) -> dict[str, Trace]:
    """Simulate every scene anew, into a store that workers read; a bad entry of the user's cache is replaced."""
    traces = {}
    for number, scene in enumerate(scenes):
        progress("simulate", number, len(scenes))
        traces[scene.digest] = store.trace(scene, lambda scene=scene: engines.simulate(scene))  # type: ignore[misc]
        Store().replace_bad_trace(scene, traces[scene.digest])
    progress("simulate", len(scenes), len(scenes))
    return traces


@dataclass
class Resumption:
    """A journal to continue. `usable` says whether the records of a shard still hold; `frames`: how many were used."""

    journal: ShardJournal
    usable: Callable[[list[FrameRecord]], bool] = lambda records: True
    frames: int = 0

    def finished(self, shard: Shard, view: View) -> list[FrameRecord] | None:
        """The records of a shard that a stopped run finished."""
        records = self.journal.read(shard, view)
        if records is None or not self.usable(records):
            return None
        self.frames += shard.pictures
        return records

    def record(self, shard: Shard, view: View, records: list[FrameRecord]) -> None:
        """Record a finished shard; where the cache cannot be written, the run cannot be resumed, and goes on."""
        with suppress(RecipeError, OSError):
            self.journal.write(shard, view, digests_only(records))


def render_rows(
    job: Job, shards: list[Shard], workers: int, progress: Progress, resumption: Resumption | None = None
) -> dict[FrameKey, str]:
    """Do the shards, with the traces in the job's cache, and list the digests of their frames."""
    plan = job.dataset
    found: dict[FrameKey, str] = {}
    plan_views, todo, count = views(plan), list[Shard](), 0

    def add(shard: Shard, records: list[FrameRecord]) -> None:
        for record in records:
            found.update(frame_rows(plan, plan_views[shard.view], record))

    for shard in shards:
        records = None if resumption is None else resumption.finished(shard, plan_views[shard.view])
        if records is None:
            todo.append(shard)
        else:
            add(shard, records)
    total = sum(shard.pictures for shard in todo)

    def done(shard: Shard, records: list[FrameRecord]) -> None:
        if resumption is not None:
            resumption.record(shard, plan_views[shard.view], records)
        add(shard, records)

    def tick(pictures: int) -> None:
        nonlocal count
        count += pictures
        progress("render", count, total)

    pool.run(job, todo, workers, done, tick)
    return found


def frame_rows(plan: DatasetPlan, view: View, record: FrameRecord) -> Iterator[tuple[FrameKey, str]]:
    """The rows of one frame of one view: its labels for every observation, its colours for every scenario."""
    by_name = {plan.variants[i].variant: plan.variants[i] for i in view.variants}
    for scenario in by_name.values():
        key = VariantRow(scenario.scene.digest, scenario.rig.digest, scenario.appearance.digest)
        for modality, value in record["digests"].items():
            yield (key.frame_key(modality), view.sensor.name, modality, record["frame"]), value
        if scenario.variant in record["rgb"]:
            yield (key.frame_key("rgb"), view.sensor.name, "rgb", record["frame"]), record["rgb"][scenario.variant]


def frame_keys(plan: DatasetPlan) -> Iterator[FrameKey]:
    """The key of every row that `frame_rows` makes of a whole dataset."""
    for v in plan.variants:
        row = VariantRow(v.scene.digest, v.rig.digest, v.appearance.digest)
        for sensor in v.rig.sensors:
            for modality in (*sensor.capture, "labels"):
                key = row.frame_key(modality)
                yield from ((key, sensor.name, modality, frame) for frame in range(v.scene.clock.frames))


def body_motions(trace: Trace) -> dict[str, BodyMotion]:
    """The digest of each actor's motion, and short digests of how it went that far."""
    stride = -(-trace.frames // CHECKPOINTS)
    digests = trace.prefix_digests([*range(stride, trace.frames + 1, stride), trace.frames])
    return {
        actor: BodyMotion(whole, stride, tuple(point[:CHECKPOINT_DIGITS] for point in points))
        for actor, (*points, whole) in digests.items()
    }


def first_parting(locked: BodyMotion, ours: BodyMotion) -> tuple[int, int] | None:
    """The frames between which two motions part, [first, last]; None if they are equal."""
    if locked == ours:
        return None
    if locked.stride == ours.stride:
        for index, (a, b) in enumerate(zip(locked.checkpoints, ours.checkpoints, strict=False)):
            if a != b:
                return index * ours.stride, (index + 1) * ours.stride - 1
    return len(ours.checkpoints) * ours.stride, -1


def parting_words(first: int, last: int) -> str:
    """When two motions part, in words, from what `first_parting` says."""
    if last < first:
        return f"from frame {first} on"
    return f"at frame {first}" if first == last else f"between frames {first} and {last}"
