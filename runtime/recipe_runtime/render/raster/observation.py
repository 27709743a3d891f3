"""An Observation: all labels of one frame of one sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.core.interfaces import LabelPass
from recipe_runtime.core.transforms import Array
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster.surfaces import VisibleSurfaces
from recipe_runtime.render.scene.geometry import Geometry

Box = tuple[int, int, int, int]


@dataclass(frozen=True)
class ObjectView:
    """An actor of which at least one pixel would be visible without occlusion.

    Boxes are x0, y0, x1, y1 in pixels, ends excluded; `box` is None for a completely occluded actor. `projected` is not
    clipped to the picture, but to the near plane.
    """

    name: str
    instance: int
    visible: int  # pixels
    box: Box | None
    amodal: int  # pixels, rasterised alone, within the picture
    amodal_box: Box
    projected: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class FrameLabels:
    """All labels of one frame of one sensor, from one visibility buffer."""

    depth: NDArray[np.float32]  # [H, W] metres along the optical axis; the far limit for the sky
    instance: NDArray[np.uint16]  # [H, W] class * 1000 + instance, 0 for town and sky
    semantic: NDArray[np.uint8]  # [H, W] CARLA tags, 11 for the sky
    objects: tuple[ObjectView, ...]
    camera: CameraPlan
    world_from_sensor: Array  # [3, 4]
    parts: Array  # [P, 3, 4]


@dataclass(frozen=True, eq=False)
class RecordedLabels(FrameLabels):
    """The labels of a recorded frame, and those of its passes."""

    layers: Mapping[str, NDArray[np.generic]]  # by modality

    def drawn(self, label_pass: LabelPass) -> NDArray[np.generic]:
        """Return the array of a pass: [H, W], or [H, W, channels] of a pass with several."""
        return self.layers[label_pass.name]


@dataclass(frozen=True, eq=False)
class Observation(FrameLabels):
    """The labels of a frame, and the arrays that sampling and shading start from."""

    keys: DeviceArray = field(repr=False)  # uint64 [H * W] visibility at pixel centres
    vertices: DeviceArray = field(repr=False)  # vec3f [V] in the camera's frame; static ones at least where `seen`
    seen: DeviceArray = field(repr=False)  # int32 [C], as `cull_chunks` writes it
    pose: bytes = field(repr=False)  # identifies the camera and its pose
    touched: NDArray[np.int32] = field(
        repr=False
    )  # the tiles in which moving objects may be visible, as `all_tiles` encodes them
    surfaces: VisibleSurfaces = field(repr=False)  # for passes of further labels, which are computed on demand
    lamps: NDArray[np.int32] = field(repr=False)  # [A], a mask of `LampState` for each actor

    def drawn(self, label_pass: LabelPass) -> NDArray[np.generic]:
        """Return the array of a pass: [H, W], or [H, W, channels] of a pass with several."""
        return self.surfaces.drawn(label_pass)

    @cached_property
    def device_depth(self) -> DeviceArray:
        """The depth on the device, float32 [H * W], row by row."""
        return wp.array(self.depth.reshape(-1), dtype=wp.float32, device=self.keys.device, copy=False)


def objects_of(
    geometry: Geometry, visible: NDArray[np.int32], amodal: NDArray[np.int32], projected: NDArray[np.int32]
) -> tuple[ObjectView, ...]:
    """Return the actors that would be visible without occlusion, from extents [E, 5], the actors' first."""
    views = []
    for index, actor in enumerate(geometry.actors):
        if amodal[index, 0]:
            views.append(
                ObjectView(
                    actor.name,
                    actor.instance,
                    visible=int(visible[index, 0]),
                    box=_box(visible[index]) if visible[index, 0] else None,
                    amodal=int(amodal[index, 0]),
                    amodal_box=_box(amodal[index]),
                    projected=_fractions(projected[index]),
                )
            )
    return tuple(views)


def _box(row: NDArray[np.int32]) -> Box:
    return int(row[1]), int(row[2]), int(row[3]), int(row[4])


def _fractions(row: NDArray[np.int32]) -> tuple[float, float, float, float]:
    return int(row[1]) / 256.0, int(row[2]) / 256.0, int(row[3]) / 256.0, int(row[4]) / 256.0
