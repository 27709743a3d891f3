"""Journals of finished shards: a run that was stopped, by whatever, continues where it was.

A build keeps its journal in its workspace, as files. `lock` and `verify --all` keep theirs in the cache, as entries
under the key of everything that the frames depend on, until the run is finished. A record appears whole or not at all,
and is sealed with the key of this user's cache (`cache.journal_key`): others may have put files into the output folder.
"""

from __future__ import annotations

import hmac
import json
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.cache.journal_key import journal_key
from recipe_runtime.cache.store import Store
from recipe_runtime.core.files import write_atomic
from recipe_runtime.dataset.schedule import Shard, View, all_shards, views

_KIND = "shards"


class ShardJournal(ABC):
    """The records of finished shards. They count only if they were sealed with the same `key`."""

    def __init__(self, key: bytes) -> None:
        self._key = key

    def read(self, shard: Shard, view: View) -> list[FrameRecord] | None:
        """The records of a finished shard; None if there are none, or they are damaged."""
        try:
            kept = json.loads(self._get(shard, view) or b"null")
            records: list[FrameRecord] = kept["records"]
            whole = hmac.compare_digest(kept["seal"], self._seal(shard, view, records))
            for record in records if whole else ():
                record["files"] = {path: (row[0], row[1], *row[2:]) for path, row in record["files"].items()}
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return records if whole else None

    def write(self, shard: Shard, view: View, records: Sequence[FrameRecord]) -> None:
        """Record a finished shard; OSError or RunError if that is not possible."""
        body = {"seal": self._seal(shard, view, list(records)), "records": list(records)}
        self._put(shard, view, json.dumps(body).encode())

    def _seal(self, shard: Shard, view: View, records: Sequence[FrameRecord]) -> str:
        """What proves that this user's build wrote a record, for this shard."""
        text = digest("shard-record/2", [_shard_digest(shard, view), list(records)])
        return hmac.new(self._key, text.encode(), "sha256").hexdigest()

    @abstractmethod
    def frames(self) -> int:
        """The number of frames of all recorded shards."""

    @abstractmethod
    def _get(self, shard: Shard, view: View) -> bytes | None:
        """A record's bytes; None or OSError if it is absent."""

    @abstractmethod
    def _put(self, shard: Shard, view: View, body: bytes) -> None:
        """Write a record."""


class FolderJournal(ShardJournal):
    """A file a shard, in a folder; its name is the shard's digest and its number of frames."""

    def __init__(self, folder: Path, key: bytes) -> None:
        super().__init__(key)
        self.folder = folder

    def __contains__(self, key: tuple[Shard, View]) -> bool:
        """Whether a shard is recorded; what the record says is for `read` to check."""
        return self._path(*key).is_file()

    def frames(self) -> int:
        """The number of frames of all recorded shards, by the names of the files."""
        try:
            names = [path.stem for path in sorted(self.folder.iterdir())]
        except OSError:
            return 0
        return sum(int(name.partition("-")[2]) for name in names if re.fullmatch(r"[0-9a-f]{32}-[0-9]+", name))

    def _get(self, shard: Shard, view: View) -> bytes | None:
        return self._path(shard, view).read_bytes()

    def _put(self, shard: Shard, view: View, body: bytes) -> None:
        write_atomic(self._path(shard, view), body)

    def _path(self, shard: Shard, view: View) -> Path:
        return self.folder / f"{_shard_digest(shard, view)[:32]}-{shard.pictures}.json"


class CacheJournal(ShardJournal):
    """An entry of the cache a shard, for the run with that key over a plan."""

    def __init__(self, cache: Path, run: str, plan: DatasetPlan) -> None:
        super().__init__(hmac.digest(journal_key(cache), run.encode(), "sha256"))
        self._store, self._run, seen = Store(cache), run, views(plan)
        self._pictures: dict[str, int] = {}  # by key, of every shard that may be recorded
        for shard in all_shards(plan):
            self._entry(shard, seen[shard.view])

    def frames(self) -> int:
        """The number of frames of all recorded shards."""
        return sum(count for key, count in self._pictures.items() if self._store.path(_KIND, key).is_file())

    def remove(self) -> None:
        """Delete the journal: its run is finished. Not an error where it cannot be deleted."""
        for key in self._pictures:
            with suppress(OSError):
                self._store.path(_KIND, key).unlink(missing_ok=True)

    def _get(self, shard: Shard, view: View) -> bytes | None:
        return self._store.get(_KIND, self._entry(shard, view))

    def _put(self, shard: Shard, view: View, body: bytes) -> None:
        self._store.put(_KIND, self._entry(shard, view), body)

    def _entry(self, shard: Shard, view: View) -> str:
        key = digest("store/shard/1", [self._run, _shard_digest(shard, view)])
        self._pictures[key] = shard.pictures
        return key


def digests_only(records: Iterable[FrameRecord]) -> list[FrameRecord]:
    """Frame records without the objects seen, which rows of a lockfile do not need."""
    return [{**record, "objects": []} for record in records]


def _shard_digest(shard: Shard, view: View) -> str:
    return digest("shard/1", [view.key, list(shard.frames), list(shard.variants)])
