"""Files that a command writes to a place that the user names: nothing that is there already is written over unasked."""

from __future__ import annotations

import itertools
import os
import stat
from collections.abc import Callable, Mapping
from pathlib import Path

from recipe_compiler.ir.errors import InputError

from recipe_runtime.core.files import write_atomic


def check_output(path: Path, *, replace: bool = False) -> None:
    """Before the work: InputError if a file stands at `path`, unless `replace`.

    A device or a pipe is not a file: writing to it loses nothing.
    """
    if replace or not os.path.lexists(path):
        return
    if path.is_file() or (path.is_symlink() and not path.exists()):
        raise InputError(f"{path} is there already; name another file, or add --replace to write over it")


def write_output(path: Path, body: bytes, *, replace: bool = False) -> None:
    """Write a file, whole or not at all, and follow a link to it.

    Raises:
        InputError: a file stands there, and not `replace`.
        OSError: the host cannot write it.
    """
    check_output(path, replace=replace)
    if path.exists() and not path.is_file():
        path.write_bytes(body)
    else:
        write_atomic(path.resolve(), body)


def unused_names(outputs: Callable[[str], Mapping[Path, bytes]]) -> Mapping[Path, bytes]:
    """Files under names that the command chooses: the first at which nothing stands, or the very same files.

    Args:
        outputs: the files' bytes by path, for a suffix of their names: "", ".2", ".3" and so on.
    """
    for number in itertools.count(1):
        files = outputs("" if number == 1 else f".{number}")
        if all(not os.path.lexists(path) or _holds(path, body) for path, body in files.items()):
            return files
    raise AssertionError("a count has no end")


def _holds(path: Path, body: bytes) -> bool:
    found = path.lstat()
    return stat.S_ISREG(found.st_mode) and found.st_size == len(body) and path.read_bytes() == body
