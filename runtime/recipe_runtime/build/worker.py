"""Renders shards: observe, label, shade, encode, hash and write. All kinds of worker processes share this code.

Files are written atomically, one by one. Digests and records leave the worker, pixels do not.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import RecipeError, RunError
from recipe_compiler.ir.modalities import LABEL_MODALITIES, form_of
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.mots import mots_picture
from recipe_runtime.annotate.records import FileRow, FrameRecord, label_digest
from recipe_runtime.attacks.truth import patch_truth
from recipe_runtime.build import host_errors
from recipe_runtime.cache.store import Store
from recipe_runtime.core import codecs, layout
from recipe_runtime.core.files import link_or_copy, write_atomic
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.timings import Timings
from recipe_runtime.dataset.schedule import Shard, View, views
from recipe_runtime.frames.engines import Engines, SceneRenderer
from recipe_runtime.frames.source import Made, SceneSource
from recipe_runtime.modalities import declared, label_array, pixel_digest


@dataclass(frozen=True)
class Job:
    """The inputs shared by all workers of a run.

    `root` is the output folder, or None if only digests are needed. Workers are distributed over the `devices`.
    `resumes` is set for a build, which can be resumed after a failure.
    """

    dataset: DatasetPlan
    engines: Engines
    devices: tuple[str, ...]
    cache: Path
    root: Path | None
    resumes: bool = False

    @property
    def again(self) -> str:
        """Return how to continue after a failure, for error messages."""
        return "build again: what is done is kept" if self.resumes else "try again"


class Worker:
    """Renders shards one after the other, and keeps the renderer of the current scene."""

    def __init__(self, job: Job, number: int = 0) -> None:
        self._job = job
        self._device = job.devices[number % len(job.devices)]
        self._views = views(job.dataset)
        self._source: SceneSource | None = None
        self._ready: tuple[str, SceneRenderer | None] = "", None  # digest, renderer loaded in advance
        self.timings = Timings()

    def do(self, shard: Shard, tick: Callable[[int], None]) -> list[FrameRecord]:
        """Render a shard and return its records; `tick` is called after every frame, with its number of pictures."""
        view, records = self._views[shard.view], []
        groups = self._groups(view, shard.variants)
        plans = [self._job.dataset.variants[group[0]].appearance for group in groups]
        patched = [self._job.dataset.variants[group[0]].appearance for group in self._patched(shard.variants)]
        with self._naming(view, shard, shard.frames[0]):
            made = self._at(view).make(view.sensor, plans, shard.frames, self.timings, patched=patched)
        for frame in shard.frames:
            with self._naming(view, shard, frame):
                task = _FrameTask(self._job, view, shard.variants, self._at(view), self.timings)
                records.append(task.do(next(made), groups, self._patched(shard.variants)))
            tick(len(shard.variants))
        return records

    def _groups(self, view: View, variants: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Group the variants by appearance; empty if no picture is requested."""
        return self._sharing(variants) if "rgb" in view.sensor.capture else []

    def _patched(self, variants: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Group the variants that have patches by appearance."""
        appearances = [plan.appearance for plan in self._job.dataset.variants]
        return self._sharing(tuple(index for index in variants if appearances[index].patches))

    def _sharing(self, variants: tuple[int, ...]) -> list[tuple[int, ...]]:
        sharing: dict[str, list[int]] = {}
        for index in variants:
            sharing.setdefault(self._job.dataset.variants[index].appearance.digest, []).append(index)
        return [tuple(group) for group in sharing.values()]

    @contextmanager
    def _naming(self, view: View, shard: Shard, frame: int) -> Iterator[None]:
        """Add the variant, the sensor and the frame to any error raised inside."""
        try:
            yield
        except RecipeError:
            raise
        except Exception as error:
            where = f"{self._job.dataset.variants[shard.variants[0]].variant}, {view.sensor.name}, frame {frame}"
            raise RunError(f"{where}: {host_errors.describe(error, self._job.again)}") from error

    def load(self, view: int) -> None:
        """Load the renderer of a view's scene in advance, before the scene is simulated."""
        scene = self._views[view].scene
        with self.timings("load"):
            self._ready = scene.digest, self._job.engines.renderer(scene, self._device)

    def _at(self, view: View) -> SceneSource:
        if self._source is None or self._source.scene.digest != view.scene.digest:
            job, scene = self._job, view.scene
            self._source = None  # release one renderer before the next is created
            (known, renderer), self._ready = self._ready, ("", None)
            if known != scene.digest:
                renderer = None
            with self.timings("load"):
                trace = Store(job.cache).trace(scene, lambda: job.engines.simulate(scene))
                renderer = renderer or job.engines.renderer(scene, self._device)
                self._source = SceneSource(scene, trace, device=self._device, engines=job.engines, renderer=renderer)
                _ = self._source.annotator
        return self._source


@dataclass
class _FrameTask:
    """The work on one frame of one view, for some variants."""

    job: Job
    view: View
    variants: tuple[int, ...]
    source: SceneSource
    timings: Timings

    def do(self, made: Made, groups: Sequence[tuple[int, ...]], patched: Sequence[tuple[int, ...]]) -> FrameRecord:
        """Label and write a frame.

        Args:
            made: The frame.
            groups: The variants of each of its pictures: those that share an appearance.
            patched: The variants of each of its maps of patches.
        """
        sensor, timings, frame, seen = self.view.sensor, self.timings, made.number, made.seen
        with timings("annotate"):
            labels = self.source.labels(seen, sensor, frame)
            digests = {"labels": label_digest(labels)}
        files: dict[str, FileRow] = {}
        arrays = {name: label_array(seen, name) for name in LABEL_MODALITIES if name in sensor.capture}
        for name, array in arrays.items():
            with timings("hash"):
                digests[name] = pixel_digest(name, array)
            self._write(files, name, frame, array, self.variants)
        self._write_copies(files, frame, seen, arrays)
        for group, shown in zip(patched, made.patch_maps, strict=True):
            self._write_patches(files, frame, seen, group, shown)
        rgb: dict[str, str] = {}
        for group, picture in zip(groups, made.pictures, strict=True):
            with timings("hash"):
                value = pixel_digest("rgb", picture)
            rgb.update({self.job.dataset.variants[index].variant: value for index in group})
            self._write(files, "rgb", frame, picture, group)
        return {**labels, "digests": digests, "rgb": rgb, "files": files}

    def _write(
        self,
        files: dict[str, FileRow],
        name: str,
        frame: int,
        array: NDArray[np.generic],
        variants: tuple[int, ...],
    ) -> None:
        forms, owners = self.job.dataset.forms, [self.job.dataset.variants[i].variant for i in variants]
        paths = [layout.frame_file(owner, self.view.sensor.name, name, frame, forms) for owner in owners]
        self._put(files, paths, lambda: declared(name).encoded(array, form_of(name, forms).ending))

    def _write_copies(
        self, files: dict[str, FileRow], frame: int, seen: Observed, arrays: Mapping[str, NDArray[np.generic]]
    ) -> None:
        """Write label modalities in their other forms."""
        dataset, sensor = self.job.dataset, self.view.sensor
        copies = [layout.label_copies(dataset, dataset.variants[i].variant, sensor, frame) for i in self.variants]
        bodies = {"mots_png": lambda: codecs.png(mots_picture(seen.instance))}
        for name, ending in layout.kwcoco_endings(dataset, sensor).items():
            bodies[name] = partial(declared(name).encoded, arrays[name], ending)
        for form in copies[0]:
            self._put(files, [paths[form] for paths in copies], bodies[form])

    def _write_patches(
        self,
        files: dict[str, FileRow],
        frame: int,
        seen: Observed,
        variants: tuple[int, ...],
        patch_map: NDArray[np.uint8],
    ) -> None:
        """Write the ground truth of the patches, one file for variants that share an appearance."""
        sensor, dataset = self.view.sensor, self.job.dataset
        with self.timings("annotate"):
            appearance = dataset.variants[variants[0]].appearance
            truth = patch_truth(self.source, appearance, sensor, seen, frame, patch_map)
        paths = [layout.patches_file(dataset.variants[index].variant, sensor.name, frame) for index in variants]
        self._put(files, paths, lambda: pretty(truth).encode())

    def _put(self, files: dict[str, FileRow], paths: list[str], body: Callable[[], bytes]) -> None:
        """Write one file under all its names."""
        root = self.job.root
        if root is None:
            return
        with self.timings("encode"):
            data = body()
        with self.timings("hash"):
            size, sha256 = len(data), hashlib.sha256(data).hexdigest()
        with self.timings("write"):
            write_atomic(root / paths[0], data)
            for path in paths[1:]:
                link_or_copy(root / paths[0], root / path)
        files.update(dict.fromkeys(paths, (size, sha256)))
