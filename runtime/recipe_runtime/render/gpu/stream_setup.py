"""What all frames of a stream share, and the memory layouts of their inputs and results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse

from recipe_runtime.core.interfaces import LabelPass
from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.atmosphere.weather_light import WeatherLight
from recipe_runtime.render.camera.develop_kernels import Response
from recipe_runtime.render.camera.passes import Tables
from recipe_runtime.render.camera.rain_kernels import Rain
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.memory_layout import MemoryLayout
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting import lights
from recipe_runtime.render.raster import passes as raster_passes
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows.lamp_shadow_kernels import StaticLampMap
from recipe_runtime.render.shadows.lamp_slots import MAP_KINDS, MAP_NAMES, STATIC_SLOTS
from recipe_runtime.render.shadows.shadow_kernels import Sunbeam


@dataclass(frozen=True)
class ShadedAppearance:
    """An appearance, prepared for a camera."""

    plan: AppearancePlan
    light: WeatherLight  # at time 0
    air: Air  # at the time of the frame that is being prepared
    colours: DeviceArray  # a one-element array of SurfaceColours
    patches: DeviceArray  # a one-element array of PatchArrays
    response: CameraResponse
    tables: Tables
    sun: int  # index among the stream's suns; -1: the sun does not shine


@dataclass
class StreamSetup:
    """What all recorded frames of a stream share."""

    g: Geometry
    device: str
    camera: CameraPlan
    side: int  # samples along a pixel's side
    suns: list[NDArray[np.float64]]
    appearances: list[ShadedAppearance]
    patched: list[DeviceArray]  # one-element arrays of PatchArrays, whose patches are numbered in each frame
    label_passes: Sequence[LabelPass]  # of further labels
    tiles: DeviceArray  # int32, every tile of the picture
    no_shadows: DeviceArray  # four empty shadow maps, for appearances without sunlight
    layout: MemoryLayout  # of what changes from frame to frame
    capacity: int  # samples for which a frame has room; it grows when a frame requires more

    @property
    def pixels(self) -> int:
        """Number of the picture's pixels."""
        return self.camera.width * self.camera.height


def frame_layout(g: Geometry, suns: int, appearances: int) -> MemoryLayout:
    """Return the layout of the values that change from frame to frame, for a number of appearances and suns."""
    parts, none = 1 + g.parts, np.zeros((1, g.parts, 3, 4))
    layout = MemoryLayout()
    layout.add("view_from_part", wp.float32, (parts, 12))
    layout.add("world_from_part", wp.float32, (parts, 12))
    layout.add("world_from_view", wp.float32, (1, 12))
    columns, slots = lights.lamp_columns(g, np.zeros((1, parts, 3, 4)), np.zeros((1, 3, 4)))
    for name, kind, column in zip(lights.LAMP_NAMES, lights.LAMP_KINDS, columns, strict=True):
        layout.add(f"lamps {name}", kind, (column.shape[1],))
    for name, kind, column in zip(MAP_NAMES, MAP_KINDS, slots.columns, strict=True):
        layout.add(f"lamp maps {name}", kind, (column.shape[1],))
    layout.add("lamp maps static", StaticLampMap, (STATIC_SLOTS,))
    columns = lights.body_columns(g, none)
    for name, kind, column in zip(lights.BODY_NAMES, lights.BODY_KINDS, columns, strict=True):
        layout.add(f"bodies {name}", kind, (column.shape[1],))
    layout.add("lit", wp.float32, (len(g.surfaces),))
    layout.add("samples", Samples, (1,))
    for n in range(suns):
        layout.add(f"beams {n}", Sunbeam, (4,))
    for v in range(appearances):
        layout.add(f"air {v}", Air, (1,))
        layout.add(f"rain {v}", Rain, (1,))
        layout.add(f"response {v}", Response, (1,))
    return layout


def result_layout(setup: StreamSetup) -> MemoryLayout:
    """Return the layout of a frame's results."""
    layout = MemoryLayout()
    for name, kind in raster_passes.LABEL_TYPES.items():
        layout.add(name, kind, (setup.pixels,))
    for label in setup.label_passes:
        layout.add(f"layer {label.name}", wp.dtype_from_numpy(np.dtype(label.dtype)), (setup.pixels * label.channels,))
    layout.add("extents", wp.int32, raster_passes.empty_extents(setup.g, 4).shape)
    layout.add("cursor", wp.int32, (1,))
    for v in range(len(setup.appearances)):
        layout.add(f"rgb {v}", wp.uint8, (setup.pixels * 3,))
    for k in range(len(setup.patched)):
        layout.add(f"patches {k}", wp.uint8, (setup.pixels,))
    return layout


def suns_of(lit: Sequence[WeatherLight]) -> list[NDArray[np.float64]]:
    """Return the distinct directions of the suns that shine, in order."""
    suns: list[NDArray[np.float64]] = []
    for light in lit:
        if light.sun_shines and not any(bool((light.sun == sun).all()) for sun in suns):
            suns.append(light.sun)
    return suns
