"""Shadow maps, host side: of the static scene once for a sun direction, of moving objects every frame."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array, zeros
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster.passes import transform_vertices
from recipe_runtime.render.scene.camera import upload_transforms, world_from_parts
from recipe_runtime.render.scene.chunking import CHUNK
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.shadows import shadow_kernels
from recipe_runtime.render.shadows.shadow_kernels import TILE, Sunbeam

_STATIC_MAPS = ((3072, 0.03, 32.0), (2048, 0.2, 128.0))  # texels, metres a texel, metres between centres
_MOVING_SIZE = 1024
_MOVING_TEXELS = (0.022, 0.09)  # metres: about 22 m across, and 92 m
_STATIC_CACHE_SIZE = 6  # static maps kept of each kind
_MAP_POOL_SIZE = 8  # moving maps, 4 MB each
_DEPTH = 1200.0  # metres along the sun's rays between nearness 0 and 1


class ShadowMaps:
    """The shadow maps of one scene."""

    def __init__(self, geometry: Geometry, device: str) -> None:
        self._g, self._device = geometry, device
        self._keys: dict[int, DeviceArray] = {}  # by a map's size
        self._static: list[OrderedDict[tuple[bytes, int, int], Sunbeam]] = [OrderedDict() for _ in _STATIC_MAPS]
        self._spare: list[ShadowMap] = []  # maps that no observation uses

    def static(self, sun: NDArray[np.float64], eye: Array) -> tuple[Sunbeam, Sunbeam]:
        """Return the fine and the coarse map of the static scene around the eye, for a sun above the horizon.

        Their centres lie on a world-space grid, so a moving camera rarely needs another map.
        """
        fine, coarse = (self._static_map(kind, sun, eye) for kind in range(len(_STATIC_MAPS)))
        return fine, coarse

    def _static_map(self, kind: int, sun: NDArray[np.float64], eye: Array) -> Sunbeam:
        size, texel, grid = _STATIC_MAPS[kind]
        cell = int(np.floor(eye[0] / grid + 0.5)), int(np.floor(eye[1] / grid + 0.5))
        held, name = self._static[kind], (sun.tobytes(), *cell)
        if name not in held:
            if len(held) >= _STATIC_CACHE_SIZE:
                held.popitem(last=False)
            centre = np.array([cell[0] * grid, cell[1] * grid, 0.0])
            beam = _beam_about(sun, centre, texel, size)
            world = upload_transforms(world_from_parts(np.zeros((0, 3, 4))), self._device)
            held[name] = self._draw(beam, self._g.vertices, world, 0, self._g.static_chunks)
        held.move_to_end(name)
        return held[name]

    def none(self) -> Sunbeam:
        """Return a map without shadows."""
        depths = wp.zeros(1, dtype=wp.float32, device=self._device)
        bounds = wp.zeros(1, dtype=wp.vec2f, device=self._device)
        return set_fields(Sunbeam(), size=0, depth=1.0, depths=depths, bounds=bounds)

    def moving(
        self, sun: NDArray[np.float64], vertices: DeviceArray, world: DeviceArray, eye: Array, ahead: Array
    ) -> list[ShadowMap]:
        """Return the fine and the coarse map of the moving parts, whose `vertices` `world` transforms to the world."""
        first = self._g.static_chunks
        count = self._g.chunk_count - first
        maps = [self._moving_map(beam) for beam in moving_beams(sun, eye, ahead)]
        for shadow_map in maps:
            shadow_map.draw(struct_array([shadow_map.beam], self._device), vertices, world, first, count)
        return maps

    def give_back(self, maps: list[ShadowMap]) -> None:
        """Keep moving maps for reuse by later frames."""
        for shadow_map in maps:
            if len(self._spare) < _MAP_POOL_SIZE:
                self._spare.append(shadow_map)

    def _moving_map(self, beam: Sunbeam) -> ShadowMap:
        """Return a moving map: an unused one or, if there is none, a new one."""
        if not self._spare:
            return ShadowMap(beam, self._g, self._device, self._cleared(int(beam.size)))
        shadow_map = self._spare.pop()
        shadow_map.assign(beam)
        return shadow_map

    def _cleared(self, size: int) -> DeviceArray:
        """Return a map of keys, all 0, as `resolve_depths` leaves it."""
        if size not in self._keys:
            self._keys[size] = zeros(size * size, wp.uint64, self._device)
        return self._keys[size]

    def _draw(self, beam: Sunbeam, vertices: DeviceArray, world: DeviceArray, first: int, count: int) -> Sunbeam:
        ShadowMap(beam, self._g, self._device, self._cleared(int(beam.size))).draw(
            struct_array([beam], self._device), vertices, world, first, count
        )
        return beam


class ShadowMap:
    """The memory of a shadow map; `beam` refers to it."""

    def __init__(self, beam: Sunbeam, geometry: Geometry, device: str, keys: DeviceArray) -> None:
        self.beam, self._g, self._device = beam, geometry, device
        size = int(beam.size)
        tiles = (size // int(TILE)) * (size // int(TILE))
        self._keys = keys  # all 0, as `resolve_depths` leaves them
        self._used, self._before = (wp.zeros(tiles, dtype=wp.int32, device=device) for _ in range(2))
        self._seen = wp.empty(max(geometry.chunk_count, 1), dtype=wp.int32, device=device)
        beam.depths = zeros(size * size, wp.float32, device)
        beam.bounds = wp.empty(tiles, dtype=wp.vec2f, device=device)

    def assign(self, beam: Sunbeam) -> None:
        """Use the map for another beam of the same size; the next drawing clears the earlier content."""
        beam.depths, beam.bounds = self.beam.depths, self.beam.bounds
        self.beam, self._used, self._before = beam, self._before, self._used
        self._used.zero_()

    def clear(self) -> None:
        """Clear the map."""
        arrays: tuple[DeviceArray, ...] = self._used, self._before, self.beam.depths
        for array in arrays:
            array.zero_()

    def draw(self, beam: DeviceArray, vertices: DeviceArray, world: DeviceArray, first: int, count: int) -> None:
        """Draw chunks into an empty map, or over what was there before an `assign`.

        `beam` is `self.beam` as a one-element array.
        """
        g, size = self._g, int(self.beam.size)
        pinhole = set_fields(Pinhole(), near=1.0, far=1.0e9, width=size, height=size, rows=1)
        if count:
            chunks = {"chunks": g.chunks, "beams": beam, "first_chunk": first}
            launch(
                shadow_kernels.cull_casters,
                count,
                self._device,
                **fields_of(g, "chunk_centres", "chunk_halves"),
                transforms=world,
                out_visible=self._seen,
                **chunks,
            )
            launch(
                shadow_kernels.raster_casters,
                count * CHUNK,
                self._device,
                vertices=vertices,
                triangles=g.triangles,
                chunk_visible=self._seen,
                casts=g.casts,
                pinhole=pinhole,
                out_keys=self._keys,
                out_used=self._used,
                **chunks,
            )
        tiles, depths = self._used.size, self.beam.depths
        rows = int(TILE) if self._device == "cpu" else 1  # a GPU has threads to spare
        launch(
            shadow_kernels.resolve_depths,
            tiles * (int(TILE) // rows),
            self._device,
            keys=self._keys,
            used=self._used,
            used_before=self._before,
            size=size,
            rows_per_thread=rows,
            out_depths=depths,
        )
        bounds = self.beam.bounds
        launch(
            shadow_kernels.bound_depths,
            tiles,
            self._device,
            depths=depths,
            used=self._used,
            size=size,
            out_bounds=bounds,
        )


def moving_beams(sun: NDArray[np.float64], eye: Array, ahead: Array) -> list[Any]:
    """Return the frames of the fine and the coarse map of moving objects around a camera."""
    places = [(texel, eye + ahead * (texel * _MOVING_SIZE * 0.42)) for texel in _MOVING_TEXELS]
    return [_beam_about(sun, centre, texel, _MOVING_SIZE) for texel, centre in places]


def world_vertices(geometry: Geometry, world_from_part: DeviceArray, device: str) -> DeviceArray:
    """Return the moving vertices in world space; static vertices are already there, and are left unset."""
    out = wp.empty(geometry.vertex_count, dtype=wp.vec3f, device=device)
    transform_vertices(geometry, world_from_part, geometry.static_vertices, out, device)
    return out


def _axes(sun: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return unit vectors across the rays (horizontal), across them (upward), and towards the sun."""
    flat = float(np.sqrt(sun[0] * sun[0] + sun[1] * sun[1]))
    u = np.array([-sun[1] / flat, sun[0] / flat, 0.0]) if flat > 1e-6 else np.array([1.0, 0.0, 0.0])
    v = np.array([sun[1] * u[2] - sun[2] * u[1], sun[2] * u[0] - sun[0] * u[2], sun[0] * u[1] - sun[1] * u[0]])
    return [u, v, sun]


def _along(axis: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    product: NDArray[np.float64] = points[:, 0] * axis[0] + points[:, 1] * axis[1] + points[:, 2] * axis[2]
    return product


def _beam_about(sun: NDArray[np.float64], centre: Array, texel: float, size: int) -> Sunbeam:
    """Return the frame of a map around a point; offsets are whole texels, so the grid is fixed in the world."""
    axes = _axes(sun)
    at = [float(_along(axis, centre[None])[0]) for axis in axes]
    scale = (1.0 / texel, 1.0 / texel, 1.0 / _DEPTH)
    offset = (size / 2.0 - float(np.floor(at[0] / texel)), size / 2.0 - float(np.floor(at[1] / texel)))
    rows = zip(axes, scale, (*offset, 0.5 - at[2] / _DEPTH), strict=True)
    u, v, q = (wp.vec4f(float(a[0]) * s, float(a[1]) * s, float(a[2]) * s, o) for a, s, o in rows)
    return set_fields(Sunbeam(), u=u, v=v, q=q, size=size, texel=texel, depth=_DEPTH)
