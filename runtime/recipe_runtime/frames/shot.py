"""One frame of one variant, rendered alone: the pixels of the full build, and an image for display."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.modalities import KINDS
from recipe_compiler.ir.plan import ScenarioPlan, ScenePlan, SensorPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.cache.pruning import leased
from recipe_runtime.cache.store import Store
from recipe_runtime.core import codecs
from recipe_runtime.core.files import host_errors
from recipe_runtime.core.interfaces import Observed, Progress
from recipe_runtime.core.outputs import write_output
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames.engines import Engines, devices, real_engines
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.modalities import declared, label_array, pixel_digest


@dataclass(frozen=True)
class Shot:
    """The pixels of one modality of one frame."""

    sensor: str
    frame: int
    modality: str
    pixels: NDArray[Any]

    @property
    def digest(self) -> str:
        """The digest of the pixels, as in a lockfile."""
        return pixel_digest(self.modality, self.pixels)

    def picture(self) -> NDArray[np.uint8]:
        """Return the frame as uint8 [H, W, 3]: colour unchanged, labels colour-mapped."""
        return declared(self.modality).picture(self.pixels)

    def encoded(self) -> bytes:
        """Return the image as a PNG file; for colour, the bytes that a build writes."""
        if not KINDS[self.modality].is_label:
            return declared(self.modality).encoded(self.pixels, "png")
        return codecs.png(self.picture())

    def write(self, path: Path, *, replace: bool = False) -> None:
        """Write the image as a PNG, atomically.

        Raises:
            InputError: A file exists there, and `replace` is false.
            RunError: The host cannot write it.
        """
        with host_errors(str(path), "free some space, or choose another file"):
            write_output(path, self.encoded(), replace=replace)


def shot(
    scenario: ScenarioPlan,
    sensor: str | None = None,
    frame: int | None = None,
    modality: str | None = None,
    *,
    engines: Engines | None = None,
    store: Store | None = None,
    device: str = "cpu",
    progress: Progress | None = None,
) -> Shot:
    """Render one frame; by default the middle frame of the first sensor, in colour.

    The scene is simulated up to the frame only, while its renderer is loaded. A Trace of the whole scene is used if the
    store has one; a shorter Trace is stored under the plan of a scene that ends at the frame.

    Raises:
        InputError: the sensor, the frame or the modality does not exist.
    """
    with observed(scenario, sensor, frame, engines, store, device, progress or _silence) as (source, plan, frame, seen):
        modality = modality or ("rgb" if "rgb" in plan.capture else plan.capture[0])
        if modality not in plan.capture:
            raise InputError(
                f"the sensor {plan.name} does not capture {modality!r}",
                help=f"it captures {', '.join(plan.capture)}",
                code=Code.UNKNOWN_NAME,
            )
        pixels: NDArray[Any]
        if modality == "rgb":
            pixels = source.shade(seen, scenario.appearance, plan, frame)
        else:
            pixels = label_array(seen, modality)
    return Shot(plan.name, frame, modality, pixels)


@contextmanager
def observed(
    scenario: ScenarioPlan,
    sensor: str | None,
    frame: int | None,
    engines: Engines | None,
    store: Store | None,
    device: str,
    progress: Progress,
) -> Iterator[tuple[SceneSource, SensorPlan, int, Observed]]:
    """Yield the renderer of a scene, the sensor, the number of the frame and its observation; arguments as of `shot`.

    Raises:
        InputError: the sensor or the frame does not exist.
    """
    engines, store = engines or real_engines(), store or Store()
    rig, scene = {s.name: s for s in scenario.rig.sensors}, scenario.scene
    plan = _pick(rig, sensor)
    frames = scene.clock.frames
    taken = plan.frames(frames)
    frame = taken[len(taken) // 2] if frame is None else frame
    if frame >= frames:
        raise InputError(
            f"frame {frame} does not exist: {scenario.variant} has {count(frames, 'frame')}",
            help=f"choose a frame from 0 to {frames - 1}",
            code=Code.OUT_OF_RANGE,
        )
    plan.check_takes(frame, frames)
    place = devices(device)[0]
    with leased(store.root), ThreadPoolExecutor(max_workers=1) as background:
        loading = background.submit(engines.renderer, scene, place)
        trace = _trace(store, engines, scene, frame)
        progress("render", 0, 1)
        source = SceneSource(scene, trace, device=place, engines=engines, renderer=loading.result())
        yield source, plan, frame, source.observe(plan, frame)
        progress("render", 1, 1)


def _trace(store: Store, engines: Engines, scene: ScenePlan, frame: int) -> Trace:
    """Return a Trace that includes the frame, and for frame 0 the next one, which motion blur needs."""
    part = scene if store.has_trace(scene) else scene.first(max(frame, 1) + 1)
    return store.trace(part, lambda: engines.simulate(part))


def _silence(stage: str, done: int, total: int) -> None:
    """Report no progress."""


def _pick(rig: dict[str, SensorPlan], name: str | None) -> SensorPlan:
    if name is None:
        return next(iter(rig.values()))
    if name not in rig:
        raise InputError(f"the rig has no sensor {name!r}; it has {', '.join(rig)}", code=Code.UNKNOWN_NAME)
    return rig[name]
