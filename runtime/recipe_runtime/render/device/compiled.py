"""Compiled kernels, checked by digest when they are loaded: power loss leaves empty ones, and altered ones draw wrong.

Warp compiles a module into a folder of its own, `wp_<module>_<hash>`, and later loads what lies there. Beside its files
lies `wp_<module>_<hash>.sha256`, in the form of sha256sum, written once Warp has loaded what it compiled. A folder with
other files than those of the list is removed, and the module compiled again.

One process at a time compiles. The others wait for it, and then find the folder whole.
"""

from __future__ import annotations

import fcntl
import logging
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from recipe_compiler.ir.errors import RunError, printable

from recipe_runtime.cache import cache_folder
from recipe_runtime.core.files import file_sha256, write_atomic

LOCK_SECONDS = 300.0  # a process that is stopped while it compiles does not stop the others for longer
_POLL_SECONDS = 0.1
_LOADED = (".o", ".cubin", ".ptx", ".meta")
_warned: set[Path] = set()  # folders of modules of which one was damaged
_announced: set[Path] = set()  # folders of modules of which the first was compiled
_LOG = logging.getLogger(__name__)  # where a program sets up no logging, a warning is a line on standard error


def load(wp: Any, module: Any, device: str, block_dim: int) -> None:
    """Load a Warp module for a device, compiled again if what is kept of it is not what was compiled.

    Args:
        wp: Warp itself, once it is configured.
        module: A kernel's module.
        device: `cpu` or `cuda:N`.
        block_dim: Threads of a block, as the module is launched with.

    Raises:
        RunError: A damaged kernel cannot be removed.
    """
    folder = Path(wp.config.kernel_cache_dir) / module.get_module_identifier(1 if device == "cpu" else block_dim)
    if is_whole(folder):
        wp.load_module(module, device=device, block_dim=block_dim)
        if set(_kept(folder)) != set(_listed(folder)):  # another GPU's was there, and this one's is new
            _note(folder)
        return
    with _alone(folder.parent):
        if not is_whole(folder):
            _discard(folder)
            _announce(folder, device)
        wp.load_module(module, device=device, block_dim=block_dim)
        _note(folder)


def is_whole(folder: Path) -> bool:
    """Whether the files of a compiled module are those that its list of digests names."""
    listed = _listed(folder)
    try:
        return bool(listed) and {name: file_sha256(folder / name) for name in _kept(folder)} == listed
    except OSError:
        return False


def _note(folder: Path) -> None:
    """List the digests of a compiled module's files beside them. Where that fails, the next process compiles again."""
    with suppress(OSError):
        rows = [f"{file_sha256(folder / name)}  {name}\n" for name in _kept(folder)]
        if rows:
            write_atomic(_list(folder), "".join(rows).encode())


def _discard(folder: Path) -> None:
    """Remove what is left of a compiled module, and say so."""
    if not folder.exists() and not folder.is_symlink():
        return
    try:
        cache_folder.remove(folder, folder.parents[3])
        if _kept(folder) or folder.is_symlink() or (folder.exists() and not folder.is_dir()):
            raise OSError(None, "something else lies there")
    except OSError as error:
        raise RunError(
            f"the compiled kernel {folder} is damaged and cannot be removed: {error.strerror}; remove it,"
            " or set RECIPE_KERNEL_CACHE to another folder"
        ) from error
    if folder.parent not in _warned:  # one line, however many modules
        _warned.add(folder.parent)
        text = "compiled kernels in %s are damaged, or from an earlier version; compiling them again"
        _LOG.warning(text, printable(str(folder.parent)))


def _announce(folder: Path, device: str) -> None:
    """Say that compiling takes a while, once: before the first module of a version for this kind of device."""
    suffixes = (".o",) if device == "cpu" else (".cubin", ".ptx")
    if folder.parent in _warned | _announced or any(p.suffix in suffixes for p in sorted(folder.parent.glob("wp_*/*"))):
        return
    _announced.add(folder.parent)
    _LOG.warning("compiling kernels, once for this version: about 30 s")


def _kept(folder: Path) -> list[str]:
    """The files of a compiled module that Warp may load."""
    with suppress(OSError):
        start = f"{folder.name}."
        return sorted(p.name for p in folder.iterdir() if p.suffix in _LOADED and p.name.startswith(start))
    return []


def _listed(folder: Path) -> dict[str, str]:
    """SHA-256 by file, as the list of a compiled module has it; empty if there is none that can be read."""
    with suppress(OSError, ValueError):
        rows = (line.split("  ") for line in _list(folder).read_text("ascii").splitlines())
        return {name: value for value, name in rows}
    return {}


def _list(folder: Path) -> Path:
    return folder / f"{folder.name}.sha256"


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """While inside, no other process compiles into a folder; where files cannot be locked, several may.

    That costs their time and nothing else: Warp puts a module into place by one rename.
    """
    handle = -1
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        _lock(handle)
    try:
        yield
    finally:
        if handle >= 0:
            with suppress(OSError):
                fcntl.flock(handle, fcntl.LOCK_UN)  # a child that was forked meanwhile has the handle too
            os.close(handle)


def _lock(handle: int) -> None:
    end = time.monotonic() + LOCK_SECONDS
    while time.monotonic() < end:
        try:
            return fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_POLL_SECONDS)
