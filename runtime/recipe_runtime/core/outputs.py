"""Writes files to paths that the user chooses, without overwriting existing files unless requested."""

from __future__ import annotations

import itertools
import os
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core.files import write_atomic

_DEVICES = ("/dev/", "/proc/")  # /dev/stdout leads to a descriptor in /proc


def check_output(path: Path, *, replace: bool = False, help: str = "choose another file, or replace it") -> None:
    """Raise InputError, with the remedy `help`, if a file exists at `path`, unless `replace`; called before the work.

    A pipe, or a device in /dev such as /dev/stdout, is not a file: writing to it loses nothing. Symbolic links and
    devices elsewhere may have come with the folder, and lead to other files or to a disk.
    """
    in_dev = os.path.normpath(path.absolute()).startswith(_DEVICES)
    if path.is_symlink() and (path.is_file() or not path.exists() or not in_dev):
        raise InputError(
            f"{path} is a symbolic link, and files are not written through one",
            help="remove the link, or name the file that it leads to",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if path.is_block_device() or (path.is_char_device() and not in_dev):
        raise InputError(f"{path} is a device", help="choose another file", code=Code.OUTPUT_IN_THE_WAY)
    if replace or not os.path.lexists(path):
        return
    if path.is_file():
        raise InputError(
            f"{path} exists already",
            help=help,
            code=Code.OUTPUT_IN_THE_WAY,
        )


def check_not_input(path: Path, inputs: Iterable[Path]) -> None:
    """Raise InputError if `path` is one of the files that a command reads, which it never replaces."""
    if any(path.exists() and file.exists() and path.samefile(file) for file in inputs):
        raise InputError(
            f"{path} is a file that the recipe uses", help="choose another file", code=Code.OUTPUT_IN_THE_WAY
        )


def write_output(path: Path, body: bytes, *, replace: bool = False) -> None:
    """Write a file atomically, or write to a pipe or a device.

    Raises:
        InputError: `check_output` refuses the path.
        OSError: the host cannot write it.
    """
    check_output(path, replace=replace)
    if path.exists() and not path.is_file():
        with path.open("wb") as file:
            file.write(body)
    else:
        write_atomic(path.resolve(), body)


def unused_names(outputs: Callable[[str], Mapping[Path, bytes]]) -> Mapping[Path, bytes]:
    """Return files under the first free names, or under names that already have equal content.

    Args:
        outputs: Returns the files by path for a suffix of their names, one of `suffixes`.
    """
    return next(
        files
        for files in map(outputs, suffixes())
        if all(not os.path.lexists(path) or holds(path, body) for path, body in files.items())
    )


def suffixes() -> Iterator[str]:
    """Yield the suffixes of names until one is free: "", ".2", ".3" and so on."""
    yield from itertools.chain([""], (f".{number}" for number in itertools.count(2)))


def holds(path: Path, body: bytes) -> bool:
    """Return whether a path is a file with this content."""
    found = path.lstat()
    return stat.S_ISREG(found.st_mode) and found.st_size == len(body) and path.read_bytes() == body
