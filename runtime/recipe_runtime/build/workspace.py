"""The workspace of a build: a sibling of the output folder, which one rename publishes when the dataset is complete.

    .<name>.partial/
        job.json      the plan, tools and code of the build; sealed with this host's key
        shards/       one record per finished shard, written after its files; the name ends with the number of frames
        dataset/      the files written so far
        old/          the dataset that is being replaced, between two renames

The next build of the same plan resumes an interrupted one if the seals were made with the key in this user's cache.
Otherwise, as with a folder that came with a downloaded recipe, the workspace is cleared. Only one build at a time uses
a workspace; the lock is released when its process ends.
"""

from __future__ import annotations

import fcntl
import hashlib
import hmac
import json
import os
import shutil
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.annotate.records import FileRow, FrameRecord
from recipe_runtime.build.journal import FolderJournal
from recipe_runtime.core import layout
from recipe_runtime.core.files import (
    atomic_file,
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
from recipe_runtime.dataset.manifest import DAMAGE, listed_files
from recipe_runtime.dataset.manifest_types import Manifest, ManifestHead
from recipe_runtime.dataset.schedule import Shard, View

_JOB = "job.json"
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
    """

    def __init__(self, out: Path, job: BuildJob | None, *, replace: bool = False, key: bytes = b"") -> None:
        self.out = out
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
        """Complete or undo the renames of a build that was killed within `publish`."""
        work = cls(out, None)
        if not is_folder(work._partial):
            return
        ended = out.exists() and not work.dataset.exists()
        if not ended and not is_folder(work._partial / "old"):
            return
        with host_errors(str(work._partial), _REMEDY):
            work._take()
            try:
                work._recover()
                if out.exists() and not work.dataset.exists() and (work._partial / "job.json").is_file():
                    work._remove()
            finally:
                os.close(work._lock)

    def publish(self, files: Mapping[str, FileRow]) -> None:
        """Publish the dataset, in place of the existing one.

        Args:
            files: the rows of all files of the dataset, by path.

        Raises:
            InputError: meanwhile the existing dataset has received a file that is not its own; nothing is published.
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
            if self.out.exists():
                check_out(self.out)  # again: files may have been added during the build
                self.out.rename(self._partial / "old")
            self.dataset.rename(self.out)
            self._remove()

    def abandon(self) -> None:
        """Remove the workspace, which contains nothing worth resuming."""
        with host_errors(str(self._partial), _REMEDY):
            self._remove()

    def _remove(self) -> None:
        """Remove the folder; `job.json` is removed last, so that an interrupted removal can be resumed."""
        for child in sorted(self._partial.iterdir()):
            if child.name != _JOB:
                remove_tree(child)
        shutil.rmtree(self._partial)

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
        for found in sorted(self.dataset.rglob("*"), reverse=True):  # the content of a folder before the folder
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
            for path in sorted(folder.rglob("*")):
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

    def _recover(self) -> None:
        """Restore the old dataset if a build was killed between the two renames of `publish`."""
        old = self._partial / "old"
        if is_folder(old) and not self.out.exists():
            old.rename(self.out)
        elif is_folder(old) or old.is_symlink():
            remove_tree(old)

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
            InputError: the folder is not a workspace, or holds another recipe's work and `replace` is not set.
        """
        if any(self._partial.iterdir()) and not (self._partial / _JOB).is_file():
            raise InputError(
                f"{self._partial} is in the way and is not a build's work; move it away", code=Code.OUTPUT_IN_THE_WAY
            )
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


def check_out(out: Path) -> None:
    """Check that a dataset can be put in place of `out`.

    Raises:
        InputError: `out` exists and is not a dataset of this program, or contains other files as well; or a parent of
            it is a file.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InputError(f"{out} is not a folder", help="choose another folder", code=Code.OUTPUT_IN_THE_WAY)
    above = next(folder for folder in out.absolute().parents if os.path.lexists(folder))
    if not above.is_dir():
        what = "a symbolic link that leads to no folder" if above.is_symlink() else "a file"
        raise InputError(f"{out}: {above} is {what}", help="choose another folder", code=Code.OUTPUT_IN_THE_WAY)
    if out.is_mount():  # publishing is a rename, which cannot replace a mount point
        remedy = f"choose a folder in it, such as {out / 'dataset'}"
        raise InputError(f"{out} is a mount point", help=remedy, code=Code.OUTPUT_IN_THE_WAY)
    manifest_reader.check_outside_datasets(out)
    if not out.is_dir() or not any(out.iterdir()):
        return
    manifest = read_manifest(out)
    if manifest is None:
        raise _no_manifest(out)
    try:
        known = {layout.MANIFEST, *listed_files(manifest)}
    except ValueError:
        known = {layout.MANIFEST}  # damaged: no other file here is then known to belong to the dataset
    found = (p.relative_to(out).as_posix() for p in sorted(out.rglob("*")) if p.is_symlink() or not p.is_dir())
    foreign = [path for path in found if path not in known]
    if foreign:
        raise InputError(
            f"{out} holds a file that is not the dataset's, {foreign[0]}; move it away before it is replaced"
        )


def _no_manifest(out: Path) -> InputError:
    """Return the error for a folder with files in which no manifest of a dataset can be read."""
    message, remedy = (
        f"{out} holds files but no {layout.MANIFEST} of a dataset",
        "move it away, or choose another folder",
    )
    if (out / layout.MANIFEST).exists():
        message = f"{out}: its {layout.MANIFEST} is damaged, or another program's"
        if not os.access(out / layout.MANIFEST, os.R_OK):
            message = f"{out}: its {layout.MANIFEST} cannot be read: permission denied"
            remedy = "allow this user to read it"
    return InputError(message, help=remedy, code=Code.OUTPUT_IN_THE_WAY)


def read_manifest(out: Path) -> Manifest | None:
    """Return the manifest in a folder; None if there is none, it is damaged, or another program wrote it."""
    try:
        return manifest_reader.read(out)
    except (OSError, ValueError):
        return None
