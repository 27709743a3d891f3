"""One frame of one variant, rendered alone: the very pixels of the full build, and a picture of them for people."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.errors import InputError
from recipe_compiler.plan import ScenarioPlan, SensorPlan

from recipe_runtime import encode
from recipe_runtime.engines import Engines, devices, real_engines
from recipe_runtime.frames import FrameSource, pixel_digest
from recipe_runtime.housekeeping import leased
from recipe_runtime.report.colours import depth_picture, instance_picture, semantic_picture
from recipe_runtime.store import Store, host_errors, write_atomic


@dataclass(frozen=True)
class Shot:
    """A frame's pixels, with where they are from."""

    sensor: str
    frame: int
    modality: str
    pixels: NDArray[Any]

    @property
    def digest(self) -> str:
        """Identity of the pixels, as in a lockfile."""
        return pixel_digest(self.modality, self.pixels)

    def picture(self) -> NDArray[np.uint8]:
        """The frame as uint8 [H, W, 3]; colour as it is, depth and labels made visible."""
        if self.modality == "rgb":
            return self.pixels
        paint = {"depth": depth_picture, "instance": instance_picture, "semantic": semantic_picture}
        return paint[self.modality](self.pixels)

    def write(self, path: Path) -> None:
        """Write the picture as a PNG, whole or not at all."""
        with host_errors(str(path), "choose another --output"):
            encoded = encode.photograph if self.modality == "rgb" else encode.png
            write_atomic(path, encoded(self.picture()))


def shot(
    scenario: ScenarioPlan,
    sensor: str | None = None,
    frame: int | None = None,
    modality: str | None = None,
    *,
    engines: Engines | None = None,
    store: Store | None = None,
    device: str = "cpu",
) -> Shot:
    """Render one frame; by default the first sensor's, the middle one, in colour. InputError for what is not there."""
    engines, store = engines or real_engines(), store or Store()
    rig = {s.name: s for s in scenario.rig.sensors}
    plan = _pick(rig, sensor)
    frames = scenario.scene.clock.frames
    frame = frames // 2 if frame is None else frame
    if frame >= frames:
        raise InputError(f"frame {frame} is not there: {scenario.variant} has frames 0 to {frames - 1}")
    modality = modality or ("rgb" if "rgb" in plan.capture else plan.capture[0])
    if modality not in plan.capture:
        raise InputError(f"the sensor {plan.name} captures {', '.join(plan.capture)}, not {modality!r}")
    with leased(store.root):
        trace = store.trace(scenario.scene, lambda: engines.simulate(scenario.scene))
        pixels = FrameSource(scenario, trace, devices(device)[0], engines=engines).render(plan.name, frame)[modality]
    return Shot(plan.name, frame, modality, pixels)


def _pick(rig: dict[str, SensorPlan], name: str | None) -> SensorPlan:
    if name is None:
        return next(iter(rig.values()))
    if name not in rig:
        raise InputError(f"the rig has no sensor {name!r}; it has {', '.join(rig)}")
    return rig[name]
