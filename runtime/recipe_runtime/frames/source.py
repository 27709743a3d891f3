"""Renders frames: each is a pure function of a plan, a Trace and a frame number.

The build, the verifier and `recipe shot` all render here, so that frame 217 rendered alone equals frame 217 of the full
build. A frame has pixels, one array per modality, and labels, the records of visible objects; both have digests.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import AppearancePlan, ScenePlan, SensorPlan

from recipe_runtime.annotate.objects import Annotator
from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.timings import Timings
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import sensor_transform
from recipe_runtime.frames.engines import Engines, SceneRenderer, real_engines
from recipe_runtime.frames.scene_motion import SceneMotion
from recipe_runtime.frames.vehicle_lamps import VehicleLamps
from recipe_runtime.insertion.inserter import Inserter
from recipe_runtime.modalities import label_passes

if TYPE_CHECKING:
    from recipe_runtime.render.retexture.patched_frame import PatchedFrame

_STREAM_BATCH = 512  # frames per batch of a frame stream


@dataclass(frozen=True)
class Made:
    """A frame: its observation, an image uint8 [H, W, 3] for each appearance, and maps of patches, uint8 [H, W].

    The next frame may overwrite the arrays.
    """

    number: int
    seen: Observed
    pictures: tuple[NDArray[np.uint8], ...]
    patch_maps: tuple[NDArray[np.uint8], ...] = ()


class SceneSource:
    """Renderer and labels of one scene, shared by all of its frames; created on first use."""

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
        self._motion, self._lamps = SceneMotion(scene, trace), VehicleLamps(scene, trace)
        self._renderer = renderer
        self._annotator: Annotator | None = None
        self.inserter = Inserter(trace, self._engines.assets.image)
        self.use_streams = device != "cpu"  # whether concurrent frames are faster than single ones
        self._stream: tuple[str, Any] = "", None  # the stream used last, with its key

    @property
    def renderer(self) -> SceneRenderer:
        """The scene's renderer."""
        if self._renderer is None:
            self._renderer = self._engines.renderer(self.scene, self.device)
        return self._renderer

    @property
    def annotator(self) -> Annotator:
        """The annotator of the scene's actors."""
        if self._annotator is None:
            self._annotator = Annotator(self.scene, self.trace, self._engines.actors(self.scene))
        return self._annotator

    def make(
        self,
        sensor: SensorPlan,
        appearances: Sequence[AppearancePlan],
        frames: Sequence[int],
        timings: Timings | None = None,
        in_flight: int = 4,
        patched: Sequence[AppearancePlan] = (),
    ) -> Iterator[Made]:
        """Yield frames in the order of `frames`.

        Args:
            sensor: The sensor.
            appearances: The appearances to render; none for labels alone.
            frames: Frame numbers.
            timings: Receives the time of each stage.
            in_flight: Maximum number of concurrent frames on a GPU.
            patched: The appearances of which a frame has a `patch_map`.
        """
        timings = timings or Timings()
        stream = self._stream_for(sensor, appearances, in_flight, patched) if len(frames) > 1 else None
        if stream is not None:
            yield from self._streamed(stream, sensor, frames, timings)
            return
        for frame in frames:
            with timings("observe"):
                seen = self.observe(sensor, frame)
            with timings("shade") if appearances else nullcontext():
                pictures = tuple(self.shade(seen, appearance, sensor, frame) for appearance in appearances)
            with timings("annotate") if patched else nullcontext():
                maps = tuple(self.patch_map(seen, appearance, frame) for appearance in patched)
            yield Made(frame, seen, pictures, maps)

    def observe(self, sensor: SensorPlan, frame: int) -> Observed:
        """Return the observation of a frame by a sensor."""
        pose = sensor_transform(sensor, self.trace, frame)
        with self._discard_if_interrupted():
            lamps = self._lamps.many(np.array([frame]))[0]
            seen: Observed = self.renderer.observe(sensor.camera, pose, self._motion.parts(frame), lamps)
        return seen

    def labels(self, seen: Observed, sensor: SensorPlan, frame: int) -> LabelledFrame:
        """Return the labels of a frame: its calibration, and the records of the visible objects by instance."""
        pose = sensor_transform(sensor, self.trace, frame)
        return self.annotator.labels(seen, sensor.camera, pose, frame)

    def shade(self, seen: Observed, appearance: AppearancePlan, sensor: SensorPlan, frame: int) -> NDArray[np.uint8]:
        """Return the colour image of an observation, with inserted textures, uint8 [H, W, 3] sRGB."""
        if not any(patch.inserted for patch in appearance.patches):
            return self.shade_scene(seen, appearance, sensor, frame)
        return self.inserter.picture(_ObservedFrame(self, seen, sensor, frame), appearance, sensor, frame)

    def shade_scene(
        self, seen: Observed, appearance: AppearancePlan, sensor: SensorPlan, frame: int
    ) -> NDArray[np.uint8]:
        """Return the colour image of an observation, without inserted textures, uint8 [H, W, 3] sRGB."""
        time, blur = frame / self.scene.clock.fps, self._blur_from(appearance, sensor, frame)
        with self._discard_if_interrupted():
            return self.renderer.shade(seen, appearance, sensor.name, frame, time, **blur)

    def unrounded(
        self, seen: Observed, appearance: AppearancePlan, sensor: SensorPlan, frame: int
    ) -> NDArray[np.float64]:
        """Return the colour image, without inserted textures, before it is rounded to 8 bits, [H, W, 3], 0 to 1."""
        time, blur = frame / self.scene.clock.fps, self._blur_from(appearance, sensor, frame)
        with self._discard_if_interrupted():
            return self.renderer.unrounded(seen, appearance, sensor.name, frame, time, **blur)

    def patched_frame(self, seen: Observed, appearance: AppearancePlan, sensor: SensorPlan, frame: int) -> PatchedFrame:
        """Return the frame of an observation for rendering with other textures on its patches."""
        time, blur = frame / self.scene.clock.fps, self._blur_from(appearance, sensor, frame)
        with self._discard_if_interrupted():
            made: PatchedFrame = self.renderer.patched_frame(seen, appearance, sensor.name, frame, time, **blur)
        return made

    def _blur_from(self, appearance: AppearancePlan, sensor: SensorPlan, frame: int) -> dict[str, object]:
        """Return the neighbour that motion blur takes the motion from, as an argument; empty without motion blur."""
        response = appearance.responses.get(sensor.name)
        if response is None or response.motion_blur_intensity == 0.0 or self.scene.clock.frames < 2:
            return {}
        return {"neighbour": self._neighbour_frame(sensor, frame)}

    def patch_map(self, seen: Observed, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        """Return which patch each pixel of an observation shows, uint8 [H, W]: 1 + its number, 0 for none."""
        with self._discard_if_interrupted():
            return self.renderer.patch_map(seen, appearance, frame)

    @contextmanager
    def _discard_if_interrupted(self) -> Iterator[None]:
        """Discard the renderer if it is interrupted, because its state between frames may then be inconsistent."""
        try:
            yield
        except BaseException:
            self._renderer = None
            raise

    def _stream_for(
        self,
        sensor: SensorPlan,
        appearances: Sequence[AppearancePlan],
        in_flight: int,
        patched: Sequence[AppearancePlan],
    ) -> Any:
        """Return a frame stream and its key; None on a CPU, and for cameras that need one frame at a time."""
        if not self.use_streams:
            return None
        from recipe_runtime.render.gpu.frame_stream import can_stream

        if not can_stream(sensor, appearances):
            return None
        digests = [[plan.digest for plan in plans] for plans in (appearances, patched)]
        key = digest("reel/1", [sensor.document(), *digests, in_flight])
        known, kept = self._stream
        self._stream = "", None  # not reentrant; and its memory is freed before another one is allocated
        if known != key:
            kept = None
            further = label_passes(sensor.capture)
            kept = self.renderer.frame_stream(sensor.camera, sensor.name, appearances, in_flight, patched, further)
        return key, kept

    def _streamed(
        self, stream: tuple[str, Any], sensor: SensorPlan, frames: Sequence[int], timings: Timings
    ) -> Iterator[Made]:
        from recipe_runtime.render.gpu.frame_stream import FrameBatch

        left = len(frames)
        try:
            for start in range(0, len(frames), _STREAM_BATCH):
                numbers = frames[start : start + _STREAM_BATCH]
                poses = np.stack([sensor_transform(sensor, self.trace, frame) for frame in numbers])
                times = [frame / self.scene.clock.fps for frame in numbers]
                rows = np.array(numbers)
                batch = FrameBatch(numbers, times, poses, self._motion.many(rows), self._lamps.many(rows))
                prints = stream[1].frames(batch)
                for _ in numbers:
                    with timings("render"):
                        made = next(prints)
                    left -= 1
                    yield Made(made.number, made.observation, made.pictures, made.patch_maps)
        finally:
            if not left:  # otherwise frames are still in flight
                self._stream = stream

    def _neighbour_frame(self, sensor: SensorPlan, frame: int) -> Any:
        """Return the previous frame, or for frame 0 the next one; the length of the blur is equal."""
        from recipe_runtime.render.camera.motion_blur import NeighbourFrame

        other = frame - 1 if frame > 0 else 1
        pose = sensor_transform(sensor, self.trace, other)
        return NeighbourFrame(pose, self._motion.neighbour(frame, other), 1.0 / self.scene.clock.fps)


@dataclass(frozen=True)
class _ObservedFrame:
    """One frame of one sensor, for insertion; see `insertion.inserter.FrameRenderer`."""

    source: SceneSource
    seen: Observed
    sensor: SensorPlan
    frame: int

    def picture(self, appearance: AppearancePlan) -> NDArray[np.uint8]:
        return self.source.shade_scene(self.seen, appearance, self.sensor, self.frame)

    def patch_map(self, appearance: AppearancePlan) -> NDArray[np.uint8]:
        return self.source.patch_map(self.seen, appearance, self.frame)
