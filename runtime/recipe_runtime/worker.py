"""What is done with a shard: observe, label, shade, encode, hash, write. The same code in any process.

Files go into place one by one, each whole; pixels never leave the worker, digests and records do.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.errors import RecipeError, RunError
from recipe_compiler.plan import DatasetPlan

from recipe_runtime import encode, layout
from recipe_runtime.annotate.mots import mots_picture
from recipe_runtime.engines import Engines, Observed
from recipe_runtime.frames import LABEL_MODALITIES, SceneSource, label_array, label_digest, pixel_digest
from recipe_runtime.schedule import Shard, View, views
from recipe_runtime.store import Store, link_or_copy, write_atomic

# frame, objects, digests {modality: digest}, rgb {variant: digest}, files {path: [size, SHA-256]}
FrameRecord = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """What every worker knows. `root` is the folder to write in; None: digests only. Workers share out the `devices`.

    `resumes`: a build, which takes up what was done before it failed.
    """

    dataset: DatasetPlan
    engines: Engines
    devices: tuple[str, ...]
    cache: Path
    root: Path | None
    resumes: bool = False

    @property
    def again(self) -> str:
        """What to do after a failure."""
        return "build again: what is done is kept" if self.resumes else "try again"


@dataclass
class Stopwatch:
    """Seconds spent by stage. They go to the terminal and the benchmark, never into a dataset."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Count the time inside as this stage's."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.add(stage, time.perf_counter() - start)

    def add(self, stage: str, seconds: float) -> None:
        """Count seconds measured elsewhere."""
        self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds


class Worker:
    """Does shards, one after the other, and keeps the renderer of the scene that it is at."""

    def __init__(self, job: Job, number: int = 0) -> None:
        self._job = job
        self._device = job.devices[number % len(job.devices)]
        self._views = views(job.dataset)
        self._source: SceneSource | None = None
        self.watch = Stopwatch()

    def do(self, shard: Shard, tick: Callable[[int], None]) -> list[FrameRecord]:
        """The records of a shard's frames; `tick` is told of every frame done, as a count of pictures."""
        view = self._views[shard.view]
        records = []
        for frame in shard.frames:
            try:
                records.append(_FrameTask(self._job, view, self._at(view), self.watch).do(frame, shard.variants))
            except RecipeError:
                raise
            except Exception as error:
                where = f"{self._job.dataset.variants[shard.variants[0]].variant}, {view.sensor.name}, frame {frame}"
                if isinstance(error, OSError) and error.filename is not None:
                    remedy = f"free some space or allow writing, then {self._job.again}"
                    raise RunError(f"{where}: cannot write: {error.strerror}; {remedy}") from error
                raise RunError(f"{where}: {type(error).__name__}: {error}") from error
            tick(len(shard.variants))
        return records

    def _at(self, view: View) -> SceneSource:
        if self._source is None or self._source.scene.digest != view.scene.digest:
            job, scene = self._job, view.scene
            self._source = None  # let go of one renderer before the next is made
            with self.watch("load"):
                trace = Store(job.cache).trace(scene, lambda: job.engines.simulate(scene))
                self._source = SceneSource(scene, trace, device=self._device, engines=job.engines)
                _ = self._source.renderer, self._source.annotator
        return self._source


@dataclass
class _FrameTask:
    """One frame of one view, for some variants."""

    job: Job
    view: View
    source: SceneSource
    watch: Stopwatch

    def do(self, frame: int, variants: tuple[int, ...]) -> FrameRecord:
        sensor, watch = self.view.sensor, self.watch
        with watch("observe"):
            seen = self.source.observe(sensor, frame)
        with watch("annotate"):
            objects = self.source.labels(seen, sensor, frame)
            digests = {"labels": label_digest(objects)}
        files: dict[str, list[Any]] = {}
        for modality in LABEL_MODALITIES:
            if modality in sensor.capture:
                array = label_array(seen, modality)
                with watch("hash"):
                    digests[modality] = pixel_digest(modality, array)
                self._write(files, modality, frame, array, variants)
        if "mots_png" in self.job.dataset.annotations:
            self._write_mots(files, frame, seen, variants)
        rgb = self._shade(files, frame, seen, variants) if "rgb" in sensor.capture else {}
        return {"frame": frame, "objects": objects, "digests": digests, "rgb": rgb, "files": files}

    def _shade(
        self, files: dict[str, list[Any]], frame: int, seen: Observed, variants: tuple[int, ...]
    ) -> dict[str, str]:
        """Shade once for each appearance, write for each variant that has it; the digest of each variant's picture."""
        sharing: dict[str, list[int]] = {}
        for index in variants:
            sharing.setdefault(self.job.dataset.variants[index].appearance.digest, []).append(index)
        found = {}
        for group in sharing.values():
            with self.watch("shade"):
                plan = self.job.dataset.variants[group[0]]
                picture = self.source.shade(seen, plan.appearance, self.view.sensor, frame)
            with self.watch("hash"):
                value = pixel_digest("rgb", picture)
            found.update({self.job.dataset.variants[index].variant: value for index in group})
            self._write(files, "rgb", frame, picture, tuple(group))
        return found

    def _write(
        self, files: dict[str, list[Any]], modality: str, frame: int, array: NDArray[Any], variants: tuple[int, ...]
    ) -> None:
        depth, names = self.job.dataset.depth, [self.job.dataset.variants[i].variant for i in variants]
        paths = [layout.frame_file(name, self.view.sensor.name, modality, frame, depth) for name in names]
        self._put(files, paths, lambda: _encoded(modality, array, depth))

    def _write_mots(self, files: dict[str, list[Any]], frame: int, seen: Observed, variants: tuple[int, ...]) -> None:
        names = [self.job.dataset.variants[i].variant for i in variants]
        paths = [layout.mots_png_file(name, self.view.sensor.name, frame) for name in names]
        self._put(files, paths, lambda: encode.png(mots_picture(seen.instance)))

    def _put(self, files: dict[str, list[Any]], paths: list[str], body: Callable[[], bytes]) -> None:
        """Write one file under all its names."""
        root = self.job.root
        if root is None:
            return
        with self.watch("encode"):
            data = body()
        with self.watch("hash"):
            row = [len(data), hashlib.sha256(data).hexdigest()]
        with self.watch("write"):
            write_atomic(root / paths[0], data)
            for path in paths[1:]:
                link_or_copy(root / paths[0], root / path)
        files.update(dict.fromkeys(paths, row))


def _encoded(modality: str, array: NDArray[Any], depth: str) -> bytes:
    if modality != "depth":
        return encode.png(array)
    metres = array.astype(np.float32)
    return encode.npy(metres) if depth == "npy" else encode.png(encode.carla_depth(metres))
