"""Frames that `recipe lock` does not render, because this host has rendered them before."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.lockfile import FrameKey
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.journal import CacheJournal
from recipe_runtime.build.reuse import Reuse, built
from recipe_runtime.cache.store import Store
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.versions import builder_identity
from recipe_runtime.dataset.digests import frame_rows
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.dataset.schedule import ReusedFrames, Shard, all_shards, missing_shards, views


@dataclass
class Known:
    """Frames that `lock` need not render, because this host has rendered them before.

    `cache`: the folder of the journals, of a stopped lock and of this one. `before`: the dataset that this program last
    built on this host from the same plan.
    """

    cache: Path
    before: Dataset | None = None
    taken_frames: int = 0  # from the dataset
    resumed_frames: int = 0  # from the journal
    _journal: CacheJournal | None = field(default=None, init=False)

    def begin(
        self, plan: DatasetPlan, traces: dict[str, str], progress: Progress
    ) -> tuple[dict[FrameKey, str], list[Shard], CacheJournal]:
        """Return the rows that the dataset proves, the remaining shards, and their journal."""
        seen, rows, reused = views(plan), dict[FrameKey, str](), dict[int, ReusedFrames]()
        for shard, records in _proven(plan, self.before, traces, progress):
            reused[shard.view] = ReusedFrames(shard.variants, frozenset(shard.frames))
            self.taken_frames += shard.pictures
            rows.update(row for record in records for row in frame_rows(plan, seen[shard.view], record))
        # Every device produces the same bytes, so the journal may be continued on another one.
        key = digest("journal/lock/1", [plan.digest, builder_identity(), traces])
        self._journal = CacheJournal(self.cache, key)
        return rows, missing_shards(all_shards(plan), reused), self._journal

    def kept_frames(self) -> int:
        """The number of frames in the journal of a lock that was stopped."""
        return 0 if self._journal is None else self._journal.frames()

    def close(self) -> None:
        """Delete the journal, once the lockfile is written."""
        if self._journal is not None:
            self._journal.remove()


def _proven(
    plan: DatasetPlan, before: Dataset | None, traces: Mapping[str, str], progress: Progress
) -> Iterator[tuple[Shard, list[FrameRecord]]]:
    """Yield the frames of a plan that an existing dataset of this program proves, as records by view.

    The manifest, whose digest the cache holds, contains the digests of the pixels before they were encoded. A frame is
    returned if all of its files still have their recorded digests, and its scene's motion is the given one.

    Args:
        plan: the plan.
        before: the dataset; None if there is none.
        traces: scene digest -> Trace digest.
        progress: called with `reuse`, the views done and all views.
    """
    reuse, seen = Reuse(plan, before), views(plan)
    for number, view in enumerate(seen) if before is not None else ():
        progress("reuse", number + 1, len(seen))
        variants, scene = reuse.covered(view), view.scene.digest
        if not variants or before is None or traces.get(scene) != before.lock.traces.get(scene):
            continue
        if records := reuse.take(None, view, variants):
            yield Shard(number, tuple(record["frame"] for record in records), variants), records


def known_frames(plan: DatasetPlan, cache: Path | None = None) -> Known:
    """Return the frames that `lock` need not render: of the last dataset built on this host, and of a stopped lock."""
    store = Store(cache)
    return Known(store.root, built(store, plan))
