"""Shadow maps of lamps, host side: the static scene is drawn once for each lamp, moving objects every frame."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

import numpy as np

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array, zeros
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.camera import upload_transforms, world_from_parts
from recipe_runtime.render.scene.chunking import CHUNK
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows import lamp_shadow_kernels as kernels
from recipe_runtime.render.shadows.lamp_shadow_kernels import LampMaps, StaticLampMap
from recipe_runtime.render.shadows.lamp_slots import MAP_KINDS, MAP_NAMES, SLOTS, STATIC_SLOTS, LampSlots

_TEXELS = int(kernels.STATIC_SIZE) * int(kernels.STATIC_SIZE)
_TILES = int(kernels.MAX_TILES)
_STATIC_CACHE_SIZE = 24  # static maps, 5 MB each
_POOL_SIZE = 4  # unused sets of moving maps that are kept


class MapMemory:
    """The texels and tile bounds of some maps."""

    def __init__(self, maps: int, device: str) -> None:
        self.keys: DeviceArray = zeros(maps * _TEXELS, wp.uint64, device).reshape((maps, _TEXELS))
        self.nearest, self.farthest = (wp.zeros((maps, _TILES), dtype=wp.uint64, device=device) for _ in range(2))

    def clear(self, device: str) -> None:
        """Clear all maps."""
        tiles = int(self.keys.shape[0]) * _TILES
        launch(kernels.clear_lamp_maps, tiles, device, out_keys=self.keys, out_nearest=self.nearest)

    def draw(
        self,
        g: Geometry,
        maps: DeviceArray,
        world: DeviceArray,
        vertices: DeviceArray,
        chunks: range,
        device: str,
    ) -> None:
        """Draw chunks into the maps, which must be clear.

        Args:
            g: The scene.
            maps: The views of as many slots, a one-element array of `LampMaps`.
            world: World from part, float32 [1 + P, 12].
            vertices: Vertices of the chunks in the world, vec3f.
            chunks: Which chunks of the scene are drawn.
            device: The Warp device.
        """
        if not len(chunks):
            return
        slots = int(self.keys.shape[0])
        threads = 1 if device == "cpu" else CHUNK  # a GPU has threads to spare
        launch(
            kernels.draw_lamp_casters,
            slots * len(chunks) * threads,
            device,
            **fields_of(g, "triangles", "chunks", "chunk_centres", "chunk_halves", "casts"),
            vertices=vertices,
            transforms=world,
            maps=maps,
            first_chunk=chunks.start,
            chunk_count=len(chunks),
            threads_per_chunk=threads,
            out_keys=self.keys,
            out_marks=self.nearest,
        )
        memory = {"keys": self.keys, "out_nearest": self.nearest, "out_farthest": self.farthest}
        launch(kernels.bound_lamp_maps, slots * _TILES, device, **memory)

    def as_static(self) -> StaticLampMap:
        """Return the first map as that of the static scene."""
        return set_fields(StaticLampMap(), keys=self.keys, nearest=self.nearest, farthest=self.farthest)


class LampShadowMaps:
    """The shadow maps of one scene's lamps."""

    def __init__(self, geometry: Geometry, device: str) -> None:
        self._g, self._device = geometry, device
        self._static: OrderedDict[int, StaticLampMap] = OrderedDict()  # by light
        self._spare: list[MapMemory] = []  # not in use by an observation
        self._no_static = MapMemory(1, device).as_static()

    def draw(self, slots: LampSlots, world: DeviceArray, vertices: DeviceArray) -> tuple[DeviceArray, MapMemory]:
        """Return the maps of a frame, a one-element array of `LampMaps`, and the memory to give back after use.

        `world` is world from part, float32 [1 + P, 12]; `vertices` are the moving ones in the world, vec3f.
        """
        memory = self._spare.pop() if self._spare else MapMemory(SLOTS, self._device)
        memory.clear(self._device)
        columns = uploaded(slots.columns, MAP_KINDS, self._device)
        static = struct_array(self.static_maps(slots), self._device)
        maps = struct_array([maps_of(columns, static, memory)], self._device)
        moving = range(self._g.static_chunks, self._g.chunk_count)
        memory.draw(self._g, maps, world, vertices, moving, self._device)
        return maps, memory

    def give_back(self, memory: MapMemory) -> None:
        """Keep memory for reuse by later frames."""
        if len(self._spare) < _POOL_SIZE:
            self._spare.append(memory)

    def static_maps(self, slots: LampSlots) -> list[StaticLampMap]:
        """Return the static-scene maps of a frame's lamps of the town, by slot."""
        found = []
        for slot in range(STATIC_SLOTS):
            used = float(slots.weights[slot]) > 0.0
            found.append(self._static_map(slots, slot) if used else self._no_static)
        return found

    def _static_map(self, slots: LampSlots, slot: int) -> StaticLampMap:
        light = int(slots.lights[slot])
        if light not in self._static:
            if len(self._static) >= _STATIC_CACHE_SIZE:
                self._static.popitem(last=False)
            self._static[light] = self._draw_static([column[slot : slot + 1] for column in slots.columns])
        self._static.move_to_end(light)
        return self._static[light]

    def _draw_static(self, columns: Sequence[Array]) -> StaticLampMap:
        device, memory = self._device, MapMemory(1, self._device)
        own = uploaded(columns, MAP_KINDS, device)
        maps = struct_array([maps_of(own, struct_array([self._no_static], device), memory)], device)
        world = upload_transforms(world_from_parts(np.zeros((0, 3, 4))), device)
        memory.draw(self._g, maps, world, self._g.vertices, range(self._g.static_chunks), device)
        return memory.as_static()


def maps_of(columns: Sequence[DeviceArray], static: DeviceArray, memory: MapMemory) -> LampMaps:
    """Return the struct of some maps.

    Args:
        columns: The fields `MAP_NAMES`, on the device.
        static: The static maps, an array of `StaticLampMap` by slot.
        memory: The moving maps.
    """
    named = dict(zip(MAP_NAMES, columns, strict=True))
    bounds = {"nearest": memory.nearest, "farthest": memory.farthest}
    return set_fields(LampMaps(), **named, fixed=static, keys=memory.keys, **bounds)


def no_maps(device: str) -> DeviceArray:
    """Return placeholder maps for a scene without lamps, a one-element array of `LampMaps`."""
    columns = [wp.zeros(1, dtype=kind, device=device) for kind in MAP_KINDS]
    keys, nearest = (wp.zeros((1, 1), dtype=wp.uint64, device=device) for _ in range(2))
    empty = set_fields(StaticLampMap(), keys=keys, nearest=nearest, farthest=nearest)
    named = dict(zip(MAP_NAMES, columns, strict=True))
    bounds = {"nearest": nearest, "farthest": nearest}
    maps = set_fields(LampMaps(), **named, fixed=struct_array([empty], device), keys=keys, **bounds)
    return struct_array([maps], device)


def uploaded(columns: Sequence[Array], kinds: Sequence[Any], device: str) -> list[DeviceArray]:
    """Return columns of numbers on a device, as float32; kinds are scalar or vector types of it."""
    rows = ((np.ascontiguousarray(c).astype(np.float32), kind) for c, kind in zip(columns, kinds, strict=True))
    return [wp.array(values, dtype=kind, device=device) for values, kind in rows]
