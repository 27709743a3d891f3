"""CPU time of a command and of every process that it starts, whichever parent they have later.

`getrusage` reports children that were waited for, but Ray's workers are children of a daemon. Therefore all processes
that inherited a marker in their environment are sampled five times per second until the command has ended. The time
after the last sample of each, a tenth of a second on average, is missing. Linux only.
"""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from pathlib import Path

EVERY = 0.2  # seconds between two measurements
_MARK = "RECIPE_BENCH_RUN"
_TICK = os.sysconf("SC_CLK_TCK")


class Meter:
    """Context manager that counts CPU time; `environment` is for the command, `seconds` is the result."""

    def __init__(self) -> None:
        self._mark = f"{_MARK}={os.getpid()}-{id(self)}"
        self._spent: dict[tuple[str, str], float] = {}  # by process and its start
        self._ours: dict[tuple[str, str], bool] = {}
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self.environment = {**os.environ, _MARK: self._mark.partition("=")[2]}

    def __enter__(self) -> Meter:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    @property
    def seconds(self) -> float:
        """User and system time of all processes."""
        return sum(self._spent.values())

    def _watch(self) -> None:
        while not self._end.wait(EVERY):
            for process in sorted(Path("/proc").glob("[0-9]*")):
                with suppress(OSError):  # it has just ended
                    self._look(process)

    def _look(self, process: Path) -> None:
        fields = (process / "stat").read_text().rpartition(")")[2].split()
        key = process.name, fields[19]
        if not self._ours.get(key):  # a process has its parent's environment until it begins its own program
            self._ours[key] = self._mark.encode() in (process / "environ").read_bytes().split(b"\0")
        if self._ours[key]:
            self._spent[key] = (int(fields[11]) + int(fields[12])) / _TICK
