"""Warp, set up once so that its machine code gives the same bytes on every x86-64 CPU and on CUDA.

Every kernel module imports this one first: `wp` from here is configured before a kernel is declared. Fused
multiply-add and fast maths are off, and the CPU target is the generic one, because a kernel cache is shared by hosts
and is not keyed by CPU. Reverse-mode code is never made: it would double the time to compile.
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

import platformdirs
import warp
from recipe_compiler.ir.errors import InputError, RunError

from recipe_runtime.cache.cache_folder import create_cache_folder
from recipe_runtime.cache.store import kernel_cache

wp = warp
OPTIONS = {"enable_backward": False, "fuse_fp": False, "fast_math": False, "max_unroll": 4}


def _cache_folder() -> str:
    """The folder for compiled kernels, by package version and machine: RECIPE_KERNEL_CACHE or RECIPE_CACHE, if set.

    Else, or if that is barred or may be written by others, the user's own; one among temporary files if that is barred.
    InputError if the folder that was named holds what is not of a cache.
    """
    name = f"{version('dataset-recipe')}-{platform.machine()}"
    own = Path(platformdirs.user_cache_dir("dataset-recipe"))
    homes: tuple[Callable[[], Path], ...] = (kernel_cache, lambda: own, _aside, _fresh)
    for home in homes:
        folder = home() / "kernels" / name
        try:
            folder.parent.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
            create_cache_folder(folder.parent.parent)
            for path in (folder.parent, folder):
                path.mkdir(mode=0o755, exist_ok=True)  # whatever the umask lets others do
        except OSError:
            continue
        except InputError:
            if home is kernel_cache:
                raise
            continue
        barred = home is kernel_cache and not all(map(_is_mine, (folder, folder.parent, folder.parent.parent)))
        if os.access(folder, os.W_OK) and not barred:
            os.utime(folder)  # in use: pruning takes what was not used for longest
            return str(folder)
    raise RunError("no folder for compiled kernels can be written to; set RECIPE_KERNEL_CACHE to one that can")


def _aside() -> Path:
    """A folder among temporary files that is this user's alone: kernels are code, and another's would be run.

    It stays, for every worker needs it, and a worker that is killed could not clear it away.
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
    """Whether a folder is this user's, and nobody else may write to it."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022


def _configure() -> None:
    wp.config.verbose_warnings = False
    wp.config.log_level = wp.LOG_ERROR
    wp.config.enable_backward = False
    # Nothing about a CPU: the target stays the generic one. Functions are inlined as far as Warp's own setting goes.
    wp.config.cpu_compiler_flags = "-mllvm=-inline-threshold=90000 -mllvm=-inline-cold-callsite-threshold=3000"
    wp.config.kernel_cache_dir = _cache_folder()
    with _silence():
        wp.init()


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what Warp's library prints of its own accord (no CUDA driver here, say) from the terminal."""
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
    """The CUDA devices that Warp can use here, by name."""
    with _silence():
        return [f"cuda:{n}" for n in range(wp.get_cuda_device_count())] if wp.is_cuda_available() else []


_configure()
