"""Interfaces between the stages: progress reports, and the observation of a frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

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
