"""The journal of finished shards, from which an interrupted build, `lock` or `verify --all` is resumed.

Records are entries of the cache, whose keys cover everything that the frames depend on, until the run is finished.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from recipe_compiler.ir.canonical import digest

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.cache.store import Store
from recipe_runtime.core.documents import decode
from recipe_runtime.dataset.schedule import Shard, View

_KIND = "shards"


class CacheJournal:
    """The records of finished shards, of the run with a given key.

    One further entry lists the shards of the run, so that another process can count the finished ones.
    """

    def __init__(self, cache: Path, run: str) -> None:
        self._store, self._run = Store(cache), run
        self._list = digest("store/shards/1", [run])
        self._pictures: dict[str, int] = {}  # number of pictures by key, of every shard that was looked up
        self._listed = 0  # of these

    def __contains__(self, key: tuple[Shard, View]) -> bool:
        """Whether a shard has a record; `read` checks the content."""
        return self._store.path(_KIND, self._entry(*key)).is_file()

    def read(self, shard: Shard, view: View) -> list[FrameRecord] | None:
        """Return the records of a finished shard, or None if they are missing or damaged."""
        body = self._store.get(_KIND, self._entry(shard, view))
        try:
            return None if body is None else decode(body, list[FrameRecord])
        except ValueError:
            return None

    def write(self, shard: Shard, view: View, records: Sequence[FrameRecord]) -> None:
        """Record a finished shard.

        Raises:
            RunError: the cache cannot be written.
        """
        self._store.put(_KIND, self._entry(shard, view), json.dumps(list(records)).encode())
        if self._listed < len(self._pictures):
            self._store.put(_KIND, self._list, json.dumps(self._shards()).encode())
            self._listed = len(self._pictures)

    def frames(self) -> int:
        """Return the number of frames in all recorded shards."""
        return sum(count for key, count in self._shards().items() if self._store.path(_KIND, key).is_file())

    def remove(self) -> None:
        """Delete the journal of a finished run; failure to delete it is not an error."""
        for key in (*self._shards(), self._list):
            with suppress(OSError):
                self._store.path(_KIND, key).unlink(missing_ok=True)

    def _shards(self) -> dict[str, int]:
        """Return the number of pictures of each shard by key, of this process and of those before."""
        body = self._store.get(_KIND, self._list)
        return {**json.loads(body or b"{}"), **self._pictures}

    def _entry(self, shard: Shard, view: View) -> str:
        content = digest("shard/1", [view.key, list(shard.frames), list(shard.variants)])
        key = digest("store/shard/1", [self._run, content])
        self._pictures[key] = shard.pictures
        return key
