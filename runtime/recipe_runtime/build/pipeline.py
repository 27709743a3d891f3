"""Build a dataset from its plan.

    simulate   simulate every scene once; Traces are stored by digest
    reuse      link the frames that the dataset being replaced has in common with this one
    render     shards of frames, by worker processes: observe, annotate, shade, encode, hash, write
    annotate   write the annotation files over all frames (kwcoco, COCO, MOTS, tracks), and check them
    finish     write plans, contact sheets, card and manifest; then publish the dataset by one rename

The bytes do not depend on the number of workers, the order or size of shards, or how often a build was stopped and
continued.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.build import local, provenance
from recipe_runtime.build.finalize import Finisher
from recipe_runtime.build.output_folder import check_out, read_manifest
from recipe_runtime.build.recipe_files import RecipeFiles
from recipe_runtime.build.repair import Examined, examine
from recipe_runtime.build.resume import Runner, render_unfinished
from recipe_runtime.build.reuse import Reuse, earlier, reasons, remember
from recipe_runtime.build.worker import Job
from recipe_runtime.build.workspace import BuildJob, Workspace
from recipe_runtime.cache import pruning
from recipe_runtime.cache.journal_key import journal_key, read_key
from recipe_runtime.cache.store import Store, default_cache
from recipe_runtime.core import subprocesses
from recipe_runtime.core.files import plain_path
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.timings import Timings
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import builder_identity
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.assembly import FrameAssembly
from recipe_runtime.dataset.manifest import head, is_whole
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.plan_checks import check_plan
from recipe_runtime.dataset.plan_reader import check_readable
from recipe_runtime.dataset.schedule import (
    SHARD_FRAMES,
    ReusedFrames,
    Shard,
    all_shards,
    missing_shards,
    simulations,
    views,
)
from recipe_runtime.frames.engines import Engines, devices, real_engines


@dataclass(frozen=True)
class BuildResult:
    """A dataset in its folder. `seconds` are summed over workers by stage; `wall` is elapsed time."""

    path: Path
    identity: str
    manifest: Manifest
    built: bool  # False: it existed already, complete
    repaired: tuple[str, ...] = ()  # messages on the repaired files, one per file
    resumed: int = 0  # shards continued from a stopped build
    shards: int = 0
    resumed_frames: int = 0  # the same, counted in frames
    made_frames: int = 0  # rendered by this build
    taken_frames: int = 0  # reused from the existing dataset
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
    used: Collection[Path] = (),
) -> BuildResult:
    """Build a dataset in the folder `out`, or return at once if it exists already.

    An earlier dataset of the same recipe in `out` is replaced; what the two have in common is reused.

    Args:
        dataset: the plan.
        out: the dataset's folder.
        workers: number of worker processes; 0 renders in this process.
        progress: called with the stage, the steps done and the steps in all.
        cache: the cache's folder; None for the user's.
        device: `cpu`, `cuda` or `cuda:N`.
        engines: simulation and renderer; None for the real ones.
        shard_frames: number of frames in a shard.
        explain: called once, before frames are rendered, with the reason for each stage that runs or does not.
        run: renders the shards: `local.run`, or a cluster's runner (`ray.joined`).
        repair: whether the files of an existing dataset are compared by bytes instead of sizes, and frames that
            differ are rendered again.
        source: the recipe's file; with it, two recipes of one name are distinguished (`provenance`).
        replace: whether the dataset of another recipe may be replaced.
        recipe_files: files to put into the dataset's `recipe/` folder.
        used: the paths of the recipe's files and of its lockfile.

    Raises:
        InputError: `out` contains something other than a dataset or, unless `replace`, the dataset of another recipe;
            or `source` or a file of `used` is in the dataset to be replaced, or a lockfile that would be lost; or the
            cache is in `out`.
        RunError: the host failed. Finished shards are kept, and the next build continues.
    """
    places = devices(device) if run is local.run else (device,)  # nodes of a cluster may have other devices
    job = Job(dataset, engines or real_engines(), places, cache or default_cache(), None, resumes=True)
    stages = _Stages(job, progress or _no_progress, workers, shard_frames, run, explain)
    pruned = [job.cache] if cache else pruning.folders()
    sources = _Sources(source, recipe_files, used)
    return _build(stages, plain_path(out.absolute()), sources, pruned, repair=repair, replace_other=replace)


@dataclass(frozen=True)
class _Sources:
    """The files that a dataset is built from; `build` describes the fields."""

    source: Path | None
    recipe_files: RecipeFiles | None
    used: Collection[Path]


def _build(
    stages: _Stages,
    out: Path,
    sources: _Sources,
    pruned: list[Path],
    *,
    repair: bool,
    replace_other: bool,
) -> BuildResult:
    """Build as `build` describes; afterwards prune the cache folders `pruned`."""
    start, cache_limit, dataset, store = time.perf_counter(), pruning.limit(), stages.dataset, Store(stages.job.cache)
    source, files = sources.source, sources.recipe_files
    check_plan(dataset)
    check_readable(dataset)
    Workspace.settle(out)
    there, manifest = manifest_reader.stamp(out), read_manifest(out)
    stages.examined = examine(dataset, out, stages.progress) if repair else None
    damage = stages.examined.damage if stages.examined else ()
    readable = not repair or stages.examined is not None
    if manifest is not None and readable and not damage and is_whole(manifest, dataset, out):
        provenance.record(out, manifest, source)
        return BuildResult(out, manifest["identity"], manifest, built=False)
    check_out(out, [store.root, *pruned])
    provenance.check_outside(out, manifest, dataset, source, files, sources.used)
    if not replace_other:
        provenance.check_replaceable(out, manifest, dataset, source)
        provenance.check_recipe_kept(out, manifest, dataset, source, files, repaired=repair)
    if manifest is not None and files is not None:
        used = sources.used
        files = files.in_place_of(out, manifest, dataset, used, repaired=repair, replaced=replace_other)
    # A repair renders only damaged frames, so a dataset that another program built remains untrusted.
    trusted = not damage or earlier(store, out) is not None
    with (
        pruning.leased(store.root),
        _workspace(dataset, out, journal_key(store.root), replace_other, there) as work,
    ):
        counts, manifest = stages.run_all(work, out, files)
    if trusted:
        remember(store, out, dataset)
    pruning.auto_prune(pruned, cache_limit)
    provenance.record(out, manifest, source)
    return BuildResult(
        out,
        manifest["identity"],
        manifest,
        built=True,
        repaired=damage,
        resumed=counts.resumed,
        shards=counts.shards,
        resumed_frames=counts.resumed_frames,
        made_frames=counts.made_frames,
        taken_frames=counts.taken_frames,
        seconds=stages.timings.seconds,
        wall=time.perf_counter() - start,
    )


def kept_frames(dataset: DatasetPlan, out: Path, cache: Path | None = None) -> int:
    """Return how many frames of a stopped build the next build with this cache resumes from."""
    key = read_key(cache or default_cache())
    return 0 if key is None else _workspace(dataset, plain_path(out.absolute()), key).kept()


def _workspace(
    dataset: DatasetPlan,
    out: Path,
    key: bytes,
    replace: bool = False,
    there: tuple[int, int, int] | None = None,
) -> Workspace:
    job: BuildJob = {**head(dataset), "builder": builder_identity()}
    return Workspace(out, job, replace=replace, key=key, there=there)


def _no_progress(stage: str, done: int, total: int) -> None:
    """Ignore progress."""


@dataclass(frozen=True)
class _Counts:
    """Numbers of shards and frames by origin."""

    shards: int
    resumed: int
    resumed_frames: int
    made_frames: int
    taken_frames: int


@dataclass
class _Stages:
    """The stages of one build; `build` describes the fields that it has as arguments."""

    job: Job  # without the workspace's folder
    progress: Progress
    workers: int
    shard_frames: int
    run: Runner
    explain: Callable[[list[str]], None] | None
    examined: Examined | None = None  # the dataset to repair
    timings: Timings = field(default_factory=Timings)

    @property
    def dataset(self) -> DatasetPlan:
        """The plan."""
        return self.job.dataset

    def run_all(self, work: Workspace, out: Path, recipe_files: RecipeFiles | None) -> tuple[_Counts, Manifest]:
        """Run every stage in a workspace, publish the dataset, and return its manifest."""
        job, store = replace(self.job, root=work.dataset), Store(self.job.cache)
        new = [scene for scene in simulations(self.dataset) if not store.has_trace(scene)]
        with self._early_pool(job, work, new) as run:
            assembly = self._simulate()
            reuse = Reuse(self.dataset, self.examined.held if self.examined else earlier(store, out))
            taken = self._reuse_frames(work, assembly, reuse)
            if self.explain:
                self.explain(list(reasons(reuse, [scene.digest for scene in new], taken)))
            shards = missing_shards(all_shards(self.dataset, self.shard_frames), taken)
            resumed, seconds = render_unfinished(job, shards, self.workers, self.progress, assembly.add, work, run)
        for stage, value in seconds.items():
            self.timings.add(stage, value)
        finisher = Finisher(self.dataset, assembly, work, self.progress, self.timings, recipe_files)
        if self.examined:
            self.examined.check(finisher.identity, work)
        if recipe_files:
            recipe_files.check_lock_kept(out, finisher.identity)
        files = finisher.finish(self._trace)
        manifest = read_manifest(work.dataset)  # afterwards, another program may move the dataset away
        work.publish(files)
        assert manifest is not None
        resumed_frames = sum(shard.pictures for shard in resumed)
        counts = _Counts(
            len(shards),
            len(resumed),
            resumed_frames,
            made_frames=sum(shard.pictures for shard in shards) - resumed_frames,
            taken_frames=sum(len(there.variants) * len(there.frames) for there in taken.values()),
        )
        return counts, manifest

    @contextmanager
    def _early_pool(self, job: Job, work: Workspace, new: list[ScenePlan]) -> Iterator[Runner]:
        """Return the runner. If there is one new scene, workers start and load it while it is simulated."""
        single = len(simulations(self.dataset)) == 1 and not self.examined  # otherwise the shards are not known yet
        if new and single and self.workers and self.run is local.run:
            seen, shards = views(self.dataset), all_shards(self.dataset, self.shard_frames)
            left = [shard for shard in shards if not work.noted(shard, seen[shard.view])]
            if left:
                with local.WorkerPool(job, min(self.workers, len(left)), load=0) as pool:
                    yield lambda job, shards, workers, done, tick: pool.run(shards, done, tick)
                return
        yield self.run

    def _simulate(self) -> FrameAssembly:
        """Simulate every scene that the store does not have."""
        wanted, assembly = simulations(self.dataset), FrameAssembly(self.dataset)
        self.progress("simulate", 0, len(wanted))
        with self.timings("simulate"):
            for done, (scene, value) in enumerate(self._trace_digests(wanted), start=1):
                assembly.traces[scene.digest] = value
                self.progress("simulate", done, len(wanted))
        return assembly

    def _trace_digests(self, scenes: list[ScenePlan]) -> Iterator[tuple[ScenePlan, str]]:
        """Yield each scene with its Trace's digest, in two threads: each simulation runs in a process of its own."""
        if len(scenes) == 1:
            yield scenes[0], self._trace(scenes[0]).digest
            return
        numbers = list[int]()  # of the threads
        with ThreadPoolExecutor(2, initializer=lambda: numbers.append(threading.get_ident())) as threads:
            tasks = {threads.submit(self._trace, scene): scene for scene in scenes}
            try:
                for task in as_completed(tasks):
                    yield tasks[task], task.result().digest
            except BaseException:
                threads.shutdown(wait=False, cancel_futures=True)
                while not all(task.done() for task in tasks):  # a thread may be about to start its child
                    subprocesses.kill_children(numbers)
                    time.sleep(0.05)
                raise

    def _trace(self, scene: ScenePlan) -> Trace:
        """Return a scene's Trace with its contacts, from the store or simulated."""
        return Store(self.job.cache).trace(scene, lambda: self.job.engines.simulate(scene), contacts=True)

    def _reuse_frames(self, work: Workspace, assembly: FrameAssembly, reuse: Reuse) -> dict[int, ReusedFrames]:
        """Link the frames that an earlier dataset shares with this one; return them by the number of the view."""
        found, seen = {}, views(self.dataset)
        for number, view in enumerate(seen):
            variants = reuse.covered(view)
            if not variants:
                continue
            self.progress("reuse", number, len(seen))
            with self.timings("write"):
                records = reuse.take(work, view, variants)
            if records:
                frames = tuple(record["frame"] for record in records)
                found[number] = ReusedFrames(variants, frozenset(frames))
                assembly.add(Shard(number, frames, variants), records)
        if found:
            self.progress("reuse", len(seen), len(seen))
        return found
