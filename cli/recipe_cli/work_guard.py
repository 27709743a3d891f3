"""Stops a command whose real work far exceeds the estimate of it, which `compile_quietly` has compared with the limits.

The estimate comes from a plan that may be a stranger's, and no estimate covers every mesh, image and route. A thread
therefore measures the processor time and the memory of this process and all of its child processes. If they exceed the
estimate several times, it interrupts the main thread as Ctrl-C does, so that every cleanup is the same. What a build
writes is counted by the build itself.
"""

from __future__ import annotations

import os
import resource
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from recipe_compiler.ir.plurals import count

if TYPE_CHECKING:
    from recipe_compiler.ir.plan import DatasetPlan
    from recipe_compiler.limits import Cost

TIMES, SECONDS = 4, 120.0  # of processor time: times the estimate, and added to it, for slow processors and kernels
MEMORY_TIMES, MEMORY_BYTES = 2, 1 << 30  # the same of memory
DISK_TIMES, DISK_BYTES = 2, 1 << 30  # the same of a dataset's files
_REMEDY = "if that is expected, run the command again with --allow-large"
_PAUSE = 0.25  # seconds between two measurements
_AGAIN = 60.0  # seconds after which an interrupt is repeated that ended nothing: code in between may have caught it
_TICKS = os.sysconf("SC_CLK_TCK")


def dataset_cost(plan: DatasetPlan, work: str, remedy: str, *, allow_large: bool = False) -> Cost:
    """Return the most that the plan of a dataset, which is untrusted, may cost to build.

    Args:
        plan: the plan.
        work: the beginning of the message: `NAME: to render its plan`.
        remedy: the remedy of the message.
        allow_large: check nothing.

    Raises:
        InputError: it exceeds the limits, and `allow_large` is not set.
    """
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_compiler.lowering.workload import plan_cost

    reasons = [] if allow_large else plan_cost(plan).over()
    if reasons:
        raise InputError(f"{work}, {', and '.join(reasons)}", help=remedy, code=Code.SIZE_LIMIT)
    return plan_cost(plan, largest_files=True)


@contextmanager
def within_estimate(
    work: str, cost: Cost, *, workers: int | None, device: str = "cpu", allow_large: bool = False
) -> Iterator[None]:
    """Stop the block when it has taken far more than its estimate. It must run in the main thread.

    Args:
        work: what the block does, for the message: `the build`.
        cost: the estimate, of one worker's time; each further worker adds its start and the scenes that it loads.
        workers: number of worker processes; None for those of a cluster, whose memory is not measured.
        device: where frames are rendered. Memory is measured on `cpu` only: drivers of GPUs take some of their own.
        allow_large: measure nothing.

    Raises:
        InputError: the block took more than `TIMES` its estimate and `SECONDS` of processor time, or more than
            `MEMORY_TIMES` its estimate and `MEMORY_BYTES` of memory.
    """
    if allow_large:
        yield
        return
    memory = None if workers is None or device != "cpu" else cost.memory_with(max(workers, 1))
    minutes = cost.minutes + cost.minutes_of_further_workers(workers or os.cpu_count() or 1)
    guard = _Guard(work, minutes * 60, memory)
    try:
        with guard.watching():
            yield
    except BaseException:  # libraries may replace the interrupt by an error of their own
        if guard.excess is None:
            raise
        from recipe_compiler.ir.errors import Code, InputError

        raise InputError(guard.excess, help=_REMEDY, code=Code.SIZE_LIMIT) from None


def disk_bound(work: str, estimate: int, *, allow_large: bool = False) -> Callable[[int], None] | None:
    """Return a function that adds up bytes which the work writes; None if they are not bounded.

    It raises InputError when they are more than `DISK_TIMES` the estimate and `DISK_BYTES`.
    """
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_compiler.limits import size

    total = 0

    def written(amount: int) -> None:
        nonlocal total
        total += amount
        if total > DISK_TIMES * estimate + DISK_BYTES:
            what = f"{work} was stopped: it writes {size(total)}, far more than the estimate of {size(estimate)}"
            raise InputError(what, help=_REMEDY, code=Code.SIZE_LIMIT)

    return None if allow_large else written


class _Guard:
    """Measures from a thread what a block takes, and interrupts the block."""

    def __init__(self, work: str, seconds: float, memory: int | None) -> None:
        self._work, self._seconds, self._memory = work, seconds, memory
        self._before = _processor_seconds(), _memory_bytes()
        self._ended = threading.Event()
        self.excess: str | None = None

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Measure during the block."""
        signal.signal(signal.SIGXCPU, self._interrupt)
        thread = threading.Thread(target=self._watch, daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._ended.set()  # from here on, the handler does nothing
            thread.join()

    def _watch(self) -> None:
        while not self._ended.wait(_PAUSE):
            with suppress(MemoryError):  # the bound of a document that is being read (`bounded_memory`)
                self.excess = self._found()
            if self.excess is not None:
                break
        while self.excess is not None and not self._ended.is_set():
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGXCPU)
            self._ended.wait(_AGAIN)

    def _interrupt(self, *_: object) -> None:
        if not self._ended.is_set():
            raise KeyboardInterrupt

    def _found(self) -> str | None:
        """Return in words by what the work exceeds its estimate; None within it."""
        seconds = _processor_seconds() - self._before[0]
        if seconds > TIMES * self._seconds + SECONDS:
            return self._message("it has taken", _time(seconds), "of processor time", _time(self._seconds))
        if self._memory is None:
            return None
        memory = _memory_bytes() - self._before[1]
        if memory <= MEMORY_TIMES * self._memory + MEMORY_BYTES:
            return None
        from recipe_compiler.limits import size

        return self._message("it takes", size(memory), "of memory", size(self._memory))

    def _message(self, verb: str, amount: str, of: str, estimate: str) -> str:
        return f"{self._work} was stopped: {verb} {amount} {of}, far more than the estimate of {estimate}"


def _time(seconds: float) -> str:
    return count(round(seconds), "second") if seconds < 120 else count(round(seconds / 60), "minute")


def _processor_seconds() -> float:
    """Return the processor time of this process and its descendants, running and ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]  # before the others:
    total = sum(each.ru_utime + each.ru_stime for each in used)  # a child that ends now is missed, not counted twice
    return total + sum(_of_descendants(_seconds_of))


def _memory_bytes() -> float:
    """Return the memory of this process and its descendants that belongs to no file."""
    return _bytes_of(Path("/proc/self")) + sum(_of_descendants(_bytes_of))


def _of_descendants(read: Callable[[Path], float]) -> Iterator[float]:
    """Yield what `read` returns for the folder in /proc of each descendant that runs."""
    waiting = [Path("/proc/self")]
    while waiting:
        process = waiting.pop()
        with suppress(OSError):  # the process has ended
            for task in sorted((process / "task").iterdir()):
                with suppress(OSError):  # the thread has ended
                    children = (task / "children").read_text()
                    waiting += [Path("/proc", number) for number in children.split()]
        if process.name != "self":
            with suppress(OSError):
                yield read(process)


def _seconds_of(process: Path) -> float:
    """Return the processor time of a process and of its children that ended."""
    fields = (process / "stat").read_bytes().rpartition(b")")[2].split()  # a name may be any bytes
    return sum(map(int, fields[11:15])) / _TICKS  # utime, stime, cutime, cstime of proc(5)


def _bytes_of(process: Path) -> float:
    for line in (process / "status").read_bytes().splitlines():
        if line.startswith(b"RssAnon:"):
            return int(line.split()[1]) * 1024
    return 0
