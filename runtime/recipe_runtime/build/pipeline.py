"""Build a dataset from its plan.

    simulate   simulate every scene once; Traces are stored by digest
    reuse      link the frames that the dataset being replaced has in common with this one
    render     shards of frames, by worker processes: observe, annotate, shade, encode, hash, write
    annotate   write the annotation files over all frames (kwcoco, COCO, MOTS, tracks)
    finish     write plans, contact sheets, card and manifest; then publish the dataset by one rename

The bytes do not depend on the number of workers, the order or size of shards, or how often a build was stopped and
continued.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.build import local, provenance
from recipe_runtime.build.finalize import Finisher
from recipe_runtime.build.recipe_files import RecipeFiles
from recipe_runtime.build.repair import Examined, examine
from recipe_runtime.build.resume import Runner, render_unfinished
from recipe_runtime.build.reuse import Reuse, earlier, reasons, remember
from recipe_runtime.build.worker import Job
from recipe_runtime.build.workspace import REMEDY, Workspace
from recipe_runtime.cache import pruning
from recipe_runtime.cache.store import Store
from recipe_runtime.core import subprocesses
from recipe_runtime.core.files import host_errors, plain_path
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.staged_folder import Notice, StagedFolder, check_apart, check_place, ignore
from recipe_runtime.core.timings import Timings
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.assembly import FrameAssembly
from recipe_runtime.dataset.manifest import is_whole
from recipe_runtime.dataset.manifest_reader import FILES, read_or_none
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


def _no_progress(stage: str, done: int, total: int) -> None:
    """Ignore progress."""


@dataclass(frozen=True)
class BuildOptions:
    """How a dataset is built. Only `recipe` changes its bytes.

    Attributes:
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
        replace: whether another folder may be replaced than a dataset of the same recipe.
        recipe_files: the recipe, which the dataset then contains as a pack.
        notice: called with a line of text if a replaced folder is kept.
    """

    workers: int = 1
    progress: Progress = _no_progress
    cache: Path | None = None
    device: str = "cpu"
    engines: Engines | None = None
    shard_frames: int = SHARD_FRAMES
    explain: Callable[[list[str]], None] | None = None
    run: Runner = local.run
    repair: bool = False
    source: Path | None = None
    replace: bool = False
    recipe_files: RecipeFiles | None = None
    notice: Notice = ignore


def build(dataset: DatasetPlan, out: Path, options: BuildOptions = BuildOptions()) -> BuildResult:
    """Build a dataset in the folder `out`, or return at once if it exists already.

    An earlier dataset in `out` is replaced; what the two have in common is reused. A replaced folder that has files
    besides its own is kept as `NAME.replaced`.

    Raises:
        InputError: `out` cannot be replaced, or contains something other than a dataset of the same recipe and
            `replace` is not set.
        RunError: the host failed. Finished shards are kept, and the next build continues.
    """
    start, cache_limit, out = time.perf_counter(), pruning.limit(), plain_path(out.absolute())
    store, source = Store(options.cache), options.source
    check_plan(dataset)
    check_readable(dataset)
    with host_errors(str(out), REMEDY):
        StagedFolder(out, FILES, notice=options.notice).settle()
    manifest = read_or_none(out)
    examined = examine(dataset, out, options.progress) if options.repair else None
    damage = examined.damage if examined else ()
    readable = not options.repair or examined is not None
    if manifest is not None and readable and not damage and is_whole(manifest, dataset, out):
        provenance.record(out, manifest, source)
        return BuildResult(out, manifest["identity"], manifest, built=False)
    check_place(out)
    check_apart(out, store.root, "the cache")
    if not options.replace:
        provenance.check_replaceable(out, manifest, dataset, source)
    # A repair renders only damaged frames, so a dataset that another program built remains untrusted.
    trusted = not damage or earlier(store, out) is not None
    with (
        pruning.leased(store.root),
        Workspace(
            dataset, out, store.root, replace=options.replace, repair=examined is not None, notice=options.notice
        ) as work,
    ):
        stages = _Stages(dataset, options, store, examined)
        result = stages.run_all(work, out)
    if trusted:
        remember(store, out, dataset)
    pruning.auto_prune([store.root] if options.cache else pruning.folders(), cache_limit)
    provenance.record(out, result.manifest, source)
    return replace(result, repaired=damage, wall=time.perf_counter() - start)


def kept_frames(dataset: DatasetPlan, out: Path, cache: Path | None = None) -> int:
    """Return how many frames of a stopped build the next build with this cache resumes from."""
    return Workspace(dataset, plain_path(out.absolute()), Store(cache).root).kept()


@dataclass
class _Stages:
    """The stages of one build."""

    dataset: DatasetPlan
    options: BuildOptions
    store: Store
    examined: Examined | None  # the dataset to repair
    timings: Timings = field(default_factory=Timings)
    engines: Engines = field(init=False)

    def __post_init__(self) -> None:
        self.engines = self.options.engines or real_engines()

    def run_all(self, work: Workspace, out: Path) -> BuildResult:
        """Run every stage in a workspace, and publish the dataset."""
        options, progress, store = self.options, self.options.progress, self.store
        # Nodes of a cluster may have other devices than this host.
        places = devices(options.device) if options.run is local.run else (options.device,)
        job = Job(self.dataset, self.engines, places, store.root, work.dataset, resumes=True)
        new = [scene for scene in simulations(self.dataset) if not store.has_trace(scene)]
        with self._early_pool(job, work, new) as run:
            assembly = self._simulate()
            reuse = Reuse(self.dataset, self.examined.held if self.examined else earlier(store, out))
            taken = self._reuse_frames(work, assembly, reuse)
            if options.explain:
                options.explain(list(reasons(reuse, [scene.digest for scene in new], taken)))
            shards = missing_shards(all_shards(self.dataset, options.shard_frames), taken)
            resumed, seconds = render_unfinished(
                job, shards, options.workers, progress, assembly.add, work.resumption(), run
            )
        for stage, value in seconds.items():
            self.timings.add(stage, value)
        finisher = Finisher(self.dataset, assembly, work, progress, self.timings, options.recipe_files)
        if self.examined:
            self.examined.check(finisher.identity, work)
        files = finisher.finish(self._trace)
        manifest = read_or_none(work.dataset)
        work.publish(files)
        assert manifest is not None
        resumed_frames = sum(shard.pictures for shard in resumed)
        return BuildResult(
            out,
            manifest["identity"],
            manifest,
            built=True,
            resumed=len(resumed),
            shards=len(shards),
            resumed_frames=resumed_frames,
            made_frames=sum(shard.pictures for shard in shards) - resumed_frames,
            taken_frames=sum(len(there.variants) * len(there.frames) for there in taken.values()),
            seconds=self.timings.seconds,
        )

    @contextmanager
    def _early_pool(self, job: Job, work: Workspace, new: list[ScenePlan]) -> Iterator[Runner]:
        """Return the runner. If there is one new scene, workers start and load it while it is simulated."""
        single = len(simulations(self.dataset)) == 1 and not self.examined  # otherwise the shards are not known yet
        options = self.options
        if new and single and options.workers and options.run is local.run:
            seen, shards = views(self.dataset), all_shards(self.dataset, options.shard_frames)
            left = [shard for shard in shards if not work.noted(shard, seen[shard.view])]
            if left:
                with local.WorkerPool(job, min(options.workers, len(left)), load=0) as pool:
                    yield lambda job, shards, workers, done, tick: pool.run(shards, done, tick)
                return
        yield options.run

    def _simulate(self) -> FrameAssembly:
        """Simulate every scene that the store does not have."""
        wanted, assembly = simulations(self.dataset), FrameAssembly(self.dataset)
        self.options.progress("simulate", 0, len(wanted))
        with self.timings("simulate"):
            for done, (scene, value) in enumerate(self._trace_digests(wanted), start=1):
                assembly.traces[scene.digest] = value
                self.options.progress("simulate", done, len(wanted))
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
        return self.store.trace(scene, lambda: self.engines.simulate(scene), contacts=True)

    def _reuse_frames(self, work: Workspace, assembly: FrameAssembly, reuse: Reuse) -> dict[int, ReusedFrames]:
        """Link the frames that an earlier dataset shares with this one; return them by the number of the view."""
        found, seen = {}, views(self.dataset)
        for number, view in enumerate(seen):
            variants = reuse.covered(view)
            if not variants:
                continue
            self.options.progress("reuse", number, len(seen))
            with self.timings("write"):
                records = reuse.take(work, view, variants)
            if records:
                frames = tuple(record["frame"] for record in records)
                found[number] = ReusedFrames(variants, frozenset(frames))
                assembly.add(Shard(number, frames, variants), records)
        if found:
            self.options.progress("reuse", len(seen), len(seen))
        return found
