"""The frames of one variant, one at a time, for tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.modalities import LABEL_MODALITIES
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames.engines import Engines
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.modalities import label_array


class FrameSource:
    """The frames of one variant. Variants of one scene may share `source`, and so one renderer."""

    def __init__(
        self,
        scenario: ScenarioPlan,
        trace: Trace,
        device: str = "cpu",
        *,
        engines: Engines | None = None,
        source: SceneSource | None = None,
    ) -> None:
        self.scenario = scenario
        self.source = source or SceneSource(scenario.scene, trace, device=device, engines=engines)
        self._sensors = {sensor.name: sensor for sensor in scenario.rig.sensors}

    def render(self, sensor: str, frame: int) -> dict[str, NDArray[np.generic]]:
        """Return the captured modalities of one frame, as arrays for `pixel_digest`."""
        return self.render_labelled(sensor, frame)[0]

    def render_labelled(self, sensor: str, frame: int) -> tuple[dict[str, NDArray[np.generic]], LabelledFrame]:
        """Return the captured modalities of one frame, and its labels."""
        plan = self._sensors[sensor]
        seen = self.source.observe(plan, frame)
        arrays: dict[str, NDArray[np.generic]] = {
            m: label_array(seen, m) for m in LABEL_MODALITIES if m in plan.capture
        }
        if "rgb" in plan.capture:
            arrays["rgb"] = self.source.shade(seen, self.scenario.appearance, plan, frame)
        return arrays, self.source.labels(seen, plan, frame)
