"""The workspace of a build: the staged folder of the dataset, and the journal of its finished shards in the cache.

The next build of the same plan at the same place resumes an interrupted one. It hashes the files of each shard that the
journal lists, so whatever happened to the folder meanwhile, only complete files are used.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection, Iterable
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from types import TracebackType

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import FileRow, FrameRecord
from recipe_runtime.build.journal import CacheJournal
from recipe_runtime.build.resume import Resumption
from recipe_runtime.core.files import (
    atomic_file,
    entries_below,
    has_content,
    host_errors,
    is_folder,
    link_or_copy,
    write_atomic,
)
from recipe_runtime.core.staged_folder import Notice, StagedFolder, ignore
from recipe_runtime.core.versions import builder_identity
from recipe_runtime.dataset.manifest import head
from recipe_runtime.dataset.manifest_reader import FILES
from recipe_runtime.dataset.schedule import Shard, View

REMEDY = "free some space or allow writing, then build again: what is done is kept"


class Workspace:
    """The workspace of one dataset folder; a context manager that holds its lock.

    Args:
        plan: what is built.
        out: the dataset's folder.
        cache: the folder of the journal.
        replace: whether another recipe's unfinished work may be discarded.
        repair: whether changed files of the dataset that is replaced are damage.
        notice: called with a line of text if a replaced folder is kept.
    """

    def __init__(
        self,
        plan: DatasetPlan,
        out: Path,
        cache: Path,
        *,
        replace: bool = False,
        repair: bool = False,
        notice: Notice = ignore,
    ) -> None:
        key = digest("build/job/1", [head(plan), builder_identity()])
        place = os.path.realpath(out)
        self._folder = StagedFolder(
            out, FILES, owner=plan.recipe, key=key, replace=replace, repair=repair, notice=notice
        )
        self._journal = CacheJournal(cache, digest("journal/build/1", [key, os.fsencode(place).hex()]))
        self.dataset = self._folder.files

    def __enter__(self) -> Workspace:
        with self._reported():
            self._folder.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._folder.__exit__(kind, error, at)

    def resumption(self) -> Resumption:
        """Return the finished shards of earlier builds and of this one."""
        return Resumption(self._journal, self._are_complete, objects=True)

    def _are_complete(self, records: list[FrameRecord]) -> bool:
        """Whether all files of some frames are there, with the recorded digests."""
        rows = {path: row for record in records for path, row in record["files"].items()}
        try:
            return all(has_content(self.dataset, path, size, sha256) for path, (size, sha256) in rows.items())
        except OSError:
            return False

    def noted(self, shard: Shard, view: View) -> bool:
        """Whether an earlier build recorded a shard as finished; its files are not checked."""
        return (shard, view) in self._journal

    def kept(self) -> int:
        """Return the number of frames that an earlier build recorded as finished."""
        return self._journal.frames() if self._folder.is_continued() else 0

    def write(self, path: str, body: bytes) -> None:
        """Write one of the dataset's files."""
        with self._reported(path):
            write_atomic(self.dataset / path, body)

    def write_pieces(self, path: str, pieces: Iterable[bytes]) -> FileRow:
        """Write a file of the dataset piece by piece, and return its size and SHA-256."""
        size, hasher = 0, hashlib.sha256()
        with self._reported(path), atomic_file(self.dataset / path) as file:
            for piece in pieces:
                file.write(piece)
                hasher.update(piece)
                size += len(piece)
        return size, hasher.hexdigest()

    def link(self, path: str, other: str) -> None:
        """Link a file of the dataset under a second name."""
        self.take(self.dataset / path, other)

    def take(self, source: Path, path: str) -> None:
        """Link a file from elsewhere into the dataset."""
        with self._reported(path):
            link_or_copy(source, self.dataset / path)

    def publish(self, files: Collection[str]) -> None:
        """Publish the dataset, in place of the existing one.

        Args:
            files: the paths of all files of the dataset.
        """
        with self._reported():
            self._sweep(files)
            self._folder.publish()
        self._journal.remove()

    def abandon(self) -> None:
        """Remove the workspace, which contains nothing worth resuming."""
        with self._reported():
            self._folder.remove()
        self._journal.remove()

    def _sweep(self, files: Collection[str]) -> None:
        """Remove files and folders that are not the dataset's, such as partial files of a killed build."""
        for path in reversed(entries_below(self.dataset)):  # the content of a folder before the folder
            if is_folder(path):
                with suppress(OSError):  # it is not empty
                    path.rmdir()
            elif path.relative_to(self.dataset).as_posix() not in files:
                path.unlink()

    def _reported(self, path: str = "") -> AbstractContextManager[None]:
        return host_errors(f"{self._folder.partial}: {path}" if path else str(self._folder.partial), REMEDY)
