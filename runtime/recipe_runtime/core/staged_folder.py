"""A folder that is written next to its place and put there by one rename: a dataset, an export, a local upload.

    .NAME.partial/
        work.txt     the owner and the key of the work; marks the folder as one of these
        dataset/     the files written so far
        old/         the replaced folder, between two renames
        removed/     the replaced folder, while it is deleted

Nothing is destroyed that this program did not make. A replaced folder is deleted only if it holds no files but those
of its index, unchanged; otherwise it stays as `NAME.replaced`. A process may be killed at any point: the next one that
uses the work folder, or `settle`, moves the old folder back, or completes the replacement.
"""

from __future__ import annotations

import fcntl
import os
import stat
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TypeAlias

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.core.files import (
    entries_below,
    file_sha256,
    holds_current_folder,
    is_folder,
    make_folder,
    open_folder,
    regular_file,
    remove_tree,
    resolved,
)
from recipe_runtime.core.outputs import suffixes

_MARKER = "work.txt"


@dataclass(frozen=True)
class Index:
    """The file by which a kind of folder lists its other files.

    Attributes:
        name: the file's name.
        read: returns size in bytes and SHA-256 of each file of a folder, by path; None if it has no valid index.
    """

    name: str
    read: Callable[[Path], Mapping[str, tuple[int, str]] | None]


Notice: TypeAlias = Callable[[str], None]  # takes a line of text for the user


def ignore(notice: str) -> None:
    """Take a notice, and do nothing."""


def check_place(out: Path) -> None:
    """Check that a folder can be put at a path by a rename, or in place of the folder there.

    Raises:
        InputError: a file or a link is there or above it, or the path is a mount point, or the current folder or above.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InputError(f"{out} is not a folder", help="choose another folder", code=Code.OUTPUT_IN_THE_WAY)
    above = next((folder for folder in out.absolute().parents if os.path.lexists(folder)), None)
    if above is not None and not above.is_dir():
        what = "a symbolic link that leads to no folder" if above.is_symlink() else "a file"
        raise InputError(f"{out}: {above} is {what}", help="choose another folder", code=Code.OUTPUT_IN_THE_WAY)
    if out.absolute().is_mount():
        remedy = f"choose a folder in it, such as {out / 'dataset'}"
        raise InputError(f"{out} is a mount point", help=remedy, code=Code.OUTPUT_IN_THE_WAY)
    if holds_current_folder(out):
        raise InputError(
            f"{out} is the current folder or contains it, and that cannot be replaced",
            help="change to another folder, or choose another one",
            code=Code.OUTPUT_IN_THE_WAY,
        )


def check_apart(out: Path, other: Path, what: str) -> None:
    """Check that neither of two folders is the other one or in it; links and mounts are followed.

    Args:
        out: the output folder.
        other: the other folder.
        what: what it is, for the message: `where the dataset is built`.

    Raises:
        InputError: they are not apart.
    """
    here, there = resolved(other), resolved(out)
    same = there.exists() and here.exists() and there.samefile(here)
    if same or here.is_relative_to(there) or there.is_relative_to(here):
        message = f"{out} is not apart from {other}, {what}"
        raise InputError(message, help="choose a folder outside of it", code=Code.OUTPUT_IN_THE_WAY)


def is_free(out: Path) -> bool:
    """Return whether nothing is at a path, or an empty folder."""
    return not os.path.lexists(out) or (is_folder(out) and not any(out.iterdir()))


def holds_only(folder: Path, index: Index, *, changed: bool = False) -> bool:
    """Return whether a folder holds no files but those of its index, unchanged; some may be missing.

    If `changed`, the content of the files does not matter. Otherwise a file is unchanged if it has the listed size and
    is not newer than the index, which is written last, or has the listed SHA-256.
    """
    try:
        rows, written = index.read(folder), regular_file(folder, index.name)
        files = [path for path in entries_below(folder) if not is_folder(path)]
        if rows is None or written is None:
            return not files
        names = {path: path.relative_to(folder).as_posix() for path in files}
        if not {*rows, index.name}.issuperset(names.values()):
            return False
        return changed or all(
            _is_unchanged(path, *rows[name], written.st_mtime_ns) for path, name in names.items() if name != index.name
        )
    except (OSError, ValueError, InputError):  # it cannot be read, so nothing is known of it
        return False


def _is_unchanged(path: Path, size: int, sha256: str, written: int) -> bool:
    found = path.lstat()
    whole = stat.S_ISREG(found.st_mode) and found.st_size == size
    return whole and (found.st_mtime_ns <= written or file_sha256(path) == sha256)


class StagedFolder:
    """The work folder of an output; a context manager that holds its lock.

    The work stays after an error, for the next process with the same key; `remove` deletes it.

    Args:
        out: the output folder, checked by `check_place`.
        index: the index of folders of its kind.
        owner: what the output is of, such as a recipe. Unfinished work of another owner is kept unless `replace`.
        key: what is made. Unfinished work with the same owner and key is continued, other work is deleted; "" if work
            is never continued.
        replace: whether the unfinished work of another owner may be deleted.
        repair: whether changed files of the replaced folder are damage, and may be deleted.
        notice: called with a line of text if a replaced folder is kept.

    Attributes:
        out: the output folder.
        partial: the work folder.
        files: the folder in it in which the output is written.

    Raises:
        InputError: on entry, if a folder that this program did not make, or work of another owner, is in the way.
        RunError: on entry, if another process uses the work folder.
        OSError: on entry, and from all methods, if the host fails.
    """

    def __init__(
        self,
        out: Path,
        index: Index,
        *,
        owner: str = "",
        key: str = "",
        replace: bool = False,
        repair: bool = False,
        notice: Notice = ignore,
    ) -> None:
        self.out, self.partial = out, out.parent / f".{out.name}.partial"
        self.files = self.partial / "dataset"
        self._old, self._removed = self.partial / "old", self.partial / "removed"
        self._index, self._owner, self._key = index, owner, key
        self._replace, self._repair, self._notice = replace, repair, notice
        self._lock = -1

    def __enter__(self) -> StagedFolder:
        self.out.parent.mkdir(parents=True, exist_ok=True)
        self.partial.mkdir(exist_ok=True)
        self._take()
        try:
            self._recover()
            if not self.is_continued():
                self._check_owner()
                self.clear()
                self._marker.write_bytes(self._work)
            make_folder(self.files)
        except BaseException:
            os.close(self._lock)
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        os.close(self._lock)

    def is_continued(self) -> bool:
        """Return whether the work folder holds unfinished work with the same owner and key."""
        try:
            return bool(self._key) and self._marker.read_bytes() == self._work
        except OSError:
            return False

    def publish(self) -> None:
        """Put the folder of files in its place, and remove the work folder.

        A folder that is there is deleted if it holds no files but its own, and else kept as `NAME.replaced`.
        """
        check_place(self.out)  # again: something may have appeared there
        try:
            if os.path.lexists(self.out):
                self.out.rename(self._old)
            self.files.rename(self.out)
        except BaseException:
            if is_folder(self._old) and not os.path.lexists(self.out):
                self._old.rename(self.out)
            raise
        self._discard()
        self.remove()

    def settle(self) -> None:
        """Complete or undo the renames of a process that was killed within `publish`; called without the lock.

        Raises:
            RunError: another process uses the work folder.
        """
        published = os.path.lexists(self.out) and not os.path.lexists(self.files)
        if not is_folder(self.partial) or not (published or is_folder(self._old)):
            return
        self._take()
        try:
            self._recover()
            if published:
                self.remove()
        finally:
            os.close(self._lock)

    def clear(self) -> None:
        """Delete the files written so far."""
        if os.path.lexists(self.files):
            remove_tree(self.files)

    def remove(self) -> None:
        """Delete the work folder, the marker last, so that an interrupted removal can be completed.

        A replaced folder that is still in it stays, with the marker: the next process completes the replacement.
        """
        self.clear()
        if is_folder(self._old) or is_folder(self._removed):
            return
        self._marker.unlink(missing_ok=True)
        with suppress(OSError):  # the user has put a file there
            self.partial.rmdir()

    @property
    def _marker(self) -> Path:
        return self.partial / _MARKER

    @property
    def _work(self) -> bytes:
        return f"{self._owner}\n{self._key}\n".encode()

    def _take(self) -> None:
        """Lock the work folder.

        Raises:
            InputError: it has files but no marker.
            RunError: another process holds the lock.
        """
        remedy = "wait for it, or choose another folder"
        busy = RunError(f"another process is writing {self.out}", help=remedy, code=Code.OUTPUT_IN_THE_WAY)
        self._lock = open_folder(self.partial)
        try:
            with suppress(OSError):  # a file system without locks
                try:
                    fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    raise busy from None
            if not os.path.samestat(os.fstat(self._lock), self.partial.lstat()):
                raise busy  # that process has published it
            if not self._marker.is_file() and not is_free(self.partial):
                what = "is in the way and was not made by this program"
                raise InputError(f"{self.partial} {what}; move it away", code=Code.OUTPUT_IN_THE_WAY)
        except BaseException:
            os.close(self._lock)
            raise

    def _recover(self) -> None:
        """Move the old folder back, or complete its replacement."""
        if is_folder(self._removed):
            remove_tree(self._removed)
        if is_folder(self._old) and not os.path.lexists(self.out):
            self._old.rename(self.out)
        self._discard()

    def _discard(self) -> None:
        """Delete the replaced folder, or keep it next to the new one."""
        if not is_folder(self._old):
            return
        if holds_only(self._old, self._index, changed=self._repair):
            self._old.rename(self._removed)  # from here on it is deleted, wherever this process is stopped
            remove_tree(self._removed)
            return
        names = (self.out.with_name(f"{self.out.name}.replaced{suffix}") for suffix in suffixes())
        kept = next(name for name in names if not os.path.lexists(name))
        self._old.rename(kept)
        self._notice(f"{self.out} held files besides its own, or changed ones; it is kept as {kept}")

    def _check_owner(self) -> None:
        """Raise InputError if the work folder holds unfinished work of another owner, unless it may be replaced."""
        try:
            other = self._marker.read_bytes().partition(b"\n")[0].decode(errors="replace")
        except OSError:
            return
        if other not in ("", self._owner) and not self._replace and not is_free(self.files):
            raise InputError(
                f"{self.partial} holds unfinished work of {other[:100]!r}, and this is {self._owner!r}",
                help="choose another folder, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )
