"""A frame of a variant that can be rendered again with other textures on patches of any mode but `green`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.patches import PatchPlan
from recipe_compiler.ir.plan import AppearancePlan, SensorPlan

from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.transforms import Array
from recipe_runtime.frames.process_lock import ProcessLock
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.insertion.color_transfer import Transfer
from recipe_runtime.insertion.inserter import InsertedPixels, Inserter

if TYPE_CHECKING:
    from recipe_runtime.render.retexture.patched_frame import PatchedFrame

Pixels = NDArray[np.uint8]


class RetexturedFrame:
    """A frame that is rendered again with other textures; it does not refer to the scene's renderer.

    Colour transforms that use a chart need a frame with the chart in the place of the patch. That frame is recorded as
    well, because textures of other patches in it may change.
    """

    def __init__(
        self,
        source: SceneSource,
        seen: Observed,
        appearance: AppearancePlan,
        sensor: SensorPlan,
        frame: int,
        exclusive: ProcessLock,
    ) -> None:
        """Record the frame.

        Args:
            source: The scene.
            seen: The sensor's observation of the frame, by `source`.
            appearance: The appearance.
            sensor: The sensor.
            frame: Number of the frame.
            exclusive: The lock of the scene, with which the frame shares buffers.
        """
        self.exclusive = exclusive
        self.appearance, self.sensor, self._number = appearance, sensor, frame
        self._inserter: Inserter = source.inserter
        recorder = _Recorder(source, seen, sensor, frame)
        self._inserter.picture(recorder, appearance, sensor, frame)
        self._frames, self._maps = recorder.frames, recorder.maps

    @property
    def patches(self) -> tuple[PatchPlan, ...]:
        """The patches of the appearance."""
        return self.appearance.patches

    @property
    def scene(self) -> PatchedFrame:
        """The frame without inserted textures."""
        return self._frames[self.appearance.digest]

    @property
    def memory(self) -> int:
        """About how many bytes of memory the frame takes."""
        return sum(frame.memory for frame in self._frames.values()) + sum(m.nbytes for m in self._maps.values())

    def render(self, textures: Mapping[str, Pixels]) -> Pixels:
        """Return the picture with other textures, uint8 [H, W, 3] sRGB, with the bytes of a build with these textures.

        Args:
            textures: Images by the name of the patch, uint8 [h, w, 3] sRGB; patches without one keep their own.
        """
        # The cells of a chart have the name of the patch that they replace, but keep their colours.
        inserted = {patch.name for patch in self.patches if patch.inserted}
        rendered = {name: texture for name, texture in textures.items() if name not in inserted}
        replay = _Replay(self._frames, self._maps, rendered)
        with self.exclusive():
            return self._inserter.picture(replay, self.appearance, self.sensor, self._number, textures)

    def inserted_pixels(self, patch: str) -> InsertedPixels | None:
        """Return the pixels into which a patch is inserted; None if it is not visible."""
        number = [plan.name for plan in self.patches].index(patch)
        shown = self._maps[self.appearance.digest]
        return self._inserter.pixels(shown, self.appearance, number, self.sensor, self._number)

    def color_change(self, patch: str) -> tuple[Transfer, Array] | None:
        """Return the colour transform of an inserted, visible patch, and the brightness ratio of each of its N pixels.

        The ratios are [N, 1]. Neither depends on textures of inserted patches. None if the patch's mode has none.
        """
        number = [plan.name for plan in self.patches].index(patch)
        pixels = self.inserted_pixels(patch)
        replay = _Replay(self._frames, self._maps, {})
        with self.exclusive():
            change = self._inserter.change(replay, self.appearance, number)
            if change is None or pixels is None:
                return None
            return change, change.ratios(replay.picture(self.appearance)[pixels.rows, pixels.columns])

    def texture_size(self, patch: PatchPlan) -> tuple[int, int] | None:
        """Return width and height of a patch's own image; None for a colour."""
        if patch.inserted:
            return self._inserter.texture_size(patch, self._number)
        return self.scene.texture_size(patch.name)


@dataclass
class _Recorder:
    """A renderer of one frame that records the frames that it renders, by the digest of the appearance."""

    source: SceneSource
    seen: Observed
    sensor: SensorPlan
    frame: int
    frames: dict[str, PatchedFrame] = field(default_factory=dict)
    maps: dict[str, Pixels] = field(default_factory=dict)

    def picture(self, appearance: AppearancePlan) -> Pixels:
        frame = self.source.patched_frame(self.seen, appearance, self.sensor, self.frame)
        self.frames[appearance.digest] = frame
        return frame.render({})

    def patch_map(self, appearance: AppearancePlan) -> Pixels:
        shown = self.source.patch_map(self.seen, appearance, self.frame).copy()
        self.maps[appearance.digest] = shown
        return shown


@dataclass(frozen=True)
class _Replay:
    """Renders the recorded frames, with other textures on rendered patches."""

    frames: dict[str, PatchedFrame]
    maps: dict[str, Pixels]
    textures: Mapping[str, Pixels]

    def picture(self, appearance: AppearancePlan) -> Pixels:
        return self.frames[appearance.digest].render(self.textures)

    def patch_map(self, appearance: AppearancePlan) -> Pixels:
        return self.maps[appearance.digest]
