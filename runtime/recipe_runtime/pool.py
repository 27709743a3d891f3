"""Worker processes on this host: spawned, pinned to one thread each, and gone when the build is.

Each has a pipe of its own. A worker leaves interrupts to the build, which ends all workers at once; and it watches
the build's process, so that none outlives it, whatever ended it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from typing import Any, TypeAlias

from recipe_compiler.errors import RecipeError, RunError

from recipe_runtime.schedule import Shard
from recipe_runtime.worker import FrameRecord, Job, Worker

_PINNED = {
    "PYTHONHASHSEED": "0",
    "LC_ALL": "C.UTF-8",
    "TZ": "UTC",
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"),
}

Done = Callable[[Shard, list[FrameRecord]], None]
Seconds = dict[str, float]
Pipe: TypeAlias = "Connection[Any, Any]"


def run(job: Job, shards: Sequence[Shard], workers: int, done: Done, tick: Callable[[int], None]) -> Seconds:
    """Do all shards with so many processes (0: in this one); the seconds of every stage, over all workers.

    `done` is told of every finished shard and `tick` of pictures, both in this process. RunError, with the frame and
    its variant, if one fails; the others are stopped then.
    """
    if workers == 0:
        worker = Worker(job)
        for shard in shards:
            done(shard, worker.do(shard, tick))
        return worker.watch.seconds
    if not shards:
        return {}
    return _Pool(job, min(workers, len(shards))).run(shards, done, tick)


class _WorkerError(Exception):
    """A worker's own traceback, as the cause of the error that it is reported by."""


class _Pool:
    def __init__(self, job: Job, workers: int) -> None:
        self._dataset = job.dataset
        self._processes: dict[Pipe, BaseProcess] = {}
        self._busy: dict[Pipe, Shard] = {}
        self._seconds: Seconds = {}
        context = multiprocessing.get_context("spawn")
        try:
            with _pinned_environment():
                for _ in range(workers):
                    ours, theirs = context.Pipe()
                    process = context.Process(target=_serve, args=(theirs,), daemon=True)
                    process.start()
                    theirs.close()
                    self._processes[ours] = process
            blob = bytes(ForkingPickler.dumps(job))
            for pipe in self._processes:
                pipe.send_bytes(blob)
        except BaseException:
            self._stop()
            raise

    def run(self, shards: Iterable[Shard], done: Done, tick: Callable[[int], None]) -> Seconds:
        rest = iter(shards)
        try:
            for pipe in self._processes:
                self._feed(pipe, rest)
            while self._busy:
                ready = wait(list(self._busy))
                for pipe in [pipe for pipe in self._busy if pipe in ready]:
                    self._hear(pipe, rest, done, tick)
        finally:
            self._stop()
        return self._seconds

    def _feed(self, pipe: Pipe, rest: Iterator[Shard]) -> None:
        self._busy.pop(pipe, None)
        shard = next(rest, None)
        if shard is not None:
            pipe.send(shard)
            self._busy[pipe] = shard

    def _hear(self, pipe: Pipe, rest: Iterator[Shard], done: Done, tick: Callable[[int], None]) -> None:
        try:
            kind, body = pipe.recv()
        except (EOFError, ConnectionError):
            raise self._lost(pipe) from None
        if kind == "tick":
            tick(body)
        elif kind == "failed":
            message, details = body
            raise RunError(message) from _WorkerError(details)
        else:
            records, seconds = body
            for stage, value in seconds.items():
                self._seconds[stage] = self._seconds.get(stage, 0.0) + value
            done(self._busy[pipe], records)
            self._feed(pipe, rest)

    def _lost(self, pipe: Pipe) -> RunError:
        shard, process = self._busy[pipe], self._processes[pipe]
        process.join(5)
        names = ", ".join(self._dataset.variants[i].variant for i in shard.variants[:3])
        where = f"{names}, frames {shard.frames[0]} to {shard.frames[-1]}"
        return RunError(
            f"{where}: a worker process was lost (exit {process.exitcode}; -9 is often memory running out); "
            "build again with fewer workers: what is done is kept"
        )

    def _stop(self) -> None:
        for process in self._processes.values():
            process.kill()
        for pipe, process in self._processes.items():
            process.join()
            pipe.close()


def _serve(pipe: Pipe) -> None:
    """A worker's life: take the job, then shards until the pipe closes."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        worker = Worker(ForkingPickler.loads(pipe.recv_bytes()))
        while True:
            pipe.send(_answer(worker, pipe.recv(), lambda count: pipe.send(("tick", count))))
            worker.watch.seconds.clear()
    except (EOFError, ConnectionError):
        return


def _answer(worker: Worker, shard: Shard, tick: Callable[[int], None]) -> tuple[str, Any]:
    try:
        return "done", (worker.do(shard, tick), dict(worker.watch.seconds))
    except (EOFError, ConnectionError):
        raise
    except RecipeError as error:
        return "failed", (str(error), traceback.format_exc())


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


@contextmanager
def _pinned_environment() -> Iterator[None]:
    """What a spawned process inherits is the environment and the signal mask of now: interrupts stay with us."""
    before = {name: os.environ.get(name) for name in _PINNED}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.environ.update(_PINNED)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value
