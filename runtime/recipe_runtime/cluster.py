"""The same shards on a Ray cluster: this process shares them out, and puts what comes back into place. Needs `ray`.

A node needs this package and nothing else: motion travels with the job, and files come back as bytes, so there is no
folder to share. What a worker was at when it was lost, with its node or alone, another does again; the bytes do not
depend on who does it.
"""

from __future__ import annotations

import logging
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from recipe_compiler.errors import InputError, RunError

from recipe_runtime.build import Runner
from recipe_runtime.pool import PINNED, Done, Seconds
from recipe_runtime.schedule import Shard, simulations
from recipe_runtime.store import Store, host_errors, link_or_copy, write_atomic
from recipe_runtime.trace import Trace
from recipe_runtime.versions import renderer
from recipe_runtime.worker import FrameRecord, Job, Worker

QUEUED = 2  # shards that a worker has at once, so that it never waits for the next
RETRIES = 3  # times that a shard is done again after its worker was lost
_OTHER_RELEASE = "a node of the cluster runs another release of this package, or of a tool that bytes depend on"


@dataclass(frozen=True)
class Parcel:
    """What a worker sends home: the records of a shard, each file's bytes once, and its seconds by stage."""

    records: list[FrameRecord]
    bodies: dict[str, bytes]  # by SHA-256
    seconds: Seconds


class Hand:
    """A worker on a node: it renders into a folder of its own and sends what it made."""

    def __init__(self, job: Job, number: int, traces: dict[str, bytes], expected: str) -> None:
        if renderer() != expected:
            raise RunError(
                "a node of the cluster runs another release of this package, or of a tool that bytes depend on"
            )
        self._folder = tempfile.TemporaryDirectory(prefix="recipe-node-")
        self._root = Path(self._folder.name)
        cache = self._root / "cache"
        for scene in simulations(job.dataset):
            Store(cache).keep_trace(scene, Trace.from_bytes(traces[scene.digest]))
        root = self._root / "made" if job.root is not None else None
        self._worker = Worker(replace(job, cache=cache, root=root), number)

    def do(self, shard: Shard) -> Parcel:
        """Make a shard's frames."""
        records = self._worker.do(shard, lambda count: None)
        bodies: dict[str, bytes] = {}
        for record in records:
            for path, (_, sha256) in record["files"].items():
                place = self._root / "made" / path
                if sha256 not in bodies:
                    bodies[sha256] = place.read_bytes()
                place.unlink()
        seconds = dict(self._worker.watch.seconds)
        self._worker.watch.seconds.clear()
        return Parcel(records, bodies, seconds)


@contextmanager
def joined(address: str | None) -> Iterator[Runner]:
    """A runner, as `pool.run` is one, over a Ray cluster: the one at that address, or one of this host's own.

    InputError if `ray` is not installed or there is no cluster; RunError from the runner if a shard fails.
    """
    try:
        import ray
    except ImportError:
        raise InputError("--ray needs Ray: pip install 'dataset-recipe[ray]'") from None
    quiet: dict[str, Any] = {"logging_level": logging.ERROR, "log_to_driver": False, "configure_logging": False}
    try:
        if address is None:
            ray.init(include_dashboard=False, **quiet)
        else:
            ray.init(address=address, **quiet)
    except (ConnectionError, ValueError, RuntimeError, OSError) as error:
        raise InputError(f"--ray {address or ''}: there is no Ray cluster to join: {_line(error)}") from None
    try:
        yield lambda job, shards, workers, done, tick: _run(ray, job, shards, workers, done, tick)
    finally:
        ray.shutdown()


def _run(ray: Any, job: Job, shards: Sequence[Shard], workers: int, done: Done, tick: Callable[[int], None]) -> Seconds:
    if not shards:
        return {}
    crew = _Crew(ray, job, min(workers or _room(ray, job), len(shards)))
    seconds = Seconds()
    try:
        for shard, parcel in crew.results(shards):
            _put(job.root, parcel)
            for stage, value in parcel.seconds.items():
                seconds[stage] = seconds.get(stage, 0.0) + value
            done(shard, parcel.records)
            tick(len(shard.frames) * len(shard.variants))
    finally:
        crew.dismiss()
    return seconds


class _Crew:
    """The workers of one build, each with a processor or a GPU of its own, and what each is at."""

    def __init__(self, ray: Any, job: Job, count: int) -> None:
        self._ray, self._job, self._count = ray, job, count
        self._kind = "CPU" if job.devices == ("cpu",) else "GPU"
        store = Store(job.cache)
        scenes = simulations(job.dataset)
        traces = {s.digest: store.trace(s, partial(job.engines.simulate, s)).to_bytes() for s in scenes}
        on_gpu = self._kind == "GPU"
        self._told = ray.put(replace(job, devices=("cuda:0",)) if on_gpu else job)  # Ray shows it its own GPU alone
        self._motion = ray.put(traces)
        needs = {"num_gpus": 1, "num_cpus": 0} if on_gpu else {"num_cpus": 1}
        self._remote = ray.remote(**needs)(Hand).options(runtime_env={"env_vars": PINNED})
        self._hands: list[Any] = []
        self._pending: dict[Any, tuple[Any, Shard]] = {}
        self._rest: deque[Shard] = deque()
        self._losses: dict[Shard, int] = {}

    def results(self, shards: Sequence[Shard]) -> Iterator[tuple[Shard, Parcel]]:
        """Every shard with what was made of it, in whatever order; RunError if one cannot be made."""
        self._rest.extend(shards)
        while self._rest or self._pending:
            self._engage()
            ready, _ = self._ray.wait(list(self._pending), num_returns=1, timeout=1.0)
            for reference in ready:
                hand, shard = self._pending.pop(reference)
                parcel = self._opened(reference, hand, shard)
                if parcel is not None:
                    yield shard, parcel

    def dismiss(self) -> None:
        """End all workers."""
        for hand in self._hands:
            self._ray.kill(hand)

    def _engage(self) -> None:
        """Hire where there is room, and give each worker something to do next."""
        free = int(self._ray.available_resources().get(self._kind, 0)) if self._idle() else 0
        for _ in range(min(self._count - len(self._hands), max(free, not self._hands))):
            self._hands.append(self._remote.remote(self._told, len(self._hands), self._motion, renderer()))
        for hand in self._hands:
            while self._rest and sum(h is hand for h, _ in self._pending.values()) < QUEUED:
                shard = self._rest.popleft()
                self._pending[hand.do.remote(shard)] = hand, shard

    def _idle(self) -> bool:
        return bool(self._rest) and len(self._hands) < self._count

    def _opened(self, reference: Any, hand: Any, shard: Shard) -> Parcel | None:
        """A parcel; None if its worker was lost: then the shard waits for another."""
        errors = self._ray.exceptions
        try:
            parcel: Parcel = self._ray.get(reference)
            return parcel
        except errors.RayTaskError as error:
            raise RunError(_line(error.cause)) from error
        except errors.RayActorError as error:
            self._hands = [other for other in self._hands if other is not hand]
            self._losses[shard] = self._losses.get(shard, 0) + 1
            said = next((line for line in str(error).splitlines() if _OTHER_RELEASE in line), None)
            if said is not None:
                raise RunError(f"{_OTHER_RELEASE}; install the same on all") from error
            if self._losses[shard] > RETRIES:
                again = f"{self._losses[shard]} workers were lost over it; {self._job.again}"
                raise RunError(f"{_place(self._job, shard)}: {again}") from error
            self._rest.appendleft(shard)
            return None


def _room(ray: Any, job: Job) -> int:
    kind = "CPU" if job.devices == ("cpu",) else "GPU"
    room = int(ray.cluster_resources().get(kind, 0))
    if room < 1:
        raise InputError(f"the Ray cluster has no {kind} for a worker")
    return room


def _put(root: Path | None, parcel: Parcel) -> None:
    """Write a parcel's files, each content once, under all its names."""
    if root is None:
        return
    first: dict[str, Path] = {}
    for record in parcel.records:
        for path, (_, sha256) in record["files"].items():
            place = root / path
            with host_errors(str(place), "free some space or allow writing, then build again: what is done is kept"):
                if sha256 in first:
                    link_or_copy(first[sha256], place)
                else:
                    write_atomic(place, parcel.bodies[sha256])
                    first[sha256] = place


def _place(job: Job, shard: Shard) -> str:
    variant = job.dataset.variants[shard.variants[0]].variant
    return f"{variant}, frames {shard.frames[0]} to {shard.frames[-1]}"


def _line(error: Any) -> str:
    lines = [line for line in str(error).splitlines() if line.strip()]
    return lines[-1].strip() if lines else type(error).__name__
