"""Frames that `recipe lock` does not render, because this host has rendered them before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.lockfile import FrameKey
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.journal import CacheJournal
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.versions import builder_identity
from recipe_runtime.dataset.digests import frame_rows
from recipe_runtime.dataset.schedule import ReusedFrames, Shard, all_shards, missing_shards, views

Proof = Callable[[dict[str, str], Progress], Sequence[tuple[Shard, list[FrameRecord]]]]


@dataclass
class Known:
    """Frames that `lock` need not render, because this host has rendered them before.

    `cache`: the folder of the journals, of a stopped lock and of this one. `proof`: which frames a dataset
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
        """Return the rows that the dataset proves, the remaining shards, and their journal."""
        seen, rows, reused = views(plan), dict[FrameKey, str](), dict[int, ReusedFrames]()
        for shard, records in self.proof(traces, progress):
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
