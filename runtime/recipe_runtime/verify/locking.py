"""Plans and frames to lockfile rows; the same rows whether a build, `recipe lock` or the verifier asks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from recipe_compiler.ir.errors import RecipeError
from recipe_compiler.ir.lockfile import FrameKey, Lockfile
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build import local
from recipe_runtime.build.journal import ShardJournal, digests_only
from recipe_runtime.build.known_frames import Known
from recipe_runtime.build.worker import Job
from recipe_runtime.cache.pruning import leased
from recipe_runtime.cache.store import Store
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.digests import bare, frame_rows, with_rows
from recipe_runtime.dataset.limits import check_bounds
from recipe_runtime.dataset.schedule import Shard, View, all_shards, simulations, views
from recipe_runtime.frames.engines import Engines, devices, real_engines


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

    local.run(job, todo, workers, done, tick)
    return found
