"""Renders the shards that an interrupted run has not finished: for `build`, `lock` and `verify --all`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from recipe_compiler.ir.errors import RecipeError

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build import local
from recipe_runtime.build.journal import CacheJournal
from recipe_runtime.build.worker import Job
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset.schedule import Shard, View, views

Runner = Callable[[Job, Sequence[Shard], int, local.Done, Callable[[int], None]], local.Seconds]


@dataclass
class Resumption:
    """A journal in the cache to continue; if the cache cannot be written, the run continues without one.

    Args:
        journal: the journal.
        usable: whether the records of a shard still hold.
        objects: whether to keep the visible objects of frames, which annotations need and rows of a lockfile do not.
    """

    journal: CacheJournal
    usable: Callable[[list[FrameRecord]], bool] = lambda records: True
    objects: bool = False

    def finished(self, shard: Shard, view: View) -> list[FrameRecord] | None:
        """The records of a shard that a stopped run finished and that still hold; None if it is to be rendered."""
        records = self.journal.read(shard, view)
        return records if records is not None and self.usable(records) else None

    def keep(self, shard: Shard, view: View, records: Sequence[FrameRecord]) -> None:
        """Record a finished shard, if the cache can be written."""
        kept: list[FrameRecord] = list(records) if self.objects else [{**record, "objects": []} for record in records]
        with suppress(RecipeError, OSError):
            self.journal.write(shard, view, kept)


def render_unfinished(
    job: Job,
    shards: Sequence[Shard],
    workers: int,
    progress: Progress,
    add: Callable[[Shard, list[FrameRecord]], None],
    kept: Resumption | None = None,
    run: Runner = local.run,
) -> tuple[list[Shard], local.Seconds]:
    """Render those of the shards that no earlier run has finished.

    Args:
        job: what the shards have in common.
        shards: what is wanted.
        workers: number of processes; 0 renders in this process.
        progress: called with `render`, the pictures rendered, and all that are to be rendered.
        add: called in this process with each shard and its records, whether rendered now or before.
        kept: where finished shards are looked up and recorded; None for nowhere.
        run: renders the shards (`local.run`, or a cluster's runner).

    Returns:
        The shards that an earlier run had finished, and the seconds by stage, summed over the workers.
    """
    seen, earlier, todo = views(job.dataset), list[Shard](), list[Shard]()
    for shard in shards:
        records = None if kept is None else kept.finished(shard, seen[shard.view])
        if records is None:
            todo.append(shard)
        else:
            earlier.append(shard)
            add(shard, records)

    def done(shard: Shard, records: list[FrameRecord]) -> None:
        if kept is not None:
            kept.keep(shard, seen[shard.view], records)
        add(shard, records)

    total, so_far = sum(shard.pictures for shard in todo), 0

    def tick(count: int) -> None:
        nonlocal so_far
        so_far += count
        progress("render", so_far, total)

    progress("render", 0, total)
    return earlier, run(job, todo, workers, done, tick)
