"""The workspace of a build: a sibling of the output folder, which one rename publishes when the dataset is complete.

    .<name>.partial/
        job.json      the plan, tools and code of the build; sealed with this host's key
        shards/       one record per finished shard, written after its files; the name ends with the number of frames
        dataset/      the files written so far
        old/          the dataset that is being replaced, between two renames

The next build of the same plan resumes an interrupted one if the seals were made with the key in this user's cache.
Otherwise, as with a folder that came with a downloaded recipe, the workspace is cleared. A folder with other files is
not a workspace, and `old/` is removed only if it is a dataset and contains nothing else. Only one build at a time uses
a workspace; the lock is released when its process ends.
"""

from __future__ import annotations

import fcntl
import hashlib
import hmac
import json
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.annotate.records import FileRow, FrameRecord
from recipe_runtime.build.journal import FolderJournal
from recipe_runtime.build.output_folder import check_files, read_manifest, remove_dataset
from recipe_runtime.core.files import (
    atomic_file,
    entries_below,
    file_sha256,
    host_errors,
    is_folder,
    link_or_copy,
    make_folder,
    open_folder,
    regular_file,
    remove_tree,
    stamp_of,
    write_atomic,
)
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import DAMAGE
from recipe_runtime.dataset.manifest_types import ManifestHead
from recipe_runtime.dataset.schedule import Shard, View

_JOB = "job.json"
_JOB_TEMPORARY = re.compile(r"\.job\.json\.\d+\.\d+\.tmp")  # left by a build that was killed as it began
_MAX_JOB = 1 << 24  # bytes of `job.json`
_REMEDY = "free some space or allow writing, then build again: what is done is kept"


class BuildJob(ManifestHead):
    """`job.json`: the plan and the code of a build. Equal jobs produce equal files."""

    builder: str


class Workspace:
    """The workspace of one dataset folder; a context manager that holds the lock.

    Args:
        out: the dataset's folder.
        job: what is built; None for `settle`, which does not resume work.
        replace: whether another recipe's unfinished work may be discarded.
        key: the key of the seals of job and records (`cache.journal_key`). Work sealed with another key is not resumed.
        there: the stamp of the dataset at `out` that may be replaced (`manifest_reader.stamp`).
    """

    def __init__(
        self,
        out: Path,
        job: BuildJob | None,
        *,
        replace: bool = False,
        key: bytes = b"",
        there: tuple[int, int, int] | None = None,
    ) -> None:
        self.out, self._there = out, there
        self._recipe, self._replace = job and job["recipe"], replace
        seal = hmac.new(key, pretty(job).encode(), "sha256").digest()
        self._job = pretty({**(job or {}), "seal": seal.hex()})
        self._partial = out.parent / f".{out.name}.partial"
        self._shards = FolderJournal(self._partial / "shards", hmac.digest(key, seal, "sha256"))
        self.dataset = self._partial / "dataset"
        self._lock = -1

    def __enter__(self) -> Workspace:
        with host_errors(str(self._partial), _REMEDY):
            self._take()
            try:
                self._check_is_workspace()
                self._recover()
                if not self._is_mine():
                    self._clear()
                self._remove_links()
                make_folder(self.dataset)
                make_folder(self._shards.folder)
            except BaseException:
                os.close(self._lock)
                raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        os.close(self._lock)

    def finished(self, shard: Shard, view: View) -> list[FrameRecord] | None:
        """Return the records of a shard finished by an earlier build, or None unless all of its files are complete."""
        records = self._shards.read(shard, view)
        if records is None:
            return None
        try:
            rows = [(path, row) for record in records for path, row in record["files"].items()]
            whole = all(self._holds(path, row[0], row[1]) for path, row in rows)
        except (OSError, *DAMAGE):
            return None
        return records if whole else None

    def noted(self, shard: Shard, view: View) -> bool:
        """Whether an earlier build recorded a shard as finished; `finished` checks the files."""
        return (shard, view) in self._shards

    def _holds(self, path: str, size: int, sha256: str) -> bool:
        found = regular_file(self.dataset, path)
        return found is not None and found.st_size == size and file_sha256(self.dataset / path) == sha256

    def kept(self) -> int:
        """Return the number of finished frames, according to the names of the records.

        Also valid for another build's work.
        """
        try:
            return self._shards.frames() if self._is_mine() else 0
        except OSError:
            return 0

    def keep(self, shard: Shard, view: View, records: Sequence[FrameRecord]) -> None:
        """Record that a shard's files are in place."""
        with host_errors(str(self._partial), _REMEDY):
            self._shards.write(shard, view, records)

    def write(self, path: str, body: bytes) -> None:
        """Write one of the dataset's files."""
        with host_errors(f"{self._partial}: {path}", _REMEDY):
            write_atomic(self.dataset / path, body)

    def write_pieces(self, path: str, pieces: Iterable[bytes]) -> FileRow:
        """Write a file of the dataset piece by piece, and return its size and SHA-256."""
        size, hasher = 0, hashlib.sha256()
        with host_errors(f"{self._partial}: {path}", _REMEDY), atomic_file(self.dataset / path) as file:
            for piece in pieces:
                file.write(piece)
                hasher.update(piece)
                size += len(piece)
        return size, hasher.hexdigest()

    def link(self, path: str, other: str) -> None:
        """Link a file of the dataset under a second name."""
        with host_errors(f"{self._partial}: {other}", _REMEDY):
            link_or_copy(self.dataset / path, self.dataset / other)

    def take(self, source: Path, path: str) -> None:
        """Link a file from elsewhere into the dataset."""
        with host_errors(f"{self._partial}: {path}", _REMEDY):
            link_or_copy(source, self.dataset / path)

    def stamp(self, path: str) -> str:
        """Return the current stamp of a file of the dataset."""
        with host_errors(f"{self._partial}: {path}", _REMEDY):
            return stamp_of((self.dataset / path).lstat())

    @classmethod
    def settle(cls, out: Path) -> None:
        """Complete or undo the renames of a build that was killed within `publish`, unless other files are there."""
        work = cls(out, None)
        if not is_folder(work._partial):
            return
        ended = out.exists() and not work.dataset.exists()
        if not ended and not is_folder(work._partial / "old"):
            return
        with host_errors(str(work._partial), _REMEDY):
            work._take()
            try:
                with suppress(InputError):  # a build that has to work there reports it
                    work._check_is_workspace()
                    work._recover()
                    if out.exists() and not work.dataset.exists():
                        work._remove()
            finally:
                os.close(work._lock)

    def publish(self, files: Mapping[str, FileRow]) -> None:
        """Publish the dataset, in place of the existing one.

        Args:
            files: the rows of all files of the dataset, by path.

        Raises:
            InputError: meanwhile another dataset took the place of the existing one, or that received a file that is
                not its own; it stays, and nothing is published.
            RunError: another program changed or removed a file since it was written; nothing is published.
        """
        with host_errors(str(self.out), _REMEDY):
            changed = next((path for path, row in files.items() if not self._as_written(path, row)), None)
            if changed is not None:
                raise RunError(
                    f"{self.dataset / changed} was changed or removed by another program during the build; nothing was"
                    " published. Find out what writes there, then build again: the file is made again, the rest is kept"
                )
            self._sweep(files)
            self._put_in_place()
            self._remove()

    def _put_in_place(self) -> None:
        """Rename the dataset to its place; the one there is moved aside first, and back after an error."""
        old = self._partial / "old"
        if os.path.lexists(self.out):
            self.out.rename(old)
        try:
            if os.path.lexists(old):
                if manifest_reader.stamp(old) != self._there:  # not before it is moved: until then it may change
                    raise InputError(f"{self.out} was written by another program during the build; build again")
                check_files(old, self.out)
            self.dataset.rename(self.out)
        except BaseException:
            if os.path.lexists(old) and not os.path.lexists(self.out):
                old.rename(self.out)
            raise

    def abandon(self) -> None:
        """Remove the workspace, which contains nothing worth resuming."""
        with host_errors(str(self._partial), _REMEDY):
            self._remove()

    def _remove(self) -> None:
        """Remove the folder; `job.json` is removed last, so that an interrupted removal can be resumed."""
        for child in sorted(self._partial.iterdir(), key=lambda path: (path.name == _JOB, path.name)):
            if child.name == "old" and is_folder(child):
                remove_dataset(child)
            elif _is_own(child):
                remove_tree(child)
        with suppress(OSError):  # another program has put a file there
            self._partial.rmdir()

    def _as_written(self, path: str, row: FileRow) -> bool:
        """Whether a file has the bytes that the build wrote.

        A file with the same inode, size and time of last change was not written to, so it is not read again.

        Args:
            path: the file.
            row: size, SHA-256 and stamp of the file as written.
        """
        found = regular_file(self.dataset, path)
        if found is None or found.st_size != row[0]:
            return False
        return [stamp_of(found)] == list(row[2:]) or file_sha256(self.dataset / path) == row[1]

    def _sweep(self, files: Collection[str]) -> None:
        """Remove files, links and folders that are not the dataset's, such as partial files of a killed build."""
        folders = set[str]()
        for path in files:
            folder = path.rpartition("/")[0]
            while folder and folder not in folders:
                folders.add(folder)
                folder = folder.rpartition("/")[0]
        for found in reversed(entries_below(self.dataset)):  # the content of a folder before the folder
            name = found.relative_to(self.dataset).as_posix()
            if not is_folder(found):
                if name not in files:
                    found.unlink()
            elif name not in folders:
                found.rmdir()

    def _remove_links(self) -> None:
        """Remove symbolic links, so that nothing is written through one; their files are written again."""
        for folder in (self.dataset, self._shards.folder):
            if folder.is_symlink():
                folder.unlink()
            for path in entries_below(folder):
                if path.is_symlink():
                    path.unlink()

    def _take(self) -> None:
        """Create and lock the folder; a lock on a folder that was published in the meantime is discarded."""
        self.out.parent.mkdir(parents=True, exist_ok=True)
        while True:
            if self._partial.is_symlink():
                raise InputError(
                    f"{self._partial} is a symbolic link, and a build works in no folder that a link points to",
                    help="remove the link, or choose another folder",
                    code=Code.OUTPUT_IN_THE_WAY,
                )
            self._partial.mkdir(exist_ok=True)
            self._lock = open_folder(self._partial)
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(self._lock)
                raise RunError(
                    f"another build is writing {self.out}",
                    help="wait for it, or choose another folder",
                    code=Code.OUTPUT_IN_THE_WAY,
                ) from None
            except OSError:
                return  # a file system without locks
            if self._still_there():
                return
            os.close(self._lock)

    def _still_there(self) -> bool:
        try:
            here, held = self._partial.stat(), os.fstat(self._lock)
        except FileNotFoundError:
            return False
        return (here.st_dev, here.st_ino) == (held.st_dev, held.st_ino)

    def _check_is_workspace(self) -> None:
        """Raise InputError if the folder contains anything that a build does not write there."""
        found = [child for child in sorted(self._partial.iterdir()) if not _JOB_TEMPORARY.fullmatch(child.name)]
        foreign = [child.name for child in found if not _is_own(child)]
        if foreign or (found and not (self._partial / _JOB).is_file()):
            what = f"holds {foreign[0]}, which is not a build's work" if foreign else "is not a build's work"
            raise InputError(f"{self._partial} is in the way and {what}; move it away", code=Code.OUTPUT_IN_THE_WAY)
        old = self._partial / "old"
        if is_folder(old) and (os.path.lexists(self.out) or read_manifest(old) is None):
            check_files(old, old)

    def _recover(self) -> None:
        """Restore the old dataset if a build was killed between the two renames of `publish`."""
        old = self._partial / "old"
        if is_folder(old) and not os.path.lexists(self.out):
            old.rename(self.out)
        elif is_folder(old):
            remove_dataset(old)
        elif old.is_symlink():
            old.unlink()

    def _is_mine(self) -> bool:
        body = self._job.encode()
        try:
            return read_regular(self._partial / _JOB, len(body)) == body
        except (OSError, ValueError):
            return False

    def _other_recipe(self) -> str | None:
        """Return the name of the recipe whose unfinished frames are here, if it is another recipe."""
        try:
            name = json.loads(read_regular(self._partial / _JOB, _MAX_JOB))["recipe"]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        return str(name)[:100] if name != self._recipe and self._shards.frames() else None

    def _clear(self) -> None:
        """Clear the workspace for a new build.

        Raises:
            InputError: the folder holds another recipe's work and `replace` is not set.
        """
        other = self._other_recipe()
        if other is not None and not self._replace:
            raise InputError(
                f"{self._partial} holds the unfinished build of another recipe, {other!r}, and this is"
                f" {self._recipe!r}",
                help="choose another folder, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )
        for child in sorted(self._partial.iterdir()):
            if child.name in ("dataset", "shards"):
                remove_tree(child)
        write_atomic(self._partial / _JOB, self._job.encode())


def _is_own(child: Path) -> bool:
    """Return whether an entry of a workspace has the name and type of one that a build makes, or is a link."""
    if child.name in ("dataset", "shards", "old"):
        return child.is_symlink() or child.is_dir()
    return child.name == _JOB or _JOB_TEMPORARY.fullmatch(child.name) is not None
