"""Computes lockfile rows from plans and frames: the same rows for builds, `recipe lock` and the verifier."""

from __future__ import annotations

import tempfile
from pathlib import Path

from recipe_compiler.ir.lockfile import FrameKey, Lockfile
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.known_frames import Known
from recipe_runtime.build.resume import Resumption, render_unfinished
from recipe_runtime.build.worker import Job
from recipe_runtime.cache.pruning import leased
from recipe_runtime.cache.store import Store
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.digests import bare, frame_rows, with_rows
from recipe_runtime.dataset.plan_reader import check_readable
from recipe_runtime.dataset.schedule import Shard, all_shards, simulations, views
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
    """Simulate every scene, render every frame that is not `known` without keeping it, and return the digests.

    `traces` is filled with the motion of each scene, by its digest.
    """
    check_readable(plan)
    engines = engines or real_engines()
    with leased(), tempfile.TemporaryDirectory(prefix="recipe-lock-") as folder:
        made = fresh_traces(simulations(plan), engines, Store(Path(folder)), progress)
        job = Job(plan, engines, devices(device), Path(folder), None)
        if known is None:
            frames, _ = render_rows(job, all_shards(plan), workers, progress)
        else:
            digests = {scene: trace.digest for scene, trace in made.items()}
            rows, shards, journal = known.begin(plan, digests, progress)
            rest, known.resumed_frames = render_rows(job, shards, workers, progress, Resumption(journal))
            frames = rows | rest
    if traces is not None:
        traces.update(made)
    return with_rows(bare(plan, source, files), made, simulations(plan), frames)


def fresh_traces(scenes: list[ScenePlan], engines: Engines, store: Store, progress: Progress) -> dict[str, Trace]:
    """Simulate every scene again, into a store that workers read."""
    traces = {}
    for number, scene in enumerate(scenes):
        progress("simulate", number, len(scenes))
        traces[scene.digest] = store.trace(scene, lambda scene=scene: engines.simulate(scene))  # type: ignore[misc]
    progress("simulate", len(scenes), len(scenes))
    return traces


def render_rows(
    job: Job, shards: list[Shard], workers: int, progress: Progress, resumption: Resumption | None = None
) -> tuple[dict[FrameKey, str], int]:
    """Render the shards that no stopped run has finished, with the traces in the job's cache.

    Returns:
        The digests of the frames of all shards, and the number of frames that a stopped run had rendered.
    """
    plan = job.dataset
    found, seen = dict[FrameKey, str](), views(plan)

    def add(shard: Shard, records: list[FrameRecord]) -> None:
        for record in records:
            found.update(frame_rows(plan, seen[shard.view], record))

    earlier, _ = render_unfinished(job, shards, workers, progress, add, resumption)
    return found, sum(shard.pictures for shard in earlier)
