"""Interfaces between the stages: progress reports, and the observation of a frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntFlag
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class LampState(IntFlag):
    """The lamps of a vehicle that are lit in a frame, besides head and tail lamps."""

    BRAKE = 1
    LEFT = 2  # the indicators of the left side
    RIGHT = 4
    REVERSE = 8


Progress = Callable[[str, int, int], None]  # stage, done, total


class ObjectView(Protocol):
    """One actor in one observation, as if it were unoccluded.

    `amodal`: number of its pixels within the image. `amodal_box`: their box x0, y0, x1, y1 (exclusive end).
    `projected`: its box before clipping to the image.
    """

    @property
    def instance(self) -> int: ...  # noqa: D102
    @property
    def amodal(self) -> int: ...  # noqa: D102
    @property
    def amodal_box(self) -> Sequence[int]: ...  # noqa: D102
    @property
    def projected(self) -> Sequence[float]: ...  # noqa: D102


@dataclass(frozen=True)
class LabelPass:
    """A pass that computes a label from the visible surfaces of a frame, in addition to those of every observation.

    Attributes:
        name: Name of the modality.
        dtype: Type of its arrays, such as `float32`.
        channels: Values of a pixel. 1: its arrays are [H, W], otherwise [H, W, channels].
        draw: Launches the kernels. The arguments are `render.raster.surfaces.VisibleSurfaces`, and the array on the
            device to write, [H * W * channels], row by row.
    """

    name: str
    dtype: str
    channels: int
    draw: Callable[..., None]

    def shape(self, width: int, height: int) -> tuple[int, ...]:
        """Return the shape of its arrays for a picture of that size."""
        return (height, width) if self.channels == 1 else (height, width, self.channels)


class Observed(Protocol):
    """All labels of one frame of one sensor, from one visibility buffer."""

    @property
    def depth(self) -> NDArray[np.float32]: ...  # noqa: D102  [H, W] metres
    @property
    def instance(self) -> NDArray[np.uint16]: ...  # noqa: D102  [H, W] tag * 1000 + number, 0 for town and sky
    @property
    def semantic(self) -> NDArray[np.uint8]: ...  # noqa: D102  [H, W] CARLA tags
    @property
    def objects(self) -> Sequence[ObjectView]: ...  # noqa: D102
    def drawn(self, label_pass: LabelPass) -> NDArray[np.generic]:
        """Return the array of a pass: [H, W], or [H, W, channels] of a pass with several."""
