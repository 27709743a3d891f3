"""Geometry on the device: the triangles of all bodies, uploaded once, static bodies first.

Visibility, shadow maps and samples index these arrays by triangle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.mesh import Body, Light, Mesh, Pattern
from recipe_runtime.meshes.skin import split_parts
from recipe_runtime.render.device.arrays import DeviceArray, struct_array
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.chunking import chunks_of, in_order, level_casts, level_range
from recipe_runtime.render.scene.level_range import LevelRange

# Flat ground casts no shadow; without it in the shadow maps, rounding cannot make it shadow itself.
_GROUND_TAGS = frozenset({Tag.ROADS, Tag.SIDEWALKS, Tag.TERRAIN, Tag.WATER, Tag.ROAD_LINES, Tag.GROUND})
_VEHICLE_LAMPS = frozenset(
    {Pattern.HEADLIGHT, Pattern.TAILLIGHT, Pattern.BRAKELIGHT, Pattern.INDICATOR, Pattern.REVERSELIGHT}
)
MAX_TRIANGLES = 1 << 24  # a visibility key has 24 bits for the triangle


@dataclass(frozen=True)
class SurfaceKey:
    """One surface of one body: the slot of its colour, and its labels."""

    body: str
    slot: str
    pattern: Pattern
    tag: int
    instance: int
    actor: int  # index among the actors, -1 for the town


@dataclass(frozen=True)
class MountedLight:
    """A light and the part that it is mounted on: 0 is the world, 1 + p part p of the Trace."""

    part: int
    light: Light


@dataclass(frozen=True)
class Actor:
    """A moving body: its first part, and the number and the names of its parts."""

    name: str
    instance: int
    first_part: int  # into the Trace's parts
    parts: int
    part_names: tuple[str, ...]


@dataclass(frozen=True)
class Geometry:
    """V vertices in their part's frame, T triangles, S surfaces. Part 0 is the world, part 1 + p the Trace's p.

    Vertices of a skin are in the frame of its actor's base part at rest.
    """

    vertices: DeviceArray  # vec3f [V], metres
    normals: DeviceArray  # vec3f [V]
    uvs: DeviceArray  # vec2f [V]
    vertex_part: DeviceArray  # int32 [V]
    part_extent: DeviceArray  # int32 [1 + P], the row of each part's body in a table of extents; -1 for the world
    triangles: DeviceArray  # vec3i [T]
    face_normals: DeviceArray  # vec3f [T], in the part's frame
    triangle_surface: DeviceArray  # int32 [T]
    vertex_skin: DeviceArray  # int32 [V], row of `skin_parts`; -1 for a vertex that follows its part rigidly
    skin_parts: DeviceArray  # vec4i [N], the parts that a vertex of a skin follows; its vertex_part is the first
    skin_weights: DeviceArray  # vec4f [N], in 255ths, of sum 255
    part_origins: DeviceArray  # vec3f [1 + P], in the rest pose of a skin, in the frame of its vertices; else 0
    casts: DeviceArray  # int32 [T], 1 if it casts a shadow
    chunks: DeviceArray  # vec3i [C], first triangle, count up to CHUNK, part
    chunk_centres: DeviceArray  # vec3f [C], of the chunk's box in the part's frame
    chunk_halves: DeviceArray  # vec3f [C], half its size
    chunk_vertices: DeviceArray  # vec2i [C], range of vertices that contains the chunk's, and perhaps others
    chunk_level: DeviceArray  # int32 [C], index into `levels`; -1 if the chunk is shown at all distances
    levels: DeviceArray  # LevelRange [at least 1]
    surface_actor: DeviceArray  # int32 [S]
    surface_instance: DeviceArray  # int32 [S]
    surface_tag: DeviceArray  # int32 [S]
    surface_pattern: DeviceArray  # int32 [S]
    surfaces: tuple[SurfaceKey, ...]
    actors: tuple[Actor, ...]
    part_bounds: NDArray[np.float64]  # [P, 2, 3], each moving part's box in its own frame
    lights: tuple[MountedLight, ...]
    bounds: NDArray[np.float64]  # [2, 3], the static geometry's box in the world
    extent_rows: int  # moving bodies: the actors, then the traffic lights
    static_vertices: int
    static_chunks: int
    chunk_count: int
    vertex_count: int
    triangle_count: int

    @property
    def parts(self) -> int:
        """Number of moving parts."""
        return len(self.part_bounds)

    @cached_property
    def light_rows(self) -> NDArray[np.float64]:
        """Position and direction on the part, colour, candela and cosine of the cone of every light, [L, 11]."""
        all_lights = [mounted.light for mounted in self.lights]
        rows = [[*li.position, *li.direction, *li.colour, li.intensity, li.cone] for li in all_lights]
        return np.array(rows, np.float64).reshape(-1, 11)

    @cached_property
    def lamp_surfaces(self) -> NDArray[np.int64]:
        """The surfaces that are lamps of actors, ascending."""
        rows = [n for n, key in enumerate(self.surfaces) if key.actor >= 0 and key.pattern in _VEHICLE_LAMPS]
        return np.array(rows, np.int64)

    @cached_property
    def light_parts(self) -> NDArray[np.int64]:
        """The part that each light is mounted on, [L]; 0 is the world."""
        return np.array([mounted.part for mounted in self.lights], np.int64)


def upload(bodies: Sequence[Body], device: str) -> Geometry:
    """Upload the geometry of static bodies, of actors with their parts in the Trace's order, and of lamps of signals.

    Raises:
        ValueError: The bodies are in another order, or there are more triangles than a visibility key can index.
    """
    town = [b for b in bodies if not b.moves]
    moving = [b for b in bodies if b.moves and not b.is_signal]
    signals = [b for b in bodies if b.is_signal]
    if list(bodies) != town + moving + signals:
        raise ValueError("static bodies come first, then the actors', then the lamps of traffic lights")
    packer = _Packer()
    for body in town:
        for _, mesh in body.parts:
            packer.add(body, mesh, part=0, base=0, actor=-1)
    still = packer.vertex_count, packer.chunk_count
    actors: list[Actor] = []
    bounds: list[NDArray[np.float64]] = []
    for index, body in enumerate(moving):
        base = len(bounds) + 1
        actors.append(
            Actor(body.name, body.instance, len(bounds), len(body.parts), tuple(name for name, _ in body.parts))
        )
        for offset, (_, mesh) in enumerate(body.parts):
            packer.add(body, mesh, part=base + offset, base=base, actor=index)
        bounds += [_box(mesh.vertices) for _, mesh in split_parts(body.parts)]
    for body in signals:
        base = len(bounds) + 1
        for _, mesh in body.parts:
            bounds.append(_box(mesh.vertices))
            packer.add(body, mesh, part=len(bounds), base=base, actor=-1)
    counts = [len(body.parts) for body in moving + signals]
    part_extent = np.concatenate([[-1], np.repeat(np.arange(len(counts)), np.array(counts, np.int64))])
    return packer.finish(device, tuple(actors), bounds, part_extent, still)


class _Packer:
    """Joins meshes into flat arrays, and numbers the surfaces of all bodies."""

    def __init__(self) -> None:
        self.vertex_count = 0
        self.triangle_count = 0
        self.chunk_count = 0
        self._chunks: dict[str, list[NDArray[np.generic]]] = {}
        self._surfaces: dict[SurfaceKey, int] = {}
        self._lights: list[MountedLight] = []
        self._levels: list[LevelRange] = []
        self._skins: list[tuple[NDArray[np.int32], NDArray[np.uint8]]] = [
            (np.zeros((1, 4), np.int32), np.zeros((1, 4), np.uint8))  # not used: arrays have an element at least
        ]
        self._skinned = 1
        self._origins: dict[int, NDArray[np.float64]] = {}

    def add(self, body: Body, mesh: Mesh, part: int, base: int, actor: int) -> None:
        """Append the mesh of one part; `base` is the body's base part."""
        self._lights += [MountedLight(part, light) for light in mesh.lights]
        if not len(mesh.triangles):
            return
        mesh = in_order(mesh)
        numbers = [self._number(body, mesh, row, actor) for row in range(len(mesh.surfaces))]
        casts = np.array([s.tag not in _GROUND_TAGS and not body.is_signal for s in mesh.surfaces], np.int32)
        surface = mesh.surface.astype(np.int64)
        self._put("vertices", mesh.vertices.astype(np.float32))
        self._put("normals", mesh.normals.astype(np.float32))
        self._put("uvs", mesh.uvs.astype(np.float32))
        self._follow(mesh, part)
        self._put("triangles", mesh.triangles.astype(np.int32) + self.vertex_count)
        self._put("face_normals", _face_normals(mesh))
        self._put("triangle_surface", np.array(numbers, np.int32)[surface])
        self._put("casts", casts[surface] * level_casts(mesh))
        self._chunk(mesh, part)
        self._levels += [level_range(level, base) for level in mesh.levels]
        self.vertex_count += len(mesh.vertices)
        self.triangle_count += len(mesh.triangles)

    def finish(
        self,
        device: str,
        actors: tuple[Actor, ...],
        boxes: list[Any],
        part_extent: NDArray[np.int64],
        still: tuple[int, int],
    ) -> Geometry:
        """Upload all chunks."""
        if self.triangle_count >= MAX_TRIANGLES:
            raise ValueError(f"{self.triangle_count} triangles are more than a scene can hold ({MAX_TRIANGLES})")
        static_vertices, static_chunks = still
        columns = {name: np.concatenate(chunks) for name, chunks in self._chunks.items()}
        kinds = {"vertices": wp.vec3f, "normals": wp.vec3f, "face_normals": wp.vec3f, "uvs": wp.vec2f}
        kinds |= {"triangles": wp.vec3i, "chunks": wp.vec3i, "chunk_centres": wp.vec3f, "chunk_halves": wp.vec3f}
        kinds["chunk_vertices"] = wp.vec2i
        arrays: dict[str, Any] = {
            k: wp.array(v, dtype=kinds.get(k, wp.int32), device=device) for k, v in columns.items()
        }
        skin_parts, skin_weights = (np.concatenate(rows) for rows in zip(*self._skins, strict=True))
        origins = np.zeros((len(boxes) + 1, 3), np.float32)
        for part, origin in self._origins.items():
            origins[part] = origin
        keys = tuple(self._surfaces)

        def table(values: Sequence[int] | NDArray[np.int64]) -> DeviceArray:
            return wp.array(np.array(values, np.int32), dtype=wp.int32, device=device)

        return Geometry(
            **arrays,
            skin_parts=wp.array(skin_parts, dtype=wp.vec4i, device=device),
            skin_weights=wp.array(skin_weights.astype(np.float32), dtype=wp.vec4f, device=device),
            part_origins=wp.array(origins, dtype=wp.vec3f, device=device),
            levels=struct_array(self._levels or [LevelRange()], device),
            part_extent=table(part_extent),
            surface_actor=table([k.actor for k in keys]),
            surface_instance=table([k.instance for k in keys]),
            surface_tag=table([k.tag for k in keys]),
            surface_pattern=table([int(k.pattern) for k in keys]),
            surfaces=keys,
            actors=actors,
            part_bounds=np.array(boxes, np.float64).reshape(-1, 2, 3),
            lights=tuple(self._lights),
            bounds=_box(columns["vertices"][:static_vertices] if static_vertices else columns["vertices"]),
            extent_rows=int(part_extent.max()) + 1,
            static_vertices=static_vertices,
            static_chunks=static_chunks,
            chunk_count=self.chunk_count,
            vertex_count=self.vertex_count,
            triangle_count=self.triangle_count,
        )

    def _chunk(self, mesh: Mesh, part: int) -> None:
        """Append the chunks of the mesh's triangles."""
        chunks = chunks_of(mesh)
        rows = np.stack([chunks.starts + self.triangle_count, chunks.sizes, chunks.part + part], axis=1)
        self._put("chunks", rows)
        first, last = np.minimum.reduce([*mesh.triangles.T]), np.maximum.reduce([*mesh.triangles.T])
        ends = np.minimum.reduceat(first, chunks.starts), np.maximum.reduceat(last, chunks.starts) + 1
        self._put("chunk_vertices", (np.stack(ends, axis=1) + self.vertex_count).astype(np.int32))
        self._put("chunk_level", np.where(chunks.level < 0, -1, chunks.level + len(self._levels)).astype(np.int32))
        self._put("chunk_centres", (chunks.low + chunks.high) * np.float32(0.5))
        self._put("chunk_halves", (chunks.high - chunks.low) * np.float32(0.5))
        self.chunk_count += len(chunks.starts)

    def _follow(self, mesh: Mesh, part: int) -> None:
        """Append the parts that the vertices follow."""
        skin, count = mesh.skin, len(mesh.vertices)
        own = np.full(count, part, np.int32)
        if skin is None:
            self._put("vertex_part", own)
            self._put("vertex_skin", np.full(count, -1, np.int32))
            return
        self._put("vertex_part", own + skin.parts[:, 0])
        self._put("vertex_skin", np.arange(self._skinned, self._skinned + count, dtype=np.int32))
        more = ((0, 0), (0, 4 - skin.parts.shape[1]))
        self._skins.append((np.pad(skin.parts, more) + part, np.pad(skin.weights, more)))
        self._origins |= {part + number: origin for number, origin in enumerate(skin.origins)}
        self._skinned += count

    def _put(self, column: str, values: NDArray[np.generic]) -> None:
        self._chunks.setdefault(column, []).append(np.ascontiguousarray(values))

    def _number(self, body: Body, mesh: Mesh, row: int, actor: int) -> int:
        surface = mesh.surfaces[row]
        key = SurfaceKey(body.name, surface.slot, surface.pattern, surface.tag, body.instance, actor)
        return self._surfaces.setdefault(key, len(self._surfaces))


def _box(vertices: NDArray[np.generic]) -> NDArray[np.float64]:
    """Return the box of vertices; a point at the origin if there are none."""
    if not len(vertices):
        return np.zeros((2, 3))
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)]).astype(np.float64)


def _face_normals(mesh: Mesh) -> NDArray[np.float32]:
    """Return unit normals of the triangles, by components: no product here may depend on BLAS."""
    corner = mesh.vertices.astype(np.float64)[mesh.triangles]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    n = np.stack(
        [
            u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1],
            u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2],
            u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0],
        ],
        axis=-1,
    )
    size = np.sqrt(n[:, 0] * n[:, 0] + n[:, 1] * n[:, 1] + n[:, 2] * n[:, 2])
    unit: NDArray[np.float32] = (n / np.maximum(size, 1e-30)[:, None]).astype(np.float32)
    return unit
