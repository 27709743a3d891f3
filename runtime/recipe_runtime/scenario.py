"""A variant as a sequence of frames, each rendered when it is asked for, in any order, in any process.

What is asked for is what a build would write: the same function makes both. Engines are made when first needed, and
made again in a process that inherited or was sent a scenario, so that the workers of a `DataLoader` each have theirs.
"""

from __future__ import annotations

import io
import os
import weakref
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import ScenarioPlan, ScenePlan, SensorPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.records import LabelRecord
from recipe_runtime.cache.pruning import leased
from recipe_runtime.cache.store import Store
from recipe_runtime.core import codecs
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.modalities import label_array
from recipe_runtime.core.versions import builder
from recipe_runtime.frames.engines import Engines, devices, real_engines
from recipe_runtime.frames.source import SceneSource

SCENES_KEPT = 2  # renderers in memory at once; each holds a town's triangles
LANES = 16  # frames under way at once on a GPU
OBSERVATIONS_KEPT = 2  # so that the modalities of one frame, and its weathers, share what is seen


class Scenes:
    """The scenes that this process has at hand, the last used first to stay; those of another process are not ours."""

    def __init__(self, device: str = "cpu", engines: Engines | None = None, store: Store | None = None) -> None:
        self.device = devices(device)[0]
        self._engines = engines or real_engines()
        self._store = store or Store()
        self._process = os.getpid()
        self._sources: OrderedDict[str, SceneSource] = OrderedDict()
        self._seen: OrderedDict[tuple[str, str, int], tuple[Any, Observed]] = OrderedDict()  # with who observed it
        self._release: Callable[[], object] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_sources": OrderedDict(), "_seen": OrderedDict(), "_release": None}

    def close(self) -> None:
        """Let go of renderers, and of the cache; both are taken again if more is asked for."""
        self._sources.clear()
        self._seen.clear()
        if self._release is not None:
            self._release()
            self._release = None

    def source(self, scene: ScenePlan) -> SceneSource:
        """The frames of a scene; it is simulated unless the store has its Trace."""
        self._settle()
        key = scene.digest
        if key not in self._sources:
            trace = self._store.trace(scene, lambda: self._engines.simulate(scene))
            while len(self._sources) >= SCENES_KEPT:
                self._sources.popitem(last=False)
            self._sources[key] = SceneSource(scene, trace, device=self.device, engines=self._engines)
        self._sources.move_to_end(key)
        return self._sources[key]

    def observe(self, scene: ScenePlan, sensor: SensorPlan, frame: int) -> Observed:
        """What a sensor sees at a frame."""
        source = self.source(scene)
        key = (scene.digest, digest("sensor/1", sensor.document()), frame)
        renderer, seen = self._seen.get(key, (None, None))
        if (
            seen is None or renderer is not source.renderer
        ):  # (a renderer that was stopped has gone, and takes all along)
            while len(self._seen) >= OBSERVATIONS_KEPT:
                self._seen.popitem(last=False)
            seen = source.observe(sensor, frame)
            self._seen[key] = source.renderer, seen
        return seen

    def _settle(self) -> None:
        """Let go of what another process made, and see that nothing of the cache is pruned that is read from now on."""
        if self._process != os.getpid():
            self._process = os.getpid()
            self._sources.clear()
            self._seen.clear()
            self._release = None  # the other's to give back
        if self._release is None:  # until closed, or gone, or the process is
            stack = ExitStack()
            stack.enter_context(leased(self._store.root))
            self._release = weakref.finalize(self, stack.close)


@dataclass(frozen=True)
class Frame:
    """One moment of a scenario; nothing is rendered before it is asked for."""

    scenario: Scenario
    number: int

    @property
    def time(self) -> float:
        """Seconds since the first frame."""
        return self.number / self.scenario.plan.scene.clock.fps

    def render(self, sensor: str | None = None, modality: str = "rgb") -> NDArray[Any]:
        """As `Scenario.render`."""
        return self.scenario.render(self.number, sensor, modality)

    def labels(self, sensor: str | None = None) -> list[LabelRecord]:
        """As `Scenario.labels`."""
        return self.scenario.labels(self.number, sensor)


class Scenario(Sequence[Frame]):
    """The frames of one variant. `plan` is all that it is made from.

    What it reads from the cache is not pruned until it is closed, or collected; `with` closes it.
    """

    def __init__(self, plan: ScenarioPlan, scenes: Scenes, disk_cache: Path | None = None) -> None:
        self.plan = plan
        self._scenes = scenes
        self._kept = Store(disk_cache) if disk_cache is not None else None
        self._rig = {sensor.name: sensor for sensor in plan.rig.sensors}

    def close(self) -> None:
        """Let go of renderers, and of the cache; both are taken again if more is asked for."""
        self._scenes.close()

    def __enter__(self) -> Scenario:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def variant(self) -> str:
        """The variant's name."""
        return self.plan.variant

    @property
    def sensors(self) -> tuple[str, ...]:
        """The sensors' names, in the recipe's order."""
        return tuple(self._rig)

    def modalities(self, sensor: str | None = None) -> tuple[str, ...]:
        """What a sensor, the first by default, captures."""
        return self._sensor(sensor).capture

    def __len__(self) -> int:
        return self.plan.scene.clock.frames

    def __getitem__(self, frame: Any) -> Any:
        """A frame; a list of them for a slice. IndexError beyond the last, negative numbers count from the end."""
        if isinstance(frame, slice):
            return [Frame(self, k) for k in range(*frame.indices(len(self)))]
        return Frame(self, self._number(frame))

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(self, k) for k in range(len(self)))

    def __repr__(self) -> str:
        return f"<{self.variant}: {count(len(self), 'frame')} of {', '.join(self.sensors)}>"

    def render(self, frame: int, sensor: str | None = None, modality: str = "rgb") -> NDArray[Any]:
        """The pixels of a frame, equal to those of a build; a fresh array.

        rgb: uint8 [H, W, 3], sRGB. depth: float32 [H, W], metres along the optical axis. instance: uint16 [H, W],
        class * 1000 + number. semantic: uint8 [H, W], CARLA 0.9.14 tags. InputError for what the sensor does not
        capture, IndexError for a frame that is not there.
        """
        frame, plan = self._number(frame), self._sensor(sensor)
        if modality not in plan.capture:
            raise InputError(
                f"the sensor {plan.name} captures {', '.join(plan.capture)}, not {modality!r}", code=Code.UNKNOWN_NAME
            )
        if self._kept is None:
            return self._render(frame, plan, modality)
        key = self._key(frame, plan, modality)
        body = self._kept.get("pixels", key)
        if body is None:
            pixels = self._render(frame, plan, modality)
            self._kept.put("pixels", key, codecs.npy(pixels))
            return pixels
        kept: NDArray[Any] = np.load(io.BytesIO(body), allow_pickle=False)
        return kept

    def stream(
        self, sensor: str | None = None, frames: Iterable[int] | None = None
    ) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
        """Frames one after the other, all by default, each with all that the sensor captures, as `render` gives it.

        On a GPU many are under way at once. The arrays hold until the next frame is asked for: copy what is to last.
        """
        plan, scene = self._sensor(sensor), self.plan.scene
        numbers = [self._number(frame) for frame in (range(len(self)) if frames is None else frames)]
        appearances = [self.plan.appearance] if "rgb" in plan.capture else []
        for made in self._scenes.source(scene).make(plan, appearances, numbers, lanes=LANES):
            pictures: dict[str, NDArray[Any]] = dict(zip(["rgb"], made.pictures, strict=False))
            yield made.number, {m: pictures[m] if m == "rgb" else label_array(made.seen, m) for m in plan.capture}

    def labels(self, frame: int, sensor: str | None = None) -> list[LabelRecord]:
        """The records of what is seen in a frame, by instance; `annotate.objects` tells what each holds."""
        frame, plan = self._number(frame), self._sensor(sensor)
        scene = self.plan.scene
        return self._scenes.source(scene).labels(self._scenes.observe(scene, plan, frame), plan, frame)

    def _render(self, frame: int, plan: SensorPlan, modality: str) -> NDArray[Any]:
        scene = self.plan.scene
        seen = self._scenes.observe(scene, plan, frame)
        if modality == "rgb":
            return self._scenes.source(scene).shade(seen, self.plan.appearance, plan, frame)
        return label_array(seen, modality).copy()  # the observation stays ours

    def _key(self, frame: int, plan: SensorPlan, modality: str) -> str:
        """A name for these pixels, from all that they depend on: plans, place, and the code that makes them."""
        colour = self.plan.appearance.digest if modality == "rgb" else ""
        return digest("store/pixels/1", [self.plan.scene.digest, plan.document(), colour, modality, frame, builder()])

    def _number(self, frame: int) -> int:
        if not -len(self) <= frame < len(self):
            raise IndexError(f"frame {frame} is not there: {self.variant} has frames 0 to {len(self) - 1}")
        return frame % len(self)

    def _sensor(self, name: str | None) -> SensorPlan:
        if name is None:
            return next(iter(self._rig.values()))
        if name not in self._rig:
            raise InputError(f"the rig has no sensor {name!r}; it has {', '.join(self._rig)}", code=Code.UNKNOWN_NAME)
        return self._rig[name]
