"""Command lines of Python child processes, with this process's import path and without the current folder.

`python -m` and `python -c` put the current folder first on the import path, so that a `numpy.py` next to a recipe would
be imported. The child's first statement sets its parent's path without the entry for the current folder.

Python's collector of reference cycles starts after 200,000 new objects instead of 700. While modules are imported it
would find hardly anything, and take a tenth of the CPU time or more. `collect_as_usual` ends this in processes that
render several scenes: the cycles of one scene hold 30 MB.
"""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

GC_THRESHOLD = 200_000  # new objects
USUAL_THRESHOLDS = 700, 10, 10
_BOOT = (
    "import sys; sys.path[:] = sys.argv[{count}:]; sys.argv[{count}:] = []; "
    f"import gc; gc.set_threshold({GC_THRESHOLD}); "
    "from {module} import {name}; {name}()"
)
_children: dict[int, subprocess.Popen[bytes]] = {}  # by the number of the thread that waits for it


@contextmanager
def registered(child: subprocess.Popen[bytes]) -> Iterator[None]:
    """Make the child that this thread waits for known to `kill_children`, inside the block."""
    _children[threading.get_ident()] = child
    try:
        yield
    finally:
        del _children[threading.get_ident()]


def kill_children(threads: Iterable[int]) -> None:
    """Kill the registered children of threads, which then stop waiting.

    Args:
        threads: their numbers (`threading.get_ident`).
    """
    for thread in threads:
        child = _children.get(thread)
        if child is not None:
            child.kill()


def collect_as_usual() -> None:
    """Collect reference cycles as often as Python does by default."""
    gc.set_threshold(*USUAL_THRESHOLDS)


def command(module: str, name: str, *arguments: str) -> list[str]:
    """The command line that imports `name` from a module and calls it; the arguments are its `sys.argv[1:]`."""
    path = [entry for entry in sys.path if entry]
    boot = _BOOT.format(count=len(arguments) + 1, module=module, name=name)
    return [sys.executable, "-X", "utf8", "-c", boot, *arguments, *path]
