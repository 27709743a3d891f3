"""A plan to a dataset in a folder.

    simulate   every scene once, kept by digest
    take over  what the dataset that is being replaced has in common with this one
    render     shards of frames, by worker processes: observe, annotate, shade, encode, hash, write
    annotate   the files over all frames: kwcoco, COCO, MOTS, tracks; and a second look at them
    finish     plans, pictures, card, manifest; then one rename

The bytes do not depend on the count of workers, the order of shards or their size, nor on how often a build was
stopped and taken up again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build import local, provenance
from recipe_runtime.build.finalize import Finisher
from recipe_runtime.build.recipe_files import RecipeFiles
from recipe_runtime.build.repair import examine
from recipe_runtime.build.reuse import Reuse, earlier, reasons, remember
from recipe_runtime.build.worker import Job
from recipe_runtime.build.workspace import Workspace, check_out, read_manifest
from recipe_runtime.cache import pruning
from recipe_runtime.cache.store import Store, default_cache
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.timings import Stopwatch
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import builder
from recipe_runtime.dataset.assembly import Harvest
from recipe_runtime.dataset.limits import check_bounds, check_plan
from recipe_runtime.dataset.manifest import head, is_whole
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.dataset.schedule import SHARD_FRAMES, Shard, Taken, all_shards, missing_shards, simulations, views
from recipe_runtime.frames.engines import Engines, devices, real_engines

Runner = Callable[[Job, Sequence[Shard], int, local.Done, Callable[[int], None]], local.Seconds]


@dataclass(frozen=True)
class BuildResult:
    """A dataset in its place. `seconds` are summed over workers by stage; `wall` is what a clock shows."""

    path: Path
    identity: str
    manifest: Manifest
    built: bool  # False: it was there already, whole
    mended: tuple[str, ...] = ()  # what was wrong with its files, a line each, if that was looked for
    resumed: int = 0  # shards taken up from a build that was stopped
    shards: int = 0
    resumed_frames: int = 0  # the same, counted in frames
    made_frames: int = 0  # by this very build
    taken_frames: int = 0  # from the dataset that was there
    seconds: dict[str, float] = field(default_factory=dict)
    wall: float = 0.0


def build(
    dataset: DatasetPlan,
    out: Path,
    *,
    workers: int = 1,
    progress: Progress | None = None,
    cache: Path | None = None,
    device: str = "cpu",
    engines: Engines | None = None,
    shard_frames: int = SHARD_FRAMES,
    explain: Callable[[list[str]], None] | None = None,
    run: Runner = local.run,
    repair: bool = False,
    source: Path | None = None,
    replace: bool = False,
    recipe_files: RecipeFiles | None = None,
) -> BuildResult:
    """Make the dataset in `out`, with so many worker processes (0: in this one).

    Returns at once if it is there, whole by its files' sizes; with `repair`, by their bytes, and else makes again the
    frames that are not. Replaces an earlier dataset of the same recipe, and takes over from it what is the same;
    InputError if `out` holds anything else, or, unless `replace`, the dataset of another recipe. `source` is the
    recipe's file: with it, two recipes of one name are told apart (`provenance`). `explain` is told, before frames are
    made, why each stage runs. `run` does the shards: processes of this host, or a cluster's (`cluster.joined`).
    `recipe_files` are put into the dataset.
    RunError if the host fails: what is done is kept, and the next build goes on from there.
    """
    explain = explain or (lambda lines: None)
    places = devices(device) if run is local.run else (device,)  # another host's devices are not for this one to know
    start, out, most = time.perf_counter(), out.absolute(), pruning.limit()
    check_plan(dataset)
    check_bounds(dataset)  # or the dataset could not be read again
    Workspace.settle(out)
    manifest = read_manifest(out)
    examined = examine(dataset, out, progress or _silence) if repair else None
    damage = examined.damage if examined else ()
    if manifest is not None and not damage and is_whole(manifest, dataset, out):
        provenance.record(out, manifest, source)
        return BuildResult(out, manifest["identity"], manifest, built=False)
    check_out(out)
    if not replace:
        provenance.check_replaceable(out, manifest, dataset, source)
    studio = _Studio(dataset, engines or real_engines(), places, cache or default_cache(), progress or _silence)
    studio.held = examined.held if examined else None
    kept = [studio.cache] if cache else pruning.folders()
    # What a repair leaves as it was is believed no more than it was before: a stranger's stays a stranger's.
    trusted = not damage or earlier(Store(studio.cache), out) is not None
    with pruning.leased(studio.cache), _workspace(dataset, out, replace) as work, ExitStack() as hired:
        new = [scene for scene in simulations(dataset) if not Store(studio.cache).has_trace(scene)]
        alone = len(simulations(dataset)) == 1 and not repair  # else workers could not know what they will need
        if new and alone and workers and run is local.run:  # they start and load the scene while it is simulated
            seen = views(dataset)
            left = [shard for shard in all_shards(dataset, shard_frames) if not work.noted(shard, seen[shard.view])]
            if left:
                run = _by(hired.enter_context(local.Crew(studio.job(work), min(workers, len(left)), load=0)))
        harvest = studio.simulate()
        taken = studio.take_over(work, harvest, out)
        explain(list(reasons(studio.reuse, [scene.digest for scene in new], taken)))
        shards, todo = studio.render(work, harvest, taken, workers, shard_frames, run)
        hired.close()
        finisher = Finisher(dataset, harvest, work, studio.progress, studio.watch, recipe_files)
        if examined:
            examined.check(finisher.identity, work)
        work.publish(finisher.finish(studio.trace))
    if trusted:
        remember(Store(studio.cache), out, dataset)
    pruning.tidy(kept, most)
    manifest = read_manifest(out)
    assert manifest is not None
    provenance.record(out, manifest, source)
    seconds, wall = studio.watch.seconds, time.perf_counter() - start
    made, resumed = sum(shard.pictures for shard in todo), [shard for shard in shards if shard not in todo]
    return BuildResult(
        out,
        manifest["identity"],
        manifest,
        built=True,
        mended=damage,
        resumed=len(resumed),
        shards=len(shards),
        resumed_frames=sum(shard.pictures for shard in resumed),
        made_frames=made,
        taken_frames=sum(len(there.variants) * len(there.frames) for there in taken.values()),
        seconds=seconds,
        wall=wall,
    )


def kept_frames(dataset: DatasetPlan, out: Path) -> int:
    """How many frames the next build of this dataset takes up from one that was stopped."""
    return _workspace(dataset, out.absolute()).kept()


def _by(crew: local.Crew) -> Runner:
    """A runner whose workers are hired already."""
    return lambda job, shards, workers, done, tick: crew.run(shards, done, tick)


def _workspace(dataset: DatasetPlan, out: Path, replace: bool = False) -> Workspace:
    return Workspace(out, {**head(dataset), "builder": builder()}, replace=replace)


@dataclass
class _Studio:
    """The stages of one build."""

    dataset: DatasetPlan
    engines: Engines
    devices: tuple[str, ...]
    cache: Path
    progress: Progress
    watch: Stopwatch = field(default_factory=Stopwatch)
    reuse: Reuse = field(init=False)
    held: Dataset | None = None  # a dataset to mend

    def job(self, work: Workspace) -> Job:
        """What workers are told."""
        return Job(self.dataset, self.engines, self.devices, self.cache, work.dataset, resumes=True)

    def simulate(self) -> Harvest:
        """Simulate every scene; their traces are in the store then."""
        wanted, harvest = simulations(self.dataset), Harvest(self.dataset)
        self.progress("simulate", 0, len(wanted))
        with self.watch("simulate"):
            for done, (scene, value) in enumerate(self._trace_digests(wanted), start=1):
                harvest.traces[scene.digest] = value
                self.progress("simulate", done, len(wanted))
        return harvest

    def _trace_digests(self, scenes: list[ScenePlan]) -> Iterator[tuple[ScenePlan, str]]:
        """Each scene with its trace's digest; two are simulated at once, for a simulation is a process of its own."""
        if len(scenes) == 1:
            yield scenes[0], self.trace(scenes[0]).digest
            return
        with ThreadPoolExecutor(max_workers=2) as threads:
            tasks = {threads.submit(self.trace, scene): scene for scene in scenes}
            try:
                for task in as_completed(tasks):
                    yield tasks[task], task.result().digest
            except BaseException:
                threads.shutdown(wait=False, cancel_futures=True)
                raise

    def trace(self, scene: ScenePlan) -> Trace:
        """A scene's Trace, from the store if it is there."""
        return Store(self.cache).trace(scene, lambda: self.engines.simulate(scene))

    def take_over(self, work: Workspace, harvest: Harvest, out: Path) -> dict[int, Taken]:
        """Link what the dataset that stands at `out` has of this one: which frames of which variants, by view."""
        self.reuse = Reuse(self.dataset, self.held or earlier(Store(self.cache), out))
        found, seen = {}, views(self.dataset)
        for number, view in enumerate(seen):
            variants = self.reuse.covered(view)
            if not variants:
                continue
            self.progress("take over", number, len(seen))
            with self.watch("write"):
                records = self.reuse.take(work, view, variants)
            if records:
                frames = tuple(record["frame"] for record in records)
                found[number] = Taken(variants, frozenset(frames))
                harvest.add(Shard(number, frames, variants), records)
        if found:
            self.progress("take over", len(seen), len(seen))
        return found

    def render(
        self,
        work: Workspace,
        harvest: Harvest,
        taken: dict[int, Taken],
        workers: int,
        size: int,
        run: Runner,
    ) -> tuple[list[Shard], list[Shard]]:
        """Do the shards that no stopped build has finished: all that there are, and those."""
        shards, seen = missing_shards(all_shards(self.dataset, size), taken), views(self.dataset)
        todo = []
        for shard in shards:
            records = work.finished(shard, seen[shard.view])
            if records is None:
                todo.append(shard)
            else:
                harvest.add(shard, records)

        def done(shard: Shard, records: list[FrameRecord]) -> None:
            work.keep(shard, seen[shard.view], records)
            harvest.add(shard, records)

        total, so_far = sum(shard.pictures for shard in todo), 0

        def tick(count: int) -> None:
            nonlocal so_far
            so_far += count
            self.progress("render", so_far, total)

        self.progress("render", 0, total)
        for stage, seconds in run(self.job(work), todo, workers, done, tick).items():
            self.watch.add(stage, seconds)
        return shards, todo


def _silence(stage: str, done: int, total: int) -> None:
    """Progress that nobody watches."""
