"""Atomic file writes, and reads that do not follow links."""

from __future__ import annotations

import errno
import hashlib
import itertools
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from recipe_compiler.ir.bounded_reads import open_regular
from recipe_compiler.ir.errors import Code, InputError, RunError

_NO_HARD_LINKS = (errno.EPERM, errno.EXDEV, errno.EMLINK, errno.ENOTSUP, errno.ENOSYS, errno.EACCES)
_MAX_START = 200  # bytes of a file's name in that of its temporary file, which may have 255
_ATTEMPTS = 3  # to make a folder, which another process may remove in between


def regular_file(root: Path, path: str) -> os.stat_result | None:
    """Return the status of a regular file within a folder; None if it is not one, or its path contains a link."""
    place, *rest = path.split("/")
    try:
        while rest:
            if not stat.S_ISDIR((root / place).lstat().st_mode):
                return None
            place = f"{place}/{rest.pop(0)}"
        found = (root / place).lstat()
    except OSError:
        return None
    return found if stat.S_ISREG(found.st_mode) else None


def open_no_follow(path: Path) -> BinaryIO:
    """Open a regular file for reading, unless it is a symbolic link.

    Raises:
        OSError: It cannot be opened, or is a symbolic link or another kind of file.
    """
    try:
        return open_regular(path, follow_links=False)
    except ValueError as error:
        raise OSError(errno.EINVAL, str(error), str(path)) from error


def open_inside(root: Path, path: str) -> BinaryIO:
    """Open a regular file within a folder for reading, through no link.

    What is checked is the opened file, so another program cannot replace it between the check and the reading.

    Raises:
        ValueError: The file is a pipe, a device or a folder.
        OSError: It cannot be opened, or its path contains a link.
    """
    *folders, name = path.split("/")
    handle = os.open(root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        for folder in folders:
            above, flags = handle, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
            handle = os.open(folder, flags, dir_fd=above)
            os.close(above)
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC  # a pipe must not block
        found = os.open(name, flags, dir_fd=handle)
    finally:
        os.close(handle)
    if not stat.S_ISREG(os.fstat(found).st_mode):
        os.close(found)
        raise ValueError(f"{path} is not a regular file")
    return os.fdopen(found, "rb")


def read_inside(root: Path, path: str, most: int) -> bytes:
    """Return the content of a regular file within a folder, read through no link.

    Raises:
        ValueError: The file is not regular, or has more than `most` bytes.
        OSError: It cannot be read, or its path contains a link.
    """
    with open_inside(root, path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            raise ValueError(f"{path} has {size:,} bytes, and at most {most:,} are read")
        return file.read(size)


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder and not a symbolic link to one."""
    try:
        return stat.S_ISDIR(path.lstat().st_mode)
    except OSError:
        return False


def resolved(path: Path) -> Path:
    """Return an absolute path without links; a link that leads to itself stays (`Path.resolve` raises RuntimeError)."""
    return Path(os.path.realpath(path))


def plain_path(path: Path) -> Path:
    """Return a path without `..`, which would lead nowhere while a folder before it is renamed."""
    return resolved(path) if ".." in path.parts else path


def holds_current_folder(path: Path) -> bool:
    """Return whether a path is the current folder or one above it; relative paths change when it is renamed."""
    try:
        return Path.cwd().is_relative_to(resolved(path))
    except FileNotFoundError:  # the current folder was deleted
        return False


def make_folder(path: Path) -> None:
    """Create a folder and those above it, if they are absent.

    Raises:
        NotADirectoryError: The path is a symbolic link, or a file.
    """
    path.mkdir(parents=True, exist_ok=True)
    if not is_folder(path):
        raise NotADirectoryError(errno.ENOTDIR, "it is a symbolic link", str(path))


def open_folder(path: Path) -> int:
    """Open a folder, for a lock; OSError if it is a symbolic link."""
    return os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)


def entries_below(folder: Path) -> list[Path]:
    """Return all files, links and folders below a folder, sorted; InputError if folders are nested too deeply."""
    with _limited_nesting(folder):
        return sorted(folder.rglob("*"))


def remove_tree(path: Path) -> None:
    """Delete a folder with its content, a file, or a symbolic link itself; InputError if folders nest too deeply."""
    if is_folder(path):
        with _limited_nesting(path):
            shutil.rmtree(path)
    else:
        path.unlink()


@contextmanager
def _limited_nesting(folder: Path) -> Iterator[None]:
    """Report folders that are nested deeper than Python's libraries can follow; some KB of an archive hold them."""
    try:
        yield
    except RecursionError:
        raise InputError(
            f"{folder}: its folders are nested too deeply", help="remove it", code=Code.OUTPUT_IN_THE_WAY
        ) from None


def stamp_of(found: os.stat_result) -> str:
    """Return inode and ctime in nanoseconds, which are equal until the file is written, renamed or linked.

    Programs cannot set ctime; a copy that preserves the other times has a new one.
    """
    return f"{found.st_ino} {found.st_ctime_ns}"


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a regular file, read in chunks.

    Raises:
        OSError: It cannot be read, or is a symbolic link or another kind of file.
    """
    with open_no_follow(path) as file:
        return sha256_of(file)


def sha256_of(file: BinaryIO) -> str:
    """Return the SHA-256 of the rest of a file, read in chunks."""
    hasher = hashlib.sha256()
    while piece := file.read(1 << 20):
        hasher.update(piece)
    return hasher.hexdigest()


def has_content(root: Path, path: str, size: int, sha256: str) -> bool:
    """Return whether a path within a folder is a regular file of this size and SHA-256, and contains no link."""
    there = regular_file(root, path)
    return there is not None and there.st_size == size and file_sha256(root / path) == sha256


def write_atomic(path: Path, body: bytes | bytearray | memoryview) -> None:
    """Write a file atomically. An OSError names the file."""
    with atomic_file(path) as file:
        file.write(body)


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """Open a temporary file that is renamed to `path` when the block ends, and deleted after an error.

    An OSError names the file.
    """
    temporary, handle = _fresh(path)
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from error
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def link_or_copy(source: Path, target: Path) -> None:
    """Hard-link `source` to `target`, replacing it; copies where the file system has no hard links."""
    temporary, handle = _fresh(target)
    try:
        os.close(handle)
        temporary.unlink()  # os.link does not overwrite; the name is unique to this process
        try:
            os.link(source, temporary)
        except OSError as error:
            if error.errno not in _NO_HARD_LINKS:
                raise
            shutil.copyfile(source, temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)  # rename is a no-op if both are the same file


def _fresh(path: Path) -> tuple[Path, int]:
    """Create a uniquely named temporary file next to a path, safe against writers on other hosts."""
    made, start = 0, os.fsencode(path.name)[:_MAX_START].decode(errors="ignore")
    for number in itertools.count():
        temporary = path.with_name(f".{start}.{os.getpid()}.{number}.tmp")
        try:
            return temporary, os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        except FileExistsError:
            continue
        except FileNotFoundError:
            if made == _ATTEMPTS:  # a folder that takes no files, such as /proc
                raise
            path.parent.mkdir(parents=True, exist_ok=True)
            made += 1
    raise AssertionError("a count has no end")


@contextmanager
def host_errors(what: str, remedy: str) -> Iterator[None]:
    """Convert an OSError into a RunError that names what could not be written and the remedy."""
    try:
        yield
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            remedy = "choose a shorter name"
        reason = error.strerror or type(error).__name__
        raise RunError(f"{what} cannot be written: {reason}; {remedy}") from error
