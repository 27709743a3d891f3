"""The arrays of one frame in flight: everything that its passes write."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.gpu.stream_setup import StreamSetup
from recipe_runtime.render.lighting.buffers import LightBuffers, PixelLevels, RayBuffers, TileLists
from recipe_runtime.render.raster.label_kernels import TILE_PIXELS
from recipe_runtime.render.raster.passes import BinBuffers
from recipe_runtime.render.sampling.buffers import SampleColumns
from recipe_runtime.render.shadows.lamp_shadow_maps import MapMemory
from recipe_runtime.render.shadows.lamp_slots import SLOTS
from recipe_runtime.render.shadows.shadow_maps import ShadowMap, moving_beams

_BIN_CAPACITY = 1 << 17  # bins of large triangles


class FrameBuffers:
    """Arrays on the device for `setup.capacity` samples. Their sizes fit every frame, so no size is read back."""

    def __init__(self, setup: StreamSetup) -> None:
        device, g, pixels = setup.device, setup.g, setup.pixels

        def zeros(count: int, kind: type) -> DeviceArray:
            return wp.zeros(count, dtype=kind, device=device)

        self.capacity = setup.capacity
        # visibility
        self.vertices, self.world_vertices = zeros(g.vertex_count, wp.vec3f), zeros(g.vertex_count, wp.vec3f)
        self.chunk_visible = zeros(max(g.chunk_count, 1), wp.int32)
        self.coarse = zeros(pixels, wp.uint64)
        self.fine = zeros(pixels * setup.rows, wp.uint64) if setup.rows > 1 else self.coarse
        self.actor_bits = zeros(pixels, wp.uint64)
        self.bins = BinBuffers(zeros(_BIN_CAPACITY, wp.uint64), zeros(1, wp.int32))
        # samples
        size = setup.tiles.size * int(TILE_PIXELS)
        self.counts, self.firsts = zeros(size, wp.int32), zeros(size, wp.int32)
        self.wanted, self.stretches = zeros(setup.tiles.size, wp.int32), zeros(setup.tiles.size, wp.int32)
        self.groups, self.starts = zeros(pixels, wp.int32), zeros(pixels, wp.int32)
        self.columns = SampleColumns(self.capacity + 4, device)
        # light
        self.lists = {burn: TileLists.empty(setup.tiles.size, device) for burn in self._burning(setup)}
        self.maps = [self._moving_maps(setup, sun) for sun in setup.suns]
        self.lamp_maps = MapMemory(SLOTS if True in self.lists else 1, device)
        self.wet_light = LightBuffers.empty(self.capacity + 4, True, device)
        bare = self.wet_light
        self.dry_light = LightBuffers(bare.radiance, bare.mirror, bare.reuse_class, bare.radiance)
        self.rays = RayBuffers.empty(setup.camera, device)
        # temporal reuse, unused here
        self.no_sources = zeros(1, wp.vec2i)
        self.no_motion = wp.zeros((1, 1), dtype=wp.int32, device=device)
        self.no_levels = PixelLevels(zeros(1, wp.uint8), zeros(1, wp.vec3f))
        # pixels
        self.cover, self.no_cover = zeros(pixels, wp.int32), zeros(1, wp.int32)

    def light(self, wet: bool) -> LightBuffers:
        """Return the light buffers of an appearance with or without wet ground."""
        return self.wet_light if wet else self.dry_light

    @staticmethod
    def _burning(setup: StreamSetup) -> list[bool]:
        """Return whether lamps are on, for each case among the appearances."""
        return sorted({look.light.lamps_burn for look in setup.appearances})

    @staticmethod
    def _moving_maps(setup: StreamSetup, sun: NDArray[np.float64]) -> list[ShadowMap]:
        """Return the fine and the coarse map of moving objects under a sun; each frame's inputs set their position."""
        maps = []
        for beam in moving_beams(sun, np.zeros(3), np.array([1.0, 0.0, 0.0])):
            keys = wp.zeros(beam.size * beam.size, dtype=wp.uint64, device=setup.device)
            maps.append(ShadowMap(beam, setup.g, setup.device, keys))
        return maps
