"""Writes files to paths that the user chooses, without overwriting existing files unless requested."""

from __future__ import annotations

import itertools
import os
import stat
from collections.abc import Callable, Mapping
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core.files import write_atomic


def check_output(path: Path, *, replace: bool = False) -> None:
    """Raise InputError if a file exists at `path`, unless `replace`; called before the work begins.

    A device or a pipe is not a file: writing to it loses nothing.
    """
    if replace or not os.path.lexists(path):
        return
    if path.is_file() or (path.is_symlink() and not path.exists()):
        raise InputError(
            f"{path} exists already",
            help="choose another file, or replace it",
            code=Code.OUTPUT_IN_THE_WAY,
        )


def write_output(path: Path, body: bytes, *, replace: bool = False) -> None:
    """Write a file atomically, following a link to it.

    Raises:
        InputError: A file exists there, and `replace` is false.
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
