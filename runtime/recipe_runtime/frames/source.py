"""A frame is a pure function of a plan, a Trace and a number: this is that function.

The build, the verifier and `recipe shot` all make their frames here, so that frame 217 alone is frame 217 of the
full build. A frame has pixels, an array a modality, and labels, the records of what is seen; both have digests.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import AppearancePlan, ScenarioPlan, ScenePlan, SensorPlan

from recipe_runtime.annotate.objects import Annotator
from recipe_runtime.annotate.records import LabelRecord
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.modalities import LABEL_MODALITIES, label_array
from recipe_runtime.core.timings import Stopwatch
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import part_transforms, sensor_transform
from recipe_runtime.frames.engines import Engines, SceneRenderer, real_engines

_REELED = 512  # frames whose numbers a reel is given at once


@dataclass(frozen=True)
class Made:
    """A frame: what is seen, and a picture [H, W, 3] for each appearance. Its arrays may be drawn over by the next."""

    number: int
    seen: Observed
    pictures: tuple[NDArray[np.uint8], ...]


class SceneSource:
    """What all frames of one scene share: its renderer and its truth, made when first asked for."""

    def __init__(
        self,
        scene: ScenePlan,
        trace: Trace,
        *,
        device: str = "cpu",
        engines: Engines | None = None,
        renderer: SceneRenderer | None = None,
    ) -> None:
        self.scene, self.trace, self.device = scene, trace, device
        self._engines = engines or real_engines()
        self._renderer = renderer
        self._annotator: Annotator | None = None
        self.reels = device != "cpu"  # where many frames under way at once are quicker than one by one
        self._reel: tuple[str, Any] = "", None  # the last that was used, by what it shows

    @property
    def renderer(self) -> SceneRenderer:
        """The scene's renderer."""
        if self._renderer is None:
            self._renderer = self._engines.renderer(self.scene, self.device)
        return self._renderer

    @property
    def annotator(self) -> Annotator:
        """The truth about the scene's actors."""
        if self._annotator is None:
            self._annotator = Annotator(self.scene, self.trace, self._engines.actors(self.scene))
        return self._annotator

    def make(
        self,
        sensor: SensorPlan,
        appearances: Sequence[AppearancePlan],
        frames: Sequence[int],
        watch: Stopwatch | None = None,
        lanes: int = 4,
    ) -> Iterator[Made]:
        """Frames in the order asked for; on a GPU several are under way at once, in so many lanes, where they can."""
        watch = watch or Stopwatch()
        reel = self._reel_of(sensor, appearances, lanes) if len(frames) > 1 else None
        if reel is not None:
            yield from self._reeled(reel, sensor, frames, watch)
            return
        for frame in frames:
            with watch("observe"):
                seen = self.observe(sensor, frame)
            with watch("shade") if appearances else nullcontext():
                pictures = tuple(self.shade(seen, appearance, sensor, frame) for appearance in appearances)
            yield Made(frame, seen, pictures)

    def observe(self, sensor: SensorPlan, frame: int) -> Observed:
        """What a sensor sees at a frame."""
        pose = sensor_transform(sensor, self.trace, frame)
        with self._whole():
            seen: Observed = self.renderer.observe(sensor.camera, pose, part_transforms(self.trace, frame))
        return seen

    def labels(self, seen: Observed, sensor: SensorPlan, frame: int) -> list[LabelRecord]:
        """The records of the objects seen."""
        pose = sensor_transform(sensor, self.trace, frame)
        return self.annotator.records(seen, sensor.camera, pose, frame)

    def shade(self, seen: Observed, appearance: AppearancePlan, sensor: SensorPlan, frame: int) -> NDArray[Any]:
        """The colour picture of an observation."""
        time, response = frame / self.scene.clock.fps, appearance.responses.get(sensor.name)
        with self._whole():
            if response is None or response.motion_blur_intensity == 0.0 or self.scene.clock.frames < 2:
                return self.renderer.shade(seen, appearance, sensor.name, frame, time)
            return self.renderer.shade(seen, appearance, sensor.name, frame, time, moment=self._moment(sensor, frame))

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """What a renderer keeps from frame to frame may be half made if it is stopped: another takes its place then."""
        try:
            yield
        except BaseException:
            self._renderer = None
            raise

    def _reel_of(self, sensor: SensorPlan, appearances: Sequence[AppearancePlan], lanes: int) -> Any:
        """A reel for what is asked for; None on a CPU, and for cameras that need one frame at a time."""
        if not self.reels:
            return None
        from recipe_runtime.render.gpu.frame_stream import can_stream

        if not can_stream(sensor, appearances):
            return None
        key = digest("reel/1", [sensor.document(), [plan.digest for plan in appearances], lanes])
        known, kept = self._reel
        self._reel = "", None  # one serves one stream at a time; and its memory goes before another's is asked for
        if known != key:
            kept = None
            kept = self.renderer.reel(sensor.camera, sensor.name, appearances, lanes)
        return key, kept

    def _reeled(
        self, reel: tuple[str, Any], sensor: SensorPlan, frames: Sequence[int], watch: Stopwatch
    ) -> Iterator[Made]:
        from recipe_runtime.render.gpu.frame_stream import FrameBatch

        left = len(frames)
        try:
            for start in range(0, len(frames), _REELED):
                numbers = frames[start : start + _REELED]
                poses = np.stack([sensor_transform(sensor, self.trace, frame) for frame in numbers])
                times = [frame / self.scene.clock.fps for frame in numbers]
                prints = reel[1].frames(
                    FrameBatch(numbers, times, poses, part_transforms(self.trace, np.array(numbers)))
                )
                for _ in numbers:
                    with watch("render"):
                        made = next(prints)
                    left -= 1
                    yield Made(made.number, made.observation, made.pictures)
        finally:
            if not left:  # else its lanes are still at work
                self._reel = reel

    def _moment(self, sensor: SensorPlan, frame: int) -> Any:
        """The frame before, or after the first: a blur is as long both ways."""
        from recipe_runtime.render.camera.motion_blur import NeighbourFrame

        other = frame - 1 if frame > 0 else 1
        pose = sensor_transform(sensor, self.trace, other)
        return NeighbourFrame(pose, part_transforms(self.trace, other), 1.0 / self.scene.clock.fps)


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

    def render(self, sensor: str, frame: int) -> dict[str, NDArray[Any]]:
        """The captured modalities of one frame: arrays that `pixel_digest` takes."""
        return self.render_labelled(sensor, frame)[0]

    def render_labelled(self, sensor: str, frame: int) -> tuple[dict[str, NDArray[Any]], list[LabelRecord]]:
        """The captured modalities of one frame, and its labels."""
        plan = self._sensors[sensor]
        seen = self.source.observe(plan, frame)
        arrays: dict[str, NDArray[Any]] = {m: label_array(seen, m) for m in LABEL_MODALITIES if m in plan.capture}
        if "rgb" in plan.capture:
            arrays["rgb"] = self.source.shade(seen, self.scenario.appearance, plan, frame)
        return arrays, self.source.labels(seen, plan, frame)
