"""Writes files to paths that the user chooses, without overwriting existing files unless requested."""

from __future__ import annotations

import itertools
import os
import stat
from collections.abc import Callable, Mapping
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core.files import write_atomic


def check_output(path: Path, *, replace: bool = False, help: str = "choose another file, or replace it") -> None:
    """Raise InputError, with the remedy `help`, if a file exists at `path`, unless `replace`; called before the work.

    A device or a pipe is not a file: writing to it loses nothing. A file is not replaced through a symbolic link, which
    may have come with the folder.
    """
    if path.is_symlink() and (path.is_file() or not path.exists()):
        raise InputError(
            f"{path} is a symbolic link, and files are not written through one",
            help="remove the link, or name the file that it leads to",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if replace or not os.path.lexists(path):
        return
    if path.is_file():
        raise InputError(
            f"{path} exists already",
            help=help,
            code=Code.OUTPUT_IN_THE_WAY,
        )


def write_output(path: Path, body: bytes, *, replace: bool = False) -> None:
    """Write a file atomically. A link to a device or a pipe is followed; one to a file is refused.

    Raises:
        InputError: A file exists there, and `replace` is false; or a link to a file.
        OSError: the host cannot write it.
    """
    check_output(path, replace=replace)
    if path.exists() and not path.is_file():
        path.write_bytes(body)
    else:
        write_atomic(path.resolve(), body)


def unused_names(outputs: Callable[[str], Mapping[Path, bytes]]) -> Mapping[Path, bytes]:
    """Return files under the first free names, or under names that already have equal content.

    Args:
        outputs: Returns the files by path for a suffix of their names: "", ".2", ".3" and so on.
    """
    for number in itertools.count(1):
        files = outputs("" if number == 1 else f".{number}")
        if all(not os.path.lexists(path) or _holds(path, body) for path, body in files.items()):
            return files
    raise AssertionError("a count has no end")


def _holds(path: Path, body: bytes) -> bool:
    found = path.lstat()
    return stat.S_ISREG(found.st_mode) and found.st_size == len(body) and path.read_bytes() == body
