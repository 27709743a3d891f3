"""Renderers, observations and recorded frames of scenes, kept in memory and shared by the variants of a recipe."""

from __future__ import annotations

import os
import weakref
from collections import OrderedDict
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import ScenarioPlan, ScenePlan, SensorPlan

from recipe_runtime.attacks.retextured_frame import RetexturedFrame
from recipe_runtime.cache.pruning import leased
from recipe_runtime.cache.store import Store
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.frames.engines import Engines, devices, real_engines
from recipe_runtime.frames.process_lock import ProcessLock
from recipe_runtime.frames.source import SceneSource

SCENE_CACHE_SIZE = 2  # renderers in memory, each with the triangles of a town
PATCHED_FRAME_CACHE_SIZE, PATCHED_FRAME_CACHE_BYTES = 8, 1 << 30  # at most, of frames beside the newest
OBSERVATION_CACHE_SIZE = 2  # so that modalities and weathers of one frame share its observation


class Scenes:
    """A least-recently-used cache of loaded scenes and observations; another process starts with an empty one."""

    def __init__(self, device: str = "cpu", engines: Engines | None = None, store: Store | None = None) -> None:
        self.device = devices(str(device))[0]  # or a `torch.device`
        self._engines = engines or real_engines()
        self._store = store or Store()
        self.exclusive = ProcessLock()  # that a thread holds while it uses the scenes, or a frame of `patched_frame`
        self._process = os.getpid()
        self._sources: OrderedDict[str, SceneSource] = OrderedDict()
        self._observations: OrderedDict[tuple[str, str, int], tuple[Any, Observed]] = OrderedDict()  # with its renderer
        self._patched: OrderedDict[tuple[str, ...], RetexturedFrame] = OrderedDict()
        self._release: Callable[[], object] | None = None

    def __getstate__(self) -> dict[str, object]:
        empty: dict[str, object] = {name: OrderedDict() for name in ("_sources", "_observations", "_patched")}
        return {**self.__dict__, **empty, "_release": None}

    def close(self) -> None:
        """Release renderers and the lease of the cache; both are acquired again when needed."""
        with self.exclusive():
            self._sources.clear()
            self._observations.clear()
            self._patched.clear()
            if self._release is not None:
                self._release()
                self._release = None

    def source(self, scene: ScenePlan) -> SceneSource:
        """Return the frame source of a scene; simulates it unless the store has its Trace."""
        self._adopt_process()
        key = scene.digest
        if key not in self._sources:
            trace = self._store.trace(scene, lambda: self._engines.simulate(scene))
            while len(self._sources) >= SCENE_CACHE_SIZE:
                self._sources.popitem(last=False)
            self._sources[key] = SceneSource(scene, trace, device=self.device, engines=self._engines)
        self._sources.move_to_end(key)
        return self._sources[key]

    def observe(self, scene: ScenePlan, sensor: SensorPlan, frame: int) -> Observed:
        """Return the observation of a frame by a sensor."""
        source = self.source(scene)
        key = (scene.digest, digest("sensor/1", sensor.document()), frame)
        renderer, seen = self._observations.get(key, (None, None))
        if seen is None or renderer is not source.renderer:  # observations of an earlier renderer are invalid
            while len(self._observations) >= OBSERVATION_CACHE_SIZE:
                self._observations.popitem(last=False)
            seen = source.observe(sensor, frame)
            self._observations[key] = source.renderer, seen
        return seen

    def patched_frame(self, plan: ScenarioPlan, sensor: SensorPlan, frame: int) -> RetexturedFrame:
        """Return a frame for rendering with other textures on its patches."""
        self._adopt_process()
        key = plan.scene.digest, plan.appearance.digest, digest("sensor/1", sensor.document()), str(frame)
        if key not in self._patched:
            while len(self._patched) >= PATCHED_FRAME_CACHE_SIZE or self._patched_bytes() > PATCHED_FRAME_CACHE_BYTES:
                self._patched.popitem(last=False)
            source, seen = self.source(plan.scene), self.observe(plan.scene, sensor, frame)
            self._patched[key] = RetexturedFrame(source, seen, plan.appearance, sensor, frame, self.exclusive)
        self._patched.move_to_end(key)
        return self._patched[key]

    def _patched_bytes(self) -> int:
        return sum(frame.memory for frame in self._patched.values())

    def _adopt_process(self) -> None:
        """Discard state of a parent process, and take a lease on the cache."""
        if self._process != os.getpid():
            self._process = os.getpid()
            self._sources.clear()
            self._observations.clear()
            self._patched.clear()
            self._release = None  # its owner releases it
        if self._release is None:  # held until closed or collected, or the process ends
            stack = ExitStack()
            stack.enter_context(leased(self._store.root))
            self._release = weakref.finalize(self, stack.close)
