"""Worker processes on this host, each pinned to one thread. They end when the build ends.

Each worker is a fresh interpreter with its own pipe. It starts with interrupts blocked and ignores them afterwards: the
build handles interrupts and stops all workers at once. It also watches a pipe that only the build holds open, so that
no worker outlives the build, however the build ended.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, TypeAlias

from recipe_compiler.ir.errors import InputError, RecipeError, RunError

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.worker import Job, Worker
from recipe_runtime.core import subprocesses
from recipe_runtime.dataset.schedule import Shard

PINNED: dict[str, str] = {
    "PYTHONHASHSEED": "0",
    "LC_ALL": "C.UTF-8",
    "TZ": "UTC",
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"),
}

Done = Callable[[Shard, list[FrameRecord]], None]
Seconds = dict[str, float]
End: TypeAlias = "Connection[Any, Any]"


def run(job: Job, shards: Sequence[Shard], workers: int, done: Done, tick: Callable[[int], None]) -> Seconds:
    """Render all shards with worker processes.

    Args:
        job: what the workers have in common.
        shards: what to render.
        workers: number of processes; 0 renders in this process.
        done: called in this process with every finished shard and its records.
        tick: called in this process with a number of finished pictures.

    Returns:
        Seconds by stage, summed over the workers.

    Raises:
        InputError: files of the plan exceed a limit. The other workers are stopped.
        RunError: a frame failed; the message names it and its variant. The other workers are stopped.
    """
    if workers == 0:
        subprocesses.collect_as_usual()
        worker = Worker(job)
        for shard in shards:
            done(shard, worker.do(shard, tick))
        return worker.timings.seconds
    if not shards:
        return {}
    with WorkerPool(job, min(workers, len(shards))) as pool:
        return pool.run(shards, done, tick)


class _WorkerError(Exception):
    """A worker's traceback, as the cause of the error that reports it."""


class WorkerPool:
    """Worker processes for one job, until the `with` block ends. They start at once, in parallel with the caller.

    Args:
        job: what the workers have in common.
        workers: number of processes.
        load: number of a view whose scene every worker loads before its first shard.
    """

    def __init__(self, job: Job, workers: int, load: int | None = None) -> None:
        self._job = job
        self._processes: dict[End, subprocess.Popen[bytes]] = {}
        self._busy: dict[End, Shard] = {}
        self._seconds: Seconds = {}
        watched, self._alive = os.pipe()
        try:
            with _interrupts_blocked():
                for _ in range(workers):
                    self._start(watched)
            for number, pipe in enumerate(self._processes):
                with _reported_as_loss(self, pipe):
                    pipe.send((job, number, load))
        except BaseException:
            self._stop()
            raise
        finally:
            os.close(watched)

    def _start(self, watched: int) -> None:
        ours, theirs = Pipe()
        with theirs:
            ends = theirs.fileno(), watched
            command = subprocesses.command("recipe_runtime.build.local", "serve", *map(str, ends))
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=ends, env={**os.environ, **PINNED})
        self._processes[ours] = process

    def __enter__(self) -> WorkerPool:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def run(self, shards: Iterable[Shard], done: Done, tick: Callable[[int], None]) -> Seconds:
        """Render all shards, as the module's `run` does."""
        rest = iter(shards)
        for pipe in self._processes:
            self._feed(pipe, rest)
        while self._busy:
            ready = wait(list(self._busy))
            for pipe in [pipe for pipe in self._busy if pipe in ready]:
                self._receive(pipe, rest, done, tick)
        return self._seconds

    def _feed(self, pipe: End, rest: Iterator[Shard]) -> None:
        self._busy.pop(pipe, None)
        shard = next(rest, None)
        if shard is not None:
            self._busy[pipe] = shard
            with _reported_as_loss(self, pipe):
                pipe.send(shard)

    def _receive(self, pipe: End, rest: Iterator[Shard], done: Done, tick: Callable[[int], None]) -> None:
        with _reported_as_loss(self, pipe):
            kind, body = pipe.recv()
        if kind == "tick":
            tick(body)
        elif kind == "failed":
            kind_of_error, problems, details = body
            raise kind_of_error(problems) from _WorkerError(details)
        else:
            records, seconds = body
            for stage, value in seconds.items():
                self._seconds[stage] = self._seconds.get(stage, 0.0) + value
            done(self._busy[pipe], records)
            self._feed(pipe, rest)

    def lost(self, pipe: End) -> RunError:
        """Return the error for a worker that ended early; it names the shard that the worker was rendering."""
        process, shard = self._processes[pipe], self._busy.get(pipe)
        with suppress(subprocess.TimeoutExpired):
            process.wait(5)
        what = f"a worker process was lost (exit {process.returncode}; -9 is often memory running out)"
        remedy = f"with fewer workers, {self._job.again}"
        if shard is None:
            return RunError(f"{what}; {remedy}")
        names = ", ".join(self._job.dataset.variants[i].variant for i in shard.variants[:3])
        return RunError(f"{names}, frames {shard.frames[0]} to {shard.frames[-1]}: {what}; {remedy}")

    def _stop(self) -> None:
        for process in self._processes.values():
            process.kill()
        for pipe, process in self._processes.items():
            process.wait()
            pipe.close()
        os.close(self._alive)


@contextmanager
def _reported_as_loss(pool: WorkerPool, pipe: End) -> Iterator[None]:
    """Report an error of the pipe as the loss of its worker."""
    try:
        yield
    except (EOFError, OSError):
        raise pool.lost(pipe) from None


def serve() -> None:
    """Run a worker: receive the job and a number, then shards until the pipe closes. Arguments: two file numbers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    work, watched = map(int, sys.argv[1:])
    threading.Thread(target=_end_with_parent, args=(watched,), daemon=True).start()
    pipe: End = Connection(work)
    try:
        job, number, load = pipe.recv()
        worker = Worker(job, number)
        if load is not None:
            with suppress(Exception):  # reported when a shard of that scene is rendered
                worker.load(load)
        subprocesses.collect_as_usual()
        while True:
            pipe.send(_answer(worker, pipe.recv(), lambda count: pipe.send(("tick", count))))
            worker.timings.seconds.clear()
    except (EOFError, ConnectionError):
        return


def _answer(worker: Worker, shard: Shard, tick: Callable[[int], None]) -> tuple[str, Any]:
    try:
        return "done", (worker.do(shard, tick), dict(worker.timings.seconds))
    except (EOFError, ConnectionError):
        raise
    except RecipeError as error:
        kind = InputError if isinstance(error, InputError) else RunError
        return "failed", (kind, error.problems, traceback.format_exc())


def _end_with_parent(watched: int) -> None:
    os.read(watched, 1)  # returns when the only writer, the build, has ended
    os._exit(1)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block SIGINT, so that child processes inherit the mask; an interrupt is delivered to this process afterwards."""
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
