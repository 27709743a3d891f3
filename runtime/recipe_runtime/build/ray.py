"""The same shards on a Ray cluster: this process shares them out, and puts what comes back into place. Needs `ray`.

A node needs this package and nothing else: motion and the files that the recipe brings travel with the job, and what
is made comes back as bytes, so there is no folder to share. What a worker was at when it was lost, with its node or
alone, another does again; the bytes do not depend on who does it.
"""

from __future__ import annotations

import logging
import os
import socket
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.local import PINNED, Done, Seconds
from recipe_runtime.build.pipeline import Runner
from recipe_runtime.build.worker import Job, Worker
from recipe_runtime.cache.store import Store
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.files import host_errors, link_or_copy, stamp_of, write_atomic
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import renderer
from recipe_runtime.dataset.schedule import Shard, simulations
from recipe_runtime.frames.engines import real_engines

QUEUED = 2  # shards that a worker has at once, so that it never waits for the next
RETRIES = 3  # times that a shard is done again after its worker was lost
# Seconds for a cluster's door to open, for an answer, and for leaving; Ray itself would knock for minutes.
PATIENCE = 5.0
_GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])  # and no settings (RFC 9113, 3.4)
_FRAME_HEAD, _SETTINGS = 9, 4
_NO_RAY = "what listens there does not answer as Ray does"
FORLORN = 60  # seconds without a node that could do any work, after which none is expected
_OTHER_RELEASE = "a node of the cluster runs another release of this package, or of a tool that bytes depend on"


@dataclass(frozen=True)
class Parcel:
    """What a worker sends home: the records of a shard, each file's bytes once, and its seconds by stage."""

    records: list[FrameRecord]
    bodies: dict[str, bytes]  # by SHA-256
    seconds: Seconds


@dataclass(frozen=True)
class Luggage:
    """What a node needs besides the job: motion by scene, and the files that the recipe brings, both by digest."""

    traces: dict[str, bytes]
    assets: dict[str, bytes]

    @classmethod
    def of(cls, job: Job) -> Luggage:
        """All that a job's frames are made from."""
        store, scenes = Store(job.cache), simulations(job.dataset)
        traces = {s.digest: store.trace(s, partial(job.engines.simulate, s)).to_bytes() for s in scenes}
        files = {sha256: file for variant in job.dataset.variants for sha256, file in variant.files.items()}
        return cls(traces, {sha256: job.engines.assets.content(file) for sha256, file in sorted(files.items())})

    def unpack(self, job: Job, root: Path) -> Job:
        """The job as a node does it, within that folder."""
        store, places = Store(root / "cache"), {}
        for scene in simulations(job.dataset):
            store.keep_trace(scene, Trace.from_bytes(self.traces[scene.digest]))
        for sha256, content in self.assets.items():
            places[sha256] = root / "assets" / sha256
            write_atomic(places[sha256], content)
        engines = real_engines(Assets(places)) if places else job.engines  # only the real ones draw what is brought
        return replace(job, cache=store.root, engines=engines, root=root / "made" if job.root is not None else None)


class Hand:
    """A worker on a node: it renders into a folder of its own and sends what it made."""

    def __init__(self, job: Job, number: int, luggage: Luggage, expected: str) -> None:
        if renderer() != expected:
            raise RunError(_OTHER_RELEASE)
        self._folder = tempfile.TemporaryDirectory(prefix="recipe-node-")
        self._root = Path(self._folder.name)
        self._worker = Worker(luggage.unpack(job, self._root), number)

    def do(self, shard: Shard) -> Parcel:
        """Make a shard's frames."""
        records = self._worker.do(shard, lambda count: None)
        bodies: dict[str, bytes] = {}
        for record in records:
            for path, (_, sha256, *_) in record["files"].items():
                place = self._root / "made" / path
                if sha256 not in bodies:
                    bodies[sha256] = place.read_bytes()
                place.unlink()
        seconds = dict(self._worker.watch.seconds)
        self._worker.watch.seconds.clear()
        return Parcel(records, bodies, seconds)

    def leave(self) -> None:
        """Clear away what is on the node."""
        self._folder.cleanup()


@contextmanager
def joined(address: str | None) -> Iterator[Runner]:
    """A runner, as `pool.run` is one, over a Ray cluster: the one at that address, or one of this host's own.

    InputError if `ray` is not installed or there is no cluster; RunError from the runner if a shard fails.
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


def _start(ray: Any, address: str | None) -> None:
    quiet: dict[str, Any] = {"logging_level": logging.ERROR, "log_to_driver": False, "configure_logging": False}
    logging.getLogger("ray").setLevel(logging.ERROR)
    try:
        if address is None:
            ray.init(address="local", include_dashboard=False, **quiet)
        else:
            _knock(address)
            ray.init(address=address, **quiet)
    except (ConnectionError, ValueError, RuntimeError, OSError, SystemExit) as error:
        if isinstance(error, SystemExit):  # Ray's, when what answers is no Ray
            error = ConnectionError(_NO_RAY)
        reason = (isinstance(error, OSError) and error.strerror) or _line(error)
        what = "Ray cannot be started here" if address is None else f"there is no Ray cluster to join at {address}"
        raise InputError(f"{what}: {reason}") from None


def _knock(address: str) -> None:
    """OSError or ValueError soon if nothing answers at HOST:PORT as Ray does; any other form is for Ray to know."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and not port.isdigit():
        raise ValueError(f"{port!r} is no port; write HOST:PORT")
    if colon:
        unencrypted = os.environ.get("RAY_USE_TLS", "0").lower() in ("", "0", "false")
        with socket.create_connection((host.strip("[]"), int(port)), timeout=PATIENCE) as door:
            if unencrypted:  # else the answer is for Ray's keys alone
                _greet(door)


def _greet(door: socket.socket) -> None:
    """ConnectionError unless HTTP/2 is spoken there, as gRPC and so Ray does: a server begins with its settings."""
    deadline, head = time.monotonic() + PATIENCE, b""
    with suppress(OSError):
        door.sendall(_GREETING)
        while len(head) < _FRAME_HEAD and (left := deadline - time.monotonic()) > 0:
            door.settimeout(left)
            piece = door.recv(_FRAME_HEAD - len(head))
            if not piece:
                break
            head += piece
    if len(head) < _FRAME_HEAD or head[3] != _SETTINGS or any(head[5:]):
        raise ConnectionError(_NO_RAY)


def _run(ray: Any, job: Job, shards: Sequence[Shard], workers: int, done: Done, tick: Callable[[int], None]) -> Seconds:
    if job.devices not in (("cpu",), ("cuda",)):
        raise InputError(f"device {job.devices[0]}: on a cluster, every worker has a GPU of its own; say cuda")
    if not shards:
        return {}
    room = _room(ray, job)
    crew = _Crew(ray, job, min(workers or room, len(shards)))
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
        on_gpu = self._kind == "GPU"
        self._told = ray.put(replace(job, devices=("cuda:0",)) if on_gpu else job)  # Ray shows it its own GPU alone
        self._luggage = ray.put(Luggage.of(job))
        needs = {"num_gpus": 1, "num_cpus": 0} if on_gpu else {"num_cpus": 1}
        self._remote = ray.remote(**needs)(Hand).options(runtime_env={"env_vars": PINNED})
        self._hands: list[Any] = []
        self._pending: dict[Any, tuple[Any, Shard]] = {}
        self._rest: deque[Shard] = deque()
        self._losses: dict[Shard, int] = {}
        self._waited = 0  # seconds, in vain

    def results(self, shards: Sequence[Shard]) -> Iterator[tuple[Shard, Parcel]]:
        """Every shard with what was made of it, in whatever order; RunError if one cannot be made."""
        self._rest.extend(shards)
        while self._rest or self._pending:
            self._engage()
            ready, _ = self._ray.wait(list(self._pending), num_returns=1, timeout=1.0)
            self._waited = 0 if ready or self._ray.cluster_resources().get(self._kind) else self._waited + 1
            if self._waited > FORLORN:
                raise RunError(f"the Ray cluster has had no {self._kind} for {FORLORN} seconds; {self._job.again}")
            for reference in ready:
                hand, shard = self._pending.pop(reference)
                parcel = self._opened(reference, hand, shard)
                if parcel is not None:
                    yield shard, parcel

    def dismiss(self) -> None:
        """End all workers, each with some seconds to clear up after itself."""
        if self._hands:
            leaving = [hand.leave.remote() for hand in self._hands]
            self._ray.wait(leaving, num_returns=len(leaving), timeout=PATIENCE)
        for hand in self._hands:
            self._ray.kill(hand)

    def _engage(self) -> None:
        """Hire where there is room, and give each worker something to do next."""
        free = int(self._ray.available_resources().get(self._kind, 0)) if self._idle() else 0
        for _ in range(min(self._count - len(self._hands), max(free, not self._hands))):
            self._hands.append(self._remote.remote(self._told, len(self._hands), self._luggage, renderer()))
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
        except errors.RayError as error:  # the worker is gone, or what it made is, with the node that held it
            self._hands = [other for other in self._hands if other is not hand]
            self._losses[shard] = self._losses.get(shard, 0) + 1
            said = next((line for line in str(error).splitlines() if _OTHER_RELEASE in line), None)
            if said is not None:
                raise RunError(f"{_OTHER_RELEASE}; install the same on all") from error
            if self._losses[shard] > RETRIES:
                again = f"{self._losses[shard]} workers were lost over it; {self._job.again}"
                raise RunError(f"{_place(self._job, shard)}: {again} (Ray says: {_line(error)})") from error
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
        for path, (_, sha256, *_) in record["files"].items():
            place = root / path
            with host_errors(str(place), "free some space or allow writing, then build again: what is done is kept"):
                if sha256 in first:
                    link_or_copy(first[sha256], place)
                else:
                    write_atomic(place, parcel.bodies[sha256])
                    first[sha256] = place
    for record in parcel.records:  # when all links are made, which change a file's stamp
        record["files"] = {p: (row[0], row[1], stamp_of((root / p).lstat())) for p, row in record["files"].items()}


def _place(job: Job, shard: Shard) -> str:
    variant = job.dataset.variants[shard.variants[0]].variant
    return f"{variant}, frames {shard.frames[0]} to {shard.frames[-1]}"


def _line(error: Any) -> str:
    lines = [line for line in str(error).splitlines() if line.strip()]
    return lines[-1].strip() if lines else type(error).__name__
