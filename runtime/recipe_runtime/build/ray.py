"""Renders shards on a Ray cluster. This process distributes the shards and writes the returned files. Requires `ray`.

A node needs nothing but this package: Traces and the recipe's files are sent with the job, and finished files are
returned as bytes, so no shared folder is needed. If a worker or its node is lost, another worker renders the shard
again; the bytes do not depend on the worker.
"""

from __future__ import annotations

import logging
import socket
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, TypeAlias

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.local import PINNED, Done, Seconds
from recipe_runtime.build.resume import Runner
from recipe_runtime.build.worker import Job, Worker
from recipe_runtime.cache.store import Store
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.files import host_errors, link_or_copy, write_atomic
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import renderer_identity
from recipe_runtime.dataset.schedule import Shard, simulations
from recipe_runtime.frames.engines import real_engines

QUEUED = 2  # shards assigned to a worker at once, so that it never waits for the next
RETRIES = 3  # how often a shard is rendered again after its worker was lost
TIMEOUT = 5.0  # seconds to wait for the cluster to answer, and for workers to end; Ray itself would wait for minutes
MAX_WAIT_FOR_NODES = 60  # seconds without any usable node after which the build fails
_OTHER_RELEASE = "a node of the cluster runs another release of this package, or of a tool that bytes depend on"


Remote: TypeAlias = Any  # Ray's handle of a `RemoteWorker`, or its reference to a result


@dataclass(frozen=True)
class ShardResult:
    """The result of a shard from a worker.

    It holds the records, the bytes of each distinct file, and the seconds by stage.
    """

    records: list[FrameRecord]
    bodies: dict[str, bytes]  # by SHA-256
    seconds: Seconds


@dataclass(frozen=True)
class JobInputs:
    """The inputs of a node besides the job, by digest: Traces of the scenes, and files of the recipe."""

    traces: dict[str, bytes]
    assets: dict[str, bytes]

    @classmethod
    def of(cls, job: Job) -> JobInputs:
        """Return the inputs of all of a job's frames."""
        store, scenes = Store(job.cache), simulations(job.dataset)
        traces = {s.digest: store.trace(s, partial(job.engines.simulate, s)).to_bytes() for s in scenes}
        files = {sha256: file for variant in job.dataset.variants for sha256, file in variant.files.items()}
        return cls(traces, {sha256: job.engines.assets.content(file) for sha256, file in sorted(files.items())})

    def unpack(self, job: Job, root: Path) -> Job:
        """Write the inputs below `root`, and return the job with the node's own folders."""
        store, places = Store(root / "cache"), {}
        for scene in simulations(job.dataset):
            store.keep_trace(scene, Trace.from_bytes(self.traces[scene.digest]))
        for sha256, content in self.assets.items():
            places[sha256] = root / "assets" / sha256
            write_atomic(places[sha256], content)
        engines = real_engines(Assets(places)) if places else job.engines  # only the real ones use such files
        return replace(job, cache=store.root, engines=engines, root=root / "made" if job.root is not None else None)


class RemoteWorker:
    """A worker on a node: renders into a temporary folder and returns the files.

    Args:
        job: what the workers have in common.
        number: the worker's number, which selects its device.
        inputs: the Traces and files of the job.
        expected: digest of the renderer's code that this node must have.

    Raises:
        RunError: the node has other code.
    """

    def __init__(self, job: Job, number: int, inputs: JobInputs, expected: str) -> None:
        if renderer_identity() != expected:
            raise RunError(_OTHER_RELEASE)
        self._folder = tempfile.TemporaryDirectory(prefix="recipe-node-")
        self._root = Path(self._folder.name)
        self._worker = Worker(inputs.unpack(job, self._root), number)

    def do(self, shard: Shard) -> ShardResult:
        """Render a shard."""
        records = self._worker.do(shard, lambda count: None)
        bodies: dict[str, bytes] = {}
        for record in records:
            for path, (_, sha256) in record["files"].items():
                place = self._root / "made" / path
                if sha256 not in bodies:
                    bodies[sha256] = place.read_bytes()
                place.unlink()
        seconds = dict(self._worker.timings.seconds)
        self._worker.timings.seconds.clear()
        return ShardResult(records, bodies, seconds)

    def leave(self) -> None:
        """Remove this worker's files from the node."""
        self._folder.cleanup()


@contextmanager
def joined(address: str | None) -> Iterator[Runner]:
    """Join a Ray cluster; yields a runner with the signature of `local.run`, which raises RunError if a shard fails.

    Args:
        address: the cluster's address; None starts a cluster on this host.

    Raises:
        InputError: `ray` is not installed, or there is no cluster.
    """
    try:
        import ray
    except ImportError:
        raise InputError(
            "Ray is not installed", help="install it: pip install 'ray>=2.40'", code=Code.MISSING_LIBRARY
        ) from None
    _start(ray, address)
    try:
        yield lambda job, shards, workers, done, tick: _run(ray, job, shards, workers, done, tick)
    finally:
        ray.shutdown()


def _start(ray: ModuleType, address: str | None) -> None:
    quiet: dict[str, object] = {"logging_level": logging.ERROR, "log_to_driver": False, "configure_logging": False}
    logging.getLogger("ray").setLevel(logging.ERROR)
    try:
        if address is None:
            ray.init(address="local", include_dashboard=False, **quiet)
        else:
            _check_address(address)
            ray.init(address=address, **quiet)
    except (ConnectionError, ValueError, RuntimeError, OSError, SystemExit) as error:
        if isinstance(error, SystemExit):  # Ray raises it when something else than Ray answers
            error = ConnectionError("what listens there does not answer as Ray does")
        reason = (isinstance(error, OSError) and error.strerror) or _line(error)
        what = "Ray cannot be started here" if address is None else f"there is no Ray cluster to join at {address}"
        raise InputError(f"{what}: {reason}") from None


def _check_address(address: str) -> None:
    """Connect to HOST:PORT once, since Ray itself waits for minutes if nothing answers; other forms are left to Ray.

    Raises:
        ValueError: the port is not a number.
        OSError: nothing answers within `TIMEOUT` seconds.
    """
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and not port.isdigit():
        raise ValueError(f"{port!r} is not a port; write HOST:PORT")
    if colon:
        socket.create_connection((host.strip("[]"), int(port)), timeout=TIMEOUT).close()


def _run(
    ray: ModuleType, job: Job, shards: Sequence[Shard], workers: int, done: Done, tick: Callable[[int], None]
) -> Seconds:
    if job.devices not in (("cpu",), ("cuda",)):
        raise InputError(f"device {job.devices[0]}: on a cluster, every worker has a GPU of its own; say cuda")
    if not shards:
        return {}
    pool = _RemotePool(ray, job, workers, shards)
    seconds = Seconds()
    try:
        for shard, result in pool.results():
            _write_files(job.root, result)
            for stage, value in result.seconds.items():
                seconds[stage] = seconds.get(stage, 0.0) + value
            done(shard, result.records)
            tick(len(shard.frames) * len(shard.variants))
    finally:
        pool.close()
    return seconds


class _RemotePool:
    """The workers of one build, each with its own processor or GPU, and the shards assigned to each."""

    def __init__(self, ray: ModuleType, job: Job, workers: int, shards: Sequence[Shard]) -> None:
        self._ray, self._job = ray, job
        self._kind = "CPU" if job.devices == ("cpu",) else "GPU"
        on_gpu, capacity = self._kind == "GPU", int(ray.cluster_resources().get(self._kind, 0))
        if capacity < 1:
            raise InputError(f"the Ray cluster has no {self._kind} for a worker")
        self._count = min(workers or capacity, len(shards))
        self._job_ref = ray.put(replace(job, devices=("cuda:0",)) if on_gpu else job)  # a worker sees only its own GPU
        self._inputs_ref = ray.put(JobInputs.of(job))
        needs = {"num_gpus": 1, "num_cpus": 0} if on_gpu else {"num_cpus": 1}
        self._remote = ray.remote(**needs)(RemoteWorker).options(runtime_env={"env_vars": PINNED})
        self._workers: list[Remote] = []
        self._pending: dict[Remote, tuple[Remote, Shard]] = {}
        self._rest = deque(shards)
        self._losses: dict[Shard, int] = {}
        self._waited = 0  # seconds without a node

    def results(self) -> Iterator[tuple[Shard, ShardResult]]:
        """Yield every shard with its result, in the order in which they finish.

        Raises:
            RunError: a shard failed, or the cluster has had no node for `MAX_WAIT_FOR_NODES` seconds.
        """
        while self._rest or self._pending:
            self._assign()
            ready, _ = self._ray.wait(list(self._pending), num_returns=1, timeout=1.0)
            self._waited = 0 if ready or self._ray.cluster_resources().get(self._kind) else self._waited + 1
            if self._waited > MAX_WAIT_FOR_NODES:
                what = f"the Ray cluster has had no {self._kind} for {MAX_WAIT_FOR_NODES} seconds"
                raise RunError(f"{what}; {self._job.again}")
            for reference in ready:
                worker, shard = self._pending.pop(reference)
                result = self._result(reference, worker, shard)
                if result is not None:
                    yield shard, result

    def close(self) -> None:
        """End all workers, after at most `TIMEOUT` seconds in which they remove their files."""
        if self._workers:
            leaving = [worker.leave.remote() for worker in self._workers]
            self._ray.wait(leaving, num_returns=len(leaving), timeout=TIMEOUT)
        for worker in self._workers:
            self._ray.kill(worker)

    def _assign(self) -> None:
        """Start workers while the cluster has room, and queue shards for each."""
        wanted = self._count - len(self._workers) if self._rest else 0
        free = int(self._ray.available_resources().get(self._kind, 0)) if wanted else 0
        for _ in range(min(wanted, max(free, not self._workers))):
            number = len(self._workers)
            self._workers.append(self._remote.remote(self._job_ref, number, self._inputs_ref, renderer_identity()))
        for worker in self._workers:
            while self._rest and sum(other is worker for other, _ in self._pending.values()) < QUEUED:
                shard = self._rest.popleft()
                self._pending[worker.do.remote(shard)] = worker, shard

    def _result(self, reference: Remote, worker: Remote, shard: Shard) -> ShardResult | None:
        """Return a shard's result; None if its worker was lost and the shard was queued again."""
        errors = self._ray.exceptions
        try:
            result: ShardResult = self._ray.get(reference)
            return result
        except errors.RayTaskError as error:
            kind = InputError if isinstance(error.cause, InputError) else RunError
            raise kind(_line(error.cause)) from error
        except errors.RayError as error:  # the worker was lost, or the node that held its result
            self._workers = [other for other in self._workers if other is not worker]
            self._losses[shard] = self._losses.get(shard, 0) + 1
            said = next((line for line in str(error).splitlines() if _OTHER_RELEASE in line), None)
            if said is not None:
                raise RunError(f"{_OTHER_RELEASE}; install the same on all") from error
            if self._losses[shard] > RETRIES:
                again = f"{self._losses[shard]} workers were lost over it; {self._job.again}"
                raise RunError(f"{_place(self._job, shard)}: {again} (Ray says: {_line(error)})") from error
            self._rest.appendleft(shard)
            return None


def _write_files(root: Path | None, result: ShardResult) -> None:
    """Write a result's files: each content once, then links for its other names."""
    if root is None:
        return
    first: dict[str, Path] = {}
    for record in result.records:
        for path, (_, sha256) in record["files"].items():
            place = root / path
            with host_errors(str(place), "free some space or allow writing, then build again: what is done is kept"):
                if sha256 in first:
                    link_or_copy(first[sha256], place)
                else:
                    write_atomic(place, result.bodies[sha256])
                    first[sha256] = place


def _place(job: Job, shard: Shard) -> str:
    variant = job.dataset.variants[shard.variants[0]].variant
    return f"{variant}, frames {shard.frames[0]} to {shard.frames[-1]}"


def _line(error: object) -> str:
    """Return the last line of an error's text that is not empty."""
    lines = [line for line in str(error).splitlines() if line.strip()]
    return lines[-1].strip() if lines else type(error).__name__
