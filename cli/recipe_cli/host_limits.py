"""The free disk space and memory of this host, and the limits of what an untrusted dataset may cost."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.estimate import Memory
    from recipe_compiler.ir.plan import DatasetPlan
    from recipe_runtime.dataset.reader import Dataset


def free_disk(folder: Path) -> int:
    """Return the free bytes on the file system of a folder, which need not exist yet."""
    import shutil
    import sys

    there = folder.absolute()
    while True:
        try:
            usage = shutil.disk_usage(there)
        except OSError:  # not there yet, or a name that cannot be
            there = there.parent
        else:
            return usage.free if usage.total else sys.maxsize  # some file systems report no size


def check_cost(plan: DatasetPlan, name: str, remedy: str, *, allow_large: bool = False) -> None:
    """Check that rendering the plan of a dataset, which is untrusted, does not exceed the limits of a recipe.

    Args:
        plan: the plan.
        name: the dataset's, for the message.
        remedy: the remedy of the message.
        allow_large: check nothing.

    Raises:
        InputError: its estimate exceeds a limit, and `allow_large` is not set.
    """
    from recipe_compiler.estimate import estimate
    from recipe_compiler.ir.errors import Code, InputError

    reasons = [] if allow_large else estimate(plan).over()
    if reasons:
        raise InputError(f"{name}: to render its plan, {', and '.join(reasons)}", help=remedy, code=Code.SIZE_LIMIT)


def check_bytes(dataset: Dataset, *, copies: int = 0, more: int = 0, allow_large: bool = False) -> None:
    """Check that a dataset, which is untrusted and whose files are all to be read, is not very large.

    Args:
        dataset: the dataset.
        copies: how many times a file is written, at most, under each of its names; 0 if files are only read.
        more: bytes that are written besides.
        allow_large: check nothing.

    Raises:
        InputError: these are more bytes than those of a recipe may have, and `allow_large` is not set.
    """
    from recipe_compiler.estimate import BYTE_LIMIT, size
    from recipe_compiler.ir.errors import Code, InputError

    sizes = dict[object, int]()
    for path in dataset.files:
        with suppress(OSError):
            there = (dataset.root / path).lstat()
            sizes[path if copies else (there.st_dev, there.st_ino)] = there.st_size
    total = sum(sizes.values()) * max(copies, 1) + more
    if total > BYTE_LIMIT and not allow_large:
        times = f", written up to {copies} times" if copies > 1 else ""
        raise InputError(
            f"{dataset.name}: its files have {size(total)}{times}, over {size(BYTE_LIMIT)}",
            help="give --allow-large if that is expected",
            code=Code.SIZE_LIMIT,
        )


def memory(workers: int) -> Memory:
    """Return the memory of this host, for a build with that many workers."""
    from recipe_compiler.estimate import Memory
    from recipe_runtime.core import host

    return Memory(host.total_memory(), host.process_memory_limit(), workers)
