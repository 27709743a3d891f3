"""Compiled kernels, verified by digest when they are loaded.

Power loss leaves empty files, and altered files render wrongly. Warp compiles a module into a folder of its own,
`wp_<module>_<hash>`, and later loads the files in it. Next to these files is `wp_<module>_<hash>.sha256`, in the format
of sha256sum, written once Warp has loaded what it compiled. A folder with other files than those of the list is
removed, and the module compiled again.

Only one process at a time compiles. The others wait for it, and then find a complete folder.
"""

from __future__ import annotations

import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from recipe_compiler.ir.errors import RunError, printable

from recipe_runtime.core.files import file_sha256, remove_tree, write_atomic

_LOADED = (".o", ".cubin", ".ptx", ".meta")
_warned: set[Path] = set()  # folders for which damage was reported
_announced: set[Path] = set()  # folders for which compiling was announced
_LOG = logging.getLogger(__name__)  # without logging set up, warnings are printed on standard error


def load(wp: Any, module: Any, device: str, block_dim: int) -> None:
    """Load a Warp module for a device; a damaged one is compiled again.

    Args:
        wp: Warp itself, once it is configured.
        module: The module of a kernel.
        device: `cpu` or `cuda:N`.
        block_dim: Threads per block, as the module is launched.

    Raises:
        RunError: A damaged kernel cannot be removed.
    """
    folder = Path(wp.config.kernel_cache_dir) / module.get_module_identifier(1 if device == "cpu" else block_dim)
    if is_whole(folder):
        wp.load_module(module, device=device, block_dim=block_dim)
        if set(_kept(folder)) != set(
            _listed(folder)
        ):  # for example, files for another GPU existed, and this one's are new
            _note(folder)
        return
    with _alone(folder.parent):
        if not is_whole(folder):
            _discard(folder)
            _announce(folder, device)
        wp.load_module(module, device=device, block_dim=block_dim)
        _note(folder)


def is_whole(folder: Path) -> bool:
    """Return whether the files of a compiled module are those in its list of digests."""
    listed = _listed(folder)
    try:
        return bool(listed) and {name: file_sha256(folder / name) for name in _kept(folder)} == listed
    except OSError:
        return False


def _note(folder: Path) -> None:
    """Write the list of digests of a compiled module's files. If that fails, the next process compiles again."""
    with suppress(OSError):
        rows = [f"{file_sha256(folder / name)}  {name}\n" for name in _kept(folder)]
        if rows:
            write_atomic(_list(folder), "".join(rows).encode())


def _discard(folder: Path) -> None:
    """Remove a damaged compiled module, and log a warning."""
    if not folder.exists() and not folder.is_symlink():
        return
    try:
        remove_tree(folder)
    except OSError as error:
        raise RunError(
            f"the compiled kernel {folder} is damaged and cannot be removed: {error.strerror}; remove it,"
            " or set RECIPE_KERNEL_CACHE to another folder"
        ) from error
    if folder.parent not in _warned:  # one line for all modules
        _warned.add(folder.parent)
        text = "compiled kernels in %s are damaged, or from an earlier version; compiling them again"
        _LOG.warning(text, printable(str(folder.parent)))


def _announce(folder: Path, device: str) -> None:
    """Log, once per version and kind of device, that compiling takes a while."""
    suffixes = (".o",) if device == "cpu" else (".cubin", ".ptx")
    if folder.parent in _warned | _announced or any(p.suffix in suffixes for p in sorted(folder.parent.glob("wp_*/*"))):
        return
    _announced.add(folder.parent)
    _LOG.warning("compiling kernels, once for this version: about 30 s")


def _kept(folder: Path) -> list[str]:
    """Return the files of a compiled module that Warp may load."""
    with suppress(OSError):
        start = f"{folder.name}."
        return sorted(p.name for p in folder.iterdir() if p.suffix in _LOADED and p.name.startswith(start))
    return []


def _listed(folder: Path) -> dict[str, str]:
    """Return SHA-256 by file from the list of a compiled module; empty if it cannot be read."""
    with suppress(OSError, ValueError):
        rows = (line.split("  ") for line in _list(folder).read_text("ascii").splitlines())
        return {name: value for value, name in rows}
    return {}


def _list(folder: Path) -> Path:
    return folder / f"{folder.name}.sha256"


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, so that no other process compiles into it; where files cannot be locked, several may.

    That costs only time: Warp puts a module into place by one rename.
    """
    handle = -1
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if handle >= 0:
            with suppress(OSError):
                fcntl.flock(handle, fcntl.LOCK_UN)  # a forked child has the handle too
            os.close(handle)
