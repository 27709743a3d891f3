"""Configures Warp so that its machine code gives the same bytes on every x86-64 CPU and on CUDA.

Every kernel module imports `wp` from here, so that Warp is configured before a kernel is declared. Fused multiply-add
and fast maths are off, and the CPU target is the generic one, because a kernel cache is shared by hosts and is not
keyed by CPU. Reverse-mode code is not generated: it would double the time to compile.
"""

from __future__ import annotations

import os
import platform
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path

import warp
from recipe_compiler.ir.errors import InputError, RunError

from recipe_runtime.cache.store import KERNELS, create_cache_folder, kernel_cache, user_cache

wp = warp
BLOCK_SIZE = 128  # threads per block on a GPU; in larger blocks too many wait for the slowest
OPTIONS = {"enable_backward": False, "fuse_fp": False, "fast_math": False, "max_unroll": 4}


def _cache_folder() -> str:
    """Return the folder for compiled kernels, by package version and machine.

    It is in RECIPE_KERNEL_CACHE or RECIPE_CACHE, if set. Otherwise, or if that is not writable, it is in the user's
    cache folder, or among temporary files if that is not writable.

    Raises:
        InputError: The folder named by a variable contains files that are not of a cache.
    """
    name = f"{version('dataset-recipe')}-{platform.machine()}"
    homes: tuple[Callable[[], Path], ...] = (kernel_cache, user_cache, _aside, _fresh)
    for home in homes:
        try:
            folder = home() / KERNELS / name
            folder.parent.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
            create_cache_folder(folder.parent.parent)
            for path in (folder.parent, folder):
                path.mkdir(mode=0o755, exist_ok=True)  # regardless of the umask
        except OSError:
            continue
        except InputError:
            if home is kernel_cache:
                raise
            continue
        if os.access(folder, os.W_OK):
            os.utime(folder)  # marks the folder as used: pruning removes the least recently used
            return str(folder)
    raise RunError("no folder for compiled kernels is writable; set RECIPE_KERNEL_CACHE to a writable one")


def _aside() -> Path:
    """Return a folder among temporary files that only this user can write to: kernels are code that is executed.

    It is not deleted: every worker needs it, and a worker that is killed could not delete it.
    """
    folder = Path(tempfile.gettempdir()) / f"dataset-recipe-{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        if _is_mine(folder):
            return folder
    return _fresh()


def _fresh() -> Path:
    return Path(tempfile.mkdtemp(prefix="dataset-recipe-kernels-"))


def _is_mine(folder: Path) -> bool:
    """Return whether a folder belongs to this user, and nobody else may write to it."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022


def _configure() -> None:
    wp.config.verbose_warnings = False
    wp.config.log_level = wp.LOG_ERROR
    wp.config.enable_backward = False
    # No flag names a CPU: the target stays generic. These raise the limits of inlining.
    wp.config.cpu_compiler_flags = "-mllvm=-inline-threshold=90000 -mllvm=-inline-cold-callsite-threshold=3000"
    wp.config.kernel_cache_dir = _cache_folder()
    with _silence():
        wp.init()


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress output of Warp's library, such as a message about a missing CUDA driver."""
    sys.stdout.flush()
    sys.stderr.flush()
    held = [os.dup(1), os.dup(2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(held[0], 1)
        os.dup2(held[1], 2)
        for descriptor in (*held, nowhere):
            os.close(descriptor)


def cuda_devices() -> list[str]:
    """Return the CUDA devices that Warp can use here, by name."""
    with _silence():
        return [f"cuda:{n}" for n in range(wp.get_cuda_device_count())] if wp.is_cuda_available() else []


_configure()
