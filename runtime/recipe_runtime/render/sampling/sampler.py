"""The samples of a frame: counted, emitted and evaluated.

All appearances of a frame share them. A static camera keeps the samples of the static scene, and their light, from
frame to frame; each frame appends samples where moving objects are visible. What is cached depends on the pose only, so
it changes no byte.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core.timings import Timings
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array, struct_of
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster import label_kernels
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.raster.observer import Observer, all_tiles
from recipe_runtime.render.raster.triangles import ROWS
from recipe_runtime.render.sampling import passes
from recipe_runtime.render.sampling.buffers import SampleColumns, samples_of, scene_arrays
from recipe_runtime.render.sampling.sample_kernels import Samples, StaticSamples, restore_keys
from recipe_runtime.render.sampling.tile_kernels import bound_tiles
from recipe_runtime.render.scene.camera import pinhole_of, upload_transforms, world_from_parts, world_from_view
from recipe_runtime.render.scene.geometry import Geometry

_POSE_CACHE_SIZE = 4  # 90 MB each at 800 x 600
_SAMPLE_CACHE_SIZE = 16_000_000  # samples of all poses except the last; supersampled pictures have many
_MIN_CAPACITY = 1 << 16  # samples


@dataclass(eq=False)
class FrameSamples:
    """The samples of a frame, with the index of each pixel's first sample."""

    data: Samples
    groups: DeviceArray  # int32 [H * W], count in the low bits
    starts: DeviceArray  # int32 [H * W]
    weights: DeviceArray  # float32 [N]
    count: int
    base: StaticBase | None  # the shared samples, which come first; None at the first frame from a pose


@dataclass(eq=False)
class StaticBase:
    """The samples that all frames from one pose share. The arrays are modified in place for one frame at a time."""

    still: StaticSamples
    fine: DeviceArray  # uint64 [ROWS * H * W], keys of the current frame
    groups: DeviceArray
    starts: DeviceArray
    columns: SampleColumns
    count: int  # samples of the static scene
    firsts: DeviceArray  # int32 [tiles + 1], each tile's first sample, then their count
    boxes: tuple[
        DeviceArray, DeviceArray
    ]  # vec3f by tile, low and high corners of the world-space boxes of the samples
    tenant: FrameSamples | None = None
    touched: NDArray[np.int32] = field(
        default_factory=lambda: np.zeros(0, np.int32)
    )  # tiles of the current frame with moving objects
    lights: dict[str, Any] = field(default_factory=dict)  # `SampleLight` by appearance and sensor


class Sampler:
    """Creates the samples of one scene's observations."""

    def __init__(
        self, geometry: Geometry, observer: Observer, device: str, timings: Timings, reuse: TemporalReuse
    ) -> None:
        self._g, self._observer, self._device, self._timings = geometry, observer, device, timings
        self._reuse = reuse.samples
        # Memory of frames without a base, used again because the system takes long to provide new memory:
        self._fine: DeviceArray | None = None
        self._columns: SampleColumns | None = None
        self._tenant: FrameSamples | None = None  # the frame whose samples are there
        self._samples: WeakKeyDictionary[Observation, dict[bool, FrameSamples]] = WeakKeyDictionary()
        self._bases: OrderedDict[tuple[bytes, bool], StaticBase | None] = OrderedDict()  # None: observed once

    def points(self, obs: Observation, antialias: bool) -> FrameSamples:
        """Return a frame's samples; they are valid until another frame's are requested."""
        known = self._samples.setdefault(obs, {})
        found = known.get(antialias)
        if found is None or found is not (self._tenant if found.base is None else found.base.tenant):
            base = self._base(obs, antialias)
            found = known[antialias] = (
                self._without_base(obs, antialias) if base is None else self._with_base(base, obs, antialias)
            )
        return found

    def frame(self, obs: Observation) -> tuple[DeviceArray, DeviceArray]:
        """Return the geometry of a frame, and its transforms and its eye without samples.

        These are one-element arrays of `SceneArrays` and `Samples`.
        """
        scene = self._scene(obs)
        return scene, struct_array([_with_view(Samples(), obs, scene)], self._device)

    def _base(self, obs: Observation, antialias: bool) -> StaticBase | None:
        """Return what is cached for a pose; None at the first frame from it."""
        if not self._reuse:
            return None
        name = obs.pose, antialias
        known, base = name in self._bases, self._bases.pop(name, None)
        if known and base is None:
            base = self._static_samples(obs, antialias, _MIN_CAPACITY)
        self._bases[name] = base
        while len(self._bases) > _POSE_CACHE_SIZE or (
            len(self._bases) > 1 and self._cached_samples() > _SAMPLE_CACHE_SIZE
        ):
            self._bases.popitem(last=False)
        return base

    def _cached_samples(self) -> int:
        return sum(base.columns.capacity for base in self._bases.values() if base is not None)

    def _without_base(self, obs: Observation, antialias: bool) -> FrameSamples:
        fine = obs.keys
        if antialias:
            fine = self._fine = self._observer.visibility(
                obs.camera, obs.vertices, obs.seen, rows=int(ROWS), out=self._fine
            )
        scene, groups, starts = self._scene(obs), self._pixels(obs), self._pixels(obs)
        columns, count = self._emit(obs, scene, antialias, obs.keys, fine, groups, starts)
        self._evaluate(obs, scene, columns, 0, count)
        made = FrameSamples(_data(obs, columns, scene), groups, starts, columns.weights, count, None)
        self._columns, self._tenant = columns, made
        return made

    def _static_samples(self, obs: Observation, antialias: bool, room: int) -> StaticBase:
        """Return the samples of the static scene."""
        scene, still = self._scene(obs), StaticSamples()
        still.coarse = self._observer.visibility(obs.camera, obs.vertices, obs.seen, rows=1, still=True)
        still.fine = still.coarse
        if antialias:
            still.fine = self._observer.visibility(obs.camera, obs.vertices, obs.seen, rows=int(ROWS), still=True)
        still.groups, still.starts = self._pixels(obs), self._pixels(obs)
        columns, count = self._emit(
            obs, scene, antialias, still.coarse, still.fine, still.groups, still.starts, room=room
        )
        self._evaluate(obs, scene, columns, 0, count)
        set_fields(still, available=1)
        fine, groups, starts = (wp.clone(a) for a in (still.fine, still.groups, still.starts))
        tiles = columns.tiles.numpy()[:count]
        firsts = self._tiles(np.searchsorted(tiles, np.arange(len(all_tiles(obs.camera)) + 1)).astype(np.int32))
        boxes = self._boxes(obs, still.starts, columns, count)
        return StaticBase(still, fine, groups, starts, columns, count, firsts, boxes)

    def _boxes(
        self, obs: Observation, starts: DeviceArray, columns: SampleColumns, count: int
    ) -> tuple[DeviceArray, DeviceArray]:
        """Return the world-space boxes of each tile's samples except the sky's."""
        tiles = self._tiles(all_tiles(obs.camera))
        lows, highs = (wp.empty(tiles.size, dtype=wp.vec3f, device=self._device) for _ in range(2))
        launch(
            bound_tiles,
            tiles.size,
            self._device,
            tile_corners=tiles,
            pinhole=pinhole_of(obs.camera, 1),
            starts=starts,
            sample_count=count,
            **fields_of(columns, "surfaces", "positions"),
            out_lows=lows,
            out_highs=highs,
        )
        return lows, highs

    def _with_base(self, base: StaticBase, obs: Observation, antialias: bool) -> FrameSamples:
        """Return a frame's samples: those of the base, and new ones where moving objects are visible."""
        scene = self._scene(obs)
        if antialias:
            with self._timings("restore samples"):
                launch(
                    restore_keys,
                    len(base.touched) * int(label_kernels.TILE_PIXELS),
                    self._device,
                    tile_corners=self._tiles(base.touched),
                    static_keys=base.still.fine,
                    pinhole=pinhole_of(obs.camera, 1),
                    out_fine=base.fine,
                )
            self._observer.draw_moving(obs.camera, obs.vertices, obs.seen, int(ROWS), base.fine)
        fine = base.fine if antialias else obs.keys
        columns, count = self._emit(obs, scene, antialias, obs.keys, fine, base.groups, base.starts, base=base)
        self._evaluate(obs, scene, columns, base.count, count - base.count)
        points = FrameSamples(_data(obs, columns, scene), base.groups, base.starts, columns.weights, count, base)
        base.tenant, base.touched = points, obs.touched
        return points

    def _emit(
        self,
        obs: Observation,
        scene: DeviceArray,
        antialias: bool,
        coarse: DeviceArray,
        fine: DeviceArray,
        groups: DeviceArray,
        starts: DeviceArray,
        room: int = 0,
        base: StaticBase | None = None,
    ) -> tuple[SampleColumns, int]:
        """Emit samples, with a base those of the tiles in which objects move or moved, without one all.

        Returns:
            Their columns, with spare capacity, and the count of all samples.
        """
        rows, camera, first = int(ROWS) if antialias else 1, obs.camera, 0 if base is None else base.count
        tiles = all_tiles(camera) if base is None else np.union1d(base.touched, obs.touched).astype(np.int32)
        corners, size = self._tiles(tiles), len(tiles) * int(label_kernels.TILE_PIXELS)
        still = struct_array([StaticSamples() if base is None else base.still], self._device)
        counts = wp.empty(size, dtype=wp.int32, device=self._device)
        with self._timings("group samples"):
            passes.count_samples(
                corners, coarse, fine, camera, rows, scene, still, groups, starts, counts, self._device
            )
            found = counts.numpy()
            ends = np.cumsum(found, dtype=np.int32) + np.int32(first)
            count = int(ends[-1]) if size else first
        with self._timings("emit samples"):
            columns = self._new_columns(count, room) if base is None else self._with_capacity(base, count)
            if count > first:
                firsts: wp.array[wp.int32] = wp.array(ends - found, dtype=wp.int32, device=self._device)
                passes.emit_samples(
                    corners, coarse, fine, counts, firsts, camera, rows, scene, groups, starts, columns, self._device
                )
        return columns, count

    def _new_columns(self, count: int, room: int) -> SampleColumns:
        """Return columns of a base, with room for more samples, or, without room, of a frame without a base."""
        if room == 0 and self._columns is not None and count <= self._columns.capacity < 2 * count:
            return self._columns
        return SampleColumns(count + (room or count // 8), self._device)

    def _with_capacity(self, base: StaticBase, count: int) -> SampleColumns:
        """Return the base's columns, enlarged if needed to hold `count` samples."""
        if base.columns.capacity < count:
            capacity = count + (count - base.count)
            base.columns, base.lights = base.columns.grown(capacity, base.count, self._device), {}
        return base.columns

    def _evaluate(self, obs: Observation, scene: DeviceArray, columns: SampleColumns, first: int, count: int) -> None:
        """Evaluate samples from `first` on."""
        with self._timings("evaluate samples"):
            passes.evaluate_samples(first, count, obs.camera, scene, columns, self._device)

    def _scene(self, obs: Observation) -> DeviceArray:
        """Return the geometry of a frame, a one-element array of `SceneArrays`."""
        world_from_part = upload_transforms(world_from_parts(obs.parts), self._device)
        here = upload_transforms(world_from_view(obs.world_from_sensor), self._device)
        return struct_array([scene_arrays(self._g, obs.vertices, world_from_part, here)], self._device)

    def _pixels(self, obs: Observation) -> DeviceArray:
        return wp.empty(obs.camera.width * obs.camera.height, dtype=wp.int32, device=self._device)

    def _tiles(self, tiles: NDArray[np.int32]) -> DeviceArray:
        return wp.array(tiles, dtype=wp.int32, device=self._device)


def _data(obs: Observation, columns: SampleColumns, scene: DeviceArray) -> Samples:
    """Return a frame's samples as the struct that shading reads; `scene` is a one-element array of `SceneArrays`."""
    return _with_view(samples_of(columns), obs, scene)


def _with_view(data: Samples, obs: Observation, scene: DeviceArray) -> Samples:
    """Set the transforms, the focal length and the eye of a frame's samples, in place."""
    here, focal = struct_of(scene), pinhole_of(obs.camera, 1).focal
    set_fields(data, world_from_part=here.world_from_part, world_from_view=here.world_from_view, focal=focal)
    data.eye = wp.vec3f(*(float(v) for v in obs.world_from_sensor[:, 3]))
    return data
