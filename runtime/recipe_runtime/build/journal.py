"""Journals of finished shards, from which an interrupted run is resumed.

A build keeps its journal as files in its workspace. `lock` and `verify --all` keep theirs as cache entries, whose key
covers everything that the frames depend on, until the run is finished. Records are written atomically and sealed with
the key of this user's cache (`cache.journal_key`), because others may have put files into the output folder.
"""

from __future__ import annotations

import hmac
import json
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.cache.journal_key import journal_key
from recipe_runtime.cache.store import Store
from recipe_runtime.core.files import write_atomic
from recipe_runtime.dataset.schedule import Shard, View, all_shards, views

_KIND = "shards"
_MAX_RECORD = 1 << 28  # bytes of a record in a workspace


class ShardJournal(ABC):
    """The records of finished shards. Records sealed with another `key` are ignored."""

    def __init__(self, key: bytes) -> None:
        self._key = key

    def read(self, shard: Shard, view: View) -> list[FrameRecord] | None:
        """Return the records of a finished shard, or None if they are missing or damaged."""
        try:
            seal, _, body = (self._get(shard, view) or b"").partition(b"\n")
            if not hmac.compare_digest(seal, self._seal(shard, view, body)):
                return None  # nothing of a record with another seal is parsed
            records: list[FrameRecord] = json.loads(body)
            for record in records:
                record["files"] = {path: (row[0], row[1], *row[2:]) for path, row in record["files"].items()}
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return records

    def write(self, shard: Shard, view: View, records: Sequence[FrameRecord]) -> None:
        """Record a finished shard.

        Raises:
            OSError: the record cannot be written.
            RunError: the cache cannot be written.
        """
        body = json.dumps(list(records)).encode()
        self._put(shard, view, self._seal(shard, view, body) + b"\n" + body)

    def _seal(self, shard: Shard, view: View, body: bytes) -> bytes:
        """Return the seal of a record, which proves that this user's build wrote it for this shard."""
        text = f"shard-record/3 {_shard_digest(shard, view)}\n".encode() + body
        return hmac.new(self._key, text, "sha256").hexdigest().encode()

    @abstractmethod
    def frames(self) -> int:
        """Return the number of frames in all recorded shards."""

    @abstractmethod
    def _get(self, shard: Shard, view: View) -> bytes | None:
        """Return the bytes of a record; None or OSError if it does not exist."""

    @abstractmethod
    def _put(self, shard: Shard, view: View, body: bytes) -> None:
        """Write a record."""


class FolderJournal(ShardJournal):
    """One file per shard in a folder, named by the shard's digest and its number of frames."""

    def __init__(self, folder: Path, key: bytes) -> None:
        super().__init__(key)
        self.folder = folder

    def __contains__(self, key: tuple[Shard, View]) -> bool:
        """Whether a shard has a record; `read` checks the content."""
        return self._path(*key).is_file()

    def frames(self) -> int:
        """Return the number of frames in all recorded shards, according to the names of the files."""
        try:
            names = [path.stem for path in sorted(self.folder.iterdir())]
        except OSError:
            return 0
        return sum(int(name.partition("-")[2]) for name in names if re.fullmatch(r"[0-9a-f]{32}-[0-9]+", name))

    def _get(self, shard: Shard, view: View) -> bytes | None:
        return read_regular(self._path(shard, view), _MAX_RECORD)

    def _put(self, shard: Shard, view: View, body: bytes) -> None:
        write_atomic(self._path(shard, view), body)

    def _path(self, shard: Shard, view: View) -> Path:
        return self.folder / f"{_shard_digest(shard, view)[:32]}-{shard.pictures}.json"


class CacheJournal(ShardJournal):
    """One cache entry per shard, for the run with a given key over a plan."""

    def __init__(self, cache: Path, run: str, plan: DatasetPlan) -> None:
        super().__init__(hmac.digest(journal_key(cache), run.encode(), "sha256"))
        self._store, self._run, seen = Store(cache), run, views(plan)
        self._pictures: dict[str, int] = {}  # number of pictures by key, for every shard that may be recorded
        for shard in all_shards(plan):
            self._entry(shard, seen[shard.view])

    def frames(self) -> int:
        """Return the number of frames in all recorded shards."""
        return sum(count for key, count in self._pictures.items() if self._store.path(_KIND, key).is_file())

    def remove(self) -> None:
        """Delete the journal of a finished run; failure to delete it is not an error."""
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
    """Return frame records without the visible objects, which rows of a lockfile do not need."""
    return [{**record, "objects": []} for record in records]


def _shard_digest(shard: Shard, view: View) -> str:
    return digest("shard/1", [view.key, list(shard.frames), list(shard.variants)])
