"""The secret that seals the journal of a build, so that only this host's user can write a valid one.

It is 32 random bytes in the cache folder, made once. No byte of a dataset depends on it.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from recipe_compiler.ir.errors import RecipeError

from recipe_runtime.cache.store import create_cache_folder
from recipe_runtime.core.files import open_no_follow
from recipe_runtime.core.host import fresh_key

KEY = "journal-key"
_BYTES = 32


def read_key(cache: Path) -> bytes | None:
    """Return the key of a cache folder; None if it has none, or one that others may have written or read."""
    try:
        with open_no_follow(cache / KEY) as file:
            found = os.fstat(file.fileno())
            if found.st_uid != os.geteuid() or found.st_mode & 0o077:
                return None
            key = file.read(_BYTES + 1)
    except OSError:
        return None
    return key if len(key) == _BYTES else None


def journal_key(cache: Path) -> bytes:
    """Return the key of a cache folder; it is created if it does not exist.

    If it can neither be read nor written, the key is new on each call. An interrupted build is then started again,
    because nothing on this host proves that the work is its own.
    """
    key = read_key(cache)
    if key is None:
        with suppress(OSError, RecipeError):
            create_cache_folder(cache)
            _make(cache / KEY)
        key = read_key(cache)
    return fresh_key() if key is None else key


def _make(path: Path) -> None:
    """Write a new key, which only the user may read; of two processes at once, the first one's stays."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.0.tmp")
    temporary.unlink(missing_ok=True)
    try:
        with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600), "wb") as file:
            file.write(fresh_key())
        if read_key(path.parent) is not None:
            return
        path.unlink(missing_ok=True)  # damaged
        try:
            os.link(temporary, path)
        except FileExistsError:
            pass
        except OSError:  # a file system without links
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
