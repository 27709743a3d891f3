"""The samples of a frame: counted, emitted and evaluated.

All appearances of a frame share them. A camera at rest keeps the samples of the static scene, and the light on them,
from frame to frame; a frame adds samples of its own after those, where something moving is seen. What is kept depends
on the pose alone, and so changes no byte.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core.timings import Timings
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster import label_kernels
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.raster.observer import Observer, all_tiles
from recipe_runtime.render.sampling import passes
from recipe_runtime.render.sampling.buffers import SampleColumns, samples_of, scene_arrays
from recipe_runtime.render.sampling.sample_kernels import Samples, StaticSamples
from recipe_runtime.render.scene.camera import upload_transforms, world_from_parts, world_from_view
from recipe_runtime.render.scene.geometry import Geometry

_POSE_CACHE_SIZE = 4  # 90 MB each at 800 x 600
_SAMPLE_CACHE_SIZE = 16_000_000  # of all of them, but for the last: a supersampled picture has many
_MIN_CAPACITY = 1 << 16  # samples


@dataclass(eq=False)
class FrameSamples:
    """The samples of a frame: what each sees, and which pixel it belongs to."""

    data: Samples
    groups: DeviceArray  # int32 [H * W], count in the low bits
    starts: DeviceArray  # int32 [H * W]
    weights: DeviceArray  # float32 [N]
    count: int
    base: StaticBase | None  # that keeps the first of them; None for a pose that was not seen before


@dataclass(eq=False)
class StaticBase:
    """What a pose's frames share. Its arrays are worked on in place: they serve one frame, the tenant, at a time."""

    still: StaticSamples
    fine: DeviceArray  # uint64 [4 H * W], the tenant's
    groups: DeviceArray
    starts: DeviceArray
    columns: SampleColumns
    count: int  # samples of the static scene
    firsts: DeviceArray  # int32, each tile's first sample, and at last their count
    boxes: tuple[
        DeviceArray, DeviceArray
    ]  # vec3f by tile, the low and the high corners of the world's boxes about them
    tenant: FrameSamples | None = None
    touched: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))  # the tenant's tiles
    lights: dict[str, Any] = field(default_factory=dict)  # the picture's, by appearance


class Sampler:
    """Makes the samples of one scene's observations."""

    def __init__(
        self, geometry: Geometry, observer: Observer, device: str, timings: Timings, reuse: TemporalReuse
    ) -> None:
        self._g, self._observer, self._device, self._timings = geometry, observer, device, timings
        self._reuse = reuse.samples
        self._samples: WeakKeyDictionary[Observation, dict[bool, FrameSamples]] = WeakKeyDictionary()
        self._bases: OrderedDict[tuple[bytes, bool], StaticBase | None] = OrderedDict()  # None: seen once

    def points(self, obs: Observation, antialias: bool) -> FrameSamples:
        """A frame's samples; they are valid until another frame's are requested."""
        known = self._samples.setdefault(obs, {})
        found = known.get(antialias)
        if found is None or (found.base is not None and found.base.tenant is not found):
            base = self._base(obs, antialias)
            found = known[antialias] = self._fresh(obs, antialias) if base is None else self._upon(base, obs, antialias)
        return found

    def _base(self, obs: Observation, antialias: bool) -> StaticBase | None:
        """What is kept of a pose; None if it was not seen before."""
        if not self._reuse:
            return None
        name = obs.pose, antialias
        known, base = name in self._bases, self._bases.pop(name, None)
        if known and base is None:
            base = self._still(obs, antialias, _MIN_CAPACITY)
        self._bases[name] = base
        while len(self._bases) > _POSE_CACHE_SIZE or (len(self._bases) > 1 and self._kept() > _SAMPLE_CACHE_SIZE):
            self._bases.popitem(last=False)
        return base

    def _kept(self) -> int:
        return sum(base.columns.capacity for base in self._bases.values() if base is not None)

    def _fresh(self, obs: Observation, antialias: bool) -> FrameSamples:
        fine = self._observer.visibility(obs.camera, obs.vertices, obs.seen, side=2) if antialias else obs.keys
        scene, groups, starts = self._scene(obs), self._pixels(obs), self._pixels(obs)
        inputs = obs.keys, fine, struct_array([StaticSamples()], self._device), groups, starts
        columns, count = self._placed(obs, scene, antialias, all_tiles(obs.camera), *inputs)
        self._survey(obs, scene, columns, 0, count)
        return FrameSamples(_data(obs, columns), groups, starts, columns.weights, count, None)

    def _still(self, obs: Observation, antialias: bool, room: int) -> StaticBase:
        """The samples of the static scene."""
        scene, still = self._scene(obs), StaticSamples()
        still.coarse = self._observer.visibility(obs.camera, obs.vertices, obs.seen, side=1, still=True)
        still.fine = still.coarse
        if antialias:
            still.fine = self._observer.visibility(obs.camera, obs.vertices, obs.seen, side=2, still=True)
        still.groups, still.starts = self._pixels(obs), self._pixels(obs)
        inputs = (
            still.coarse,
            still.fine,
            struct_array([StaticSamples()], self._device),
            still.groups,
            still.starts,
        )
        columns, count = self._placed(obs, scene, antialias, all_tiles(obs.camera), *inputs, room=room)
        self._survey(obs, scene, columns, 0, count)
        set_fields(still, known=1)
        fine, groups, starts = (wp.clone(a) for a in (still.fine, still.groups, still.starts))
        tiles = columns.tiles.numpy()[:count]
        firsts = self._tiles(np.searchsorted(tiles, np.arange(len(all_tiles(obs.camera)) + 1)).astype(np.int32))
        boxes = self._boxes(obs, still.starts, columns, count)
        return StaticBase(still, fine, groups, starts, columns, count, firsts, boxes)

    def _boxes(
        self, obs: Observation, starts: DeviceArray, columns: SampleColumns, count: int
    ) -> tuple[DeviceArray, DeviceArray]:
        """The world's boxes about the samples of every tile."""
        tiles = self._tiles(all_tiles(obs.camera))
        lows, highs = (wp.empty(tiles.size, dtype=wp.vec3f, device=self._device) for _ in range(2))
        passes.bound_tiles(tiles, obs.camera, starts, count, columns, lows, highs, self._device)
        return lows, highs

    def _upon(self, base: StaticBase, obs: Observation, antialias: bool) -> FrameSamples:
        """A frame's samples: those of the base, and its own where something moving is seen."""
        scene, before = self._scene(obs), base.touched
        if antialias:
            with self._timings("restore"):
                passes.restore_keys(self._tiles(before), base.still.fine, obs.camera, base.fine, self._device)
            self._observer.draw_moving(obs.camera, obs.vertices, obs.seen, 2, base.fine)
        fine = base.fine if antialias else obs.keys
        tiles = np.union1d(before, obs.touched).astype(np.int32)
        arrays = obs.keys, fine, struct_array([base.still], self._device), base.groups, base.starts
        columns, count = self._placed(obs, scene, antialias, tiles, *arrays, base=base)
        self._survey(obs, scene, columns, base.count, count - base.count)
        points = FrameSamples(_data(obs, columns), base.groups, base.starts, columns.weights, count, base)
        base.tenant, base.touched = points, obs.touched
        return points

    def _placed(
        self,
        obs: Observation,
        scene: DeviceArray,
        antialias: bool,
        tiles: NDArray[np.int32],
        coarse: DeviceArray,
        fine: DeviceArray,
        still: DeviceArray,
        groups: DeviceArray,
        starts: DeviceArray,
        room: int = 0,
        base: StaticBase | None = None,
    ) -> tuple[SampleColumns, int]:
        """Where the samples of the tiles are, with some room to spare; and the count of all samples."""
        corners, side, camera = self._tiles(tiles), 2 if antialias else 1, obs.camera
        size = len(tiles) * int(label_kernels.TILE_PIXELS)
        first = 0 if base is None else base.count
        counts = wp.empty(size, dtype=wp.int32, device=self._device)
        with self._timings("group"):
            outputs = groups, starts, counts
            passes.count_samples(corners, coarse, fine, camera, side, scene, still, *outputs, self._device)
            found = counts.numpy()
            ends = np.cumsum(found, dtype=np.int32) + np.int32(first)
            count = int(ends[-1]) if size else first
        with self._timings("place"):
            columns = SampleColumns(count + room, self._device) if base is None else self._roomy(base, count)
            if count > first:
                firsts: wp.array[wp.int32] = wp.array(ends - found, dtype=wp.int32, device=self._device)
                keys, pixels = (corners, coarse, fine), (groups, starts)
                passes.emit_samples(*keys, counts, firsts, camera, side, scene, *pixels, columns, self._device)
        return columns, count

    def _roomy(self, base: StaticBase, count: int) -> SampleColumns:
        """The base's columns, after they have grown, if need be, to hold so many samples."""
        if base.columns.capacity < count:
            capacity = count + (count - base.count)
            base.columns, base.lights = base.columns.grown(capacity, base.count, self._device), {}
        return base.columns

    def _survey(self, obs: Observation, scene: DeviceArray, columns: SampleColumns, first: int, count: int) -> None:
        """Evaluate the samples first.. ."""
        with self._timings("survey"):
            passes.evaluate_samples(first, count, obs.camera, scene, columns, self._device)

    def _scene(self, obs: Observation) -> DeviceArray:
        """The geometry as a frame has it, a one-element array of `SceneArrays`."""
        world_from_part = upload_transforms(world_from_parts(obs.parts), self._device)
        here = upload_transforms(world_from_view(obs.world_from_sensor), self._device)
        return struct_array([scene_arrays(self._g, obs.vertices, world_from_part, here)], self._device)

    def _pixels(self, obs: Observation) -> DeviceArray:
        return wp.empty(obs.camera.width * obs.camera.height, dtype=wp.int32, device=self._device)

    def _tiles(self, tiles: NDArray[np.int32]) -> DeviceArray:
        return wp.array(tiles, dtype=wp.int32, device=self._device)


def _data(obs: Observation, columns: SampleColumns) -> Samples:
    """What a frame's samples see, as shading wants it."""
    data = samples_of(columns)
    data.eye = wp.vec3f(*(float(v) for v in obs.world_from_sensor[:, 3]))
    return data
