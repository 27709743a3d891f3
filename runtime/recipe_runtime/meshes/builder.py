"""Builds meshes from triangles, with exact arithmetic only.

Every number comes from `+ - * /` and `sqrt` in float64, is rounded to a micrometre and then kept as float32, so a
mesh is the same bytes on every host. `noise`, an integer hash of a key, is the only source of variation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.body.skeleton import Joint
from recipe_runtime.meshes.merging import distinct
from recipe_runtime.meshes.mesh import Level, Light, Mesh, Surface
from recipe_runtime.meshes.skin import Influences, joined, skin_of
from recipe_runtime.meshes.smoothing import Sheet, flatten
from recipe_runtime.meshes.vectors import Array, Index, cross, unit

Vec = Sequence[float]


def noise(key: int, index: int) -> float:
    """Return a pseudo-random number in [-1, 1): splitmix64 of the key and index."""
    z = (key * 0x9E3779B97F4A7C15 + index * 0xD1B54A32D192ED03 + 0x632BE59BD9B4E019) & 0xFFFFFFFFFFFFFFFF
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & 0xFFFFFFFFFFFFFFFF
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & 0xFFFFFFFFFFFFFFFF
    return float((z ^ (z >> 31)) >> 11) * 2.0**-52 - 1.0


def noises(key: int, indices: Index) -> Array:
    """Return `noise` of one key for many indices."""
    seed = np.uint64((key * 0x9E3779B97F4A7C15 + 0x632BE59BD9B4E019) & 0xFFFFFFFFFFFFFFFF)
    z = indices.astype(np.uint64) * np.uint64(0xD1B54A32D192ED03) + seed  # modulo 2^64
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    out: Array = ((z ^ (z >> np.uint64(31))) >> np.uint64(11)).astype(np.float64) * 2.0**-52 - 1.0
    return out


@lru_cache(maxsize=1024)
def circle(count: int, start: float = 0.0) -> tuple[tuple[float, float], ...]:
    """Return the points (cosine, sine) of a unit circle, counter-clockwise from `start` degrees."""
    angles = [exact.sin_cos_deg(start + 360.0 * k / count) for k in range(count)]
    return tuple((c, s) for s, c in angles)


def level(x0: float, x1: float, y0: float, y1: float, z: float) -> tuple[Vec, ...]:
    """Return a level rectangle that faces up."""
    return (x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)


def upright(x: float, y0: float, y1: float, z0: float, z1: float) -> tuple[Vec, ...]:
    """Return an upright rectangle that faces +x."""
    return (x, y0, z0), (x, y1, z0), (x, y1, z1), (x, y0, z1)


class Builder:
    """Collects triangles; `mesh` returns the result. Coordinates are in metres."""

    def __init__(self) -> None:
        self._surfaces: dict[Surface, int] = {}
        self._pending: list[Surface | Sheet] = []  # surfaces and sheets without a number yet, in order of first use
        self._points: list[Array] = []
        self._normals: list[Array] = []
        self._uvs: list[Array] = []
        self._triangles: list[Index] = []
        self._ids: list[Index] = []
        self._level_ids: list[Index] = []
        self._influences: list[Influences | None] = []  # of the points, None: those of the base part
        self._loose: list[Index] = []  # numbers of the points of which others may be equals
        self._levels: dict[Level, int] = {}
        self._level = -1  # of the triangles that are added; -1: shown at all distances
        self._count = 0
        self._quads: dict[tuple[Surface, bool], list[tuple[Array, Array]]] = {}
        self.lights: list[Light] = []

    def add(
        self,
        surface: Surface,
        points: Array,
        normals: Array,
        uvs: Array,
        triangles: Index,
        influences: Influences | None = None,
    ) -> None:
        """Add triangles of one surface.

        Args:
            surface: The surface.
            points: Vertices [N, 3], metres.
            normals: Unit normals [N, 3].
            uvs: Texture coordinates [N, 2].
            triangles: Indices of vertices [T, 3].
            influences: The parts that the vertices of a skin follow; None: the base part.
        """
        self._settle()
        ids = np.full(len(triangles), self._number(surface), np.int64)
        self._append(points, normals, uvs, triangles, ids, influences)

    def _append(
        self, points: Array, normals: Array, uvs: Array, triangles: Index, ids: Index, influences: Influences | None
    ) -> None:
        self._points.append(points)
        self._normals.append(normals)
        self._uvs.append(uvs)
        self._triangles.append(triangles + self._count)
        self._ids.append(ids)
        self._level_ids.append(np.full(len(ids), self._level, np.int32))
        self._influences.append(influences)
        self._count += len(points)

    def _number(self, surface: Surface) -> int:
        return self._surfaces.setdefault(surface, len(self._surfaces))

    @contextmanager
    def level(
        self, near: float = 0.0, far: float = math.inf, *, anchor: Vec, casts: bool | None = None
    ) -> Iterator[None]:
        """Add the triangles of the block as one of several versions of an object, shown by its size in the picture.

        The versions share their anchor, and one begins at the distance where another ends: `Level` defines the limits.
        Details that disappear at a distance are an object with one version.

        Args:
            near: Distance from which the version is shown, metres.
            far: Distance from which it is no longer shown, metres.
            anchor: Point of the object from which distances are measured; in the frame of the body's base part, for an
            element of a town in its own frame.
            casts: Whether this version casts the object's shadow at all distances. The default is the nearest version.
        """
        x, y, z = (float(v) for v in anchor)
        level = Level(near, far, (x, y, z), near == 0.0 if casts is None else casts)
        self._flush()
        outer, self._level = self._level, self._levels.setdefault(level, len(self._levels))
        yield
        self._flush()
        self._level = outer

    def quads(self, surface: Surface, corners: Iterable[Sequence[Vec]], uvs: Array | None = None) -> None:
        """Add flat quadrilaterals.

        Args:
            surface: The surface.
            corners: Corners [N, 4, 3], counter-clockwise seen from outside.
            uvs: Texture coordinates [N, 4, 2]; by default, metres in the plane of the quadrilateral.
        """
        quad = np.asarray(corners if isinstance(corners, np.ndarray) else list(corners), np.float64).reshape(-1, 4, 3)
        if not len(quad):
            return
        self._pending.append(surface)
        self._quads.setdefault((surface, uvs is None), []).append((quad, np.asarray(quad if uvs is None else uvs)))

    def _flush(self) -> None:
        """Add all quadrilaterals in one pass, which is faster than one by one."""
        self._settle()
        for (surface, plain), found in self._quads.items():
            quad = np.concatenate([corners for corners, _ in found])
            normal = unit(cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1]))
            uvs = _plane_uv(quad, normal) if plain else np.concatenate([uv for _, uv in found])
            first = np.arange(len(quad), dtype=np.int64)[:, None] * 4
            triangles = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
            self.add(surface, quad.reshape(-1, 3), np.repeat(normal, 4, axis=0), uvs.reshape(-1, 2), triangles)
            self._loose.append(self._count - 1 - np.arange(4 * len(quad)))
        self._quads = {}

    def fan(self, surface: Surface, ring: Sequence[Vec]) -> None:
        """Add a flat convex polygon, counter-clockwise seen from outside; uv is in metres."""
        points = np.asarray(ring, np.float64)
        n = len(points)
        normal = unit(cross(points[n // 3] - points[0], points[2 * n // 3] - points[0])[None])
        uvs = _plane_uv(points[None], normal)[0]
        triangles = np.array([(0, k, k + 1) for k in range(1, n - 1)], np.int64)
        self.add(surface, points, np.repeat(normal, n, axis=0), uvs, triangles)
        self._loose.append(self._count - 1 - np.arange(n))

    def box(self, surface: Surface, low: Vec, high: Vec, without: str = "") -> None:
        """Add an axis-aligned box; `without` names the faces to omit, such as "-z +x"."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        faces = {
            "-x": ((x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)),
            "+x": ((x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)),
            "-y": ((x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)),
            "+y": ((x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)),
            "-z": ((x0, y1, z0), (x1, y1, z0), (x1, y0, z0), (x0, y0, z0)),
            "+z": ((x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)),
        }
        self.quads(surface, [quad for face, quad in faces.items() if face not in without.split()])

    def grid(
        self,
        surfaces: Surface | Sequence[Sequence[Surface | None]],
        points: Array | Sequence[Sequence[Vec]],
        *,
        closed: bool = True,
        crease: float = 0.5,
        caps: tuple[Surface | None, Surface | None] = (None, None),
        influences: Influences | None = None,
    ) -> None:
        """Add a curved surface through rings of points.

        Args:
            surfaces: One surface for all cells, or one per cell [R-1][C]; None leaves a hole.
            points: Rings [R, C, 3]. Faces point outwards if successive rings, seen against their direction of advance,
            run
                counter-clockwise.
            closed: Whether each ring's end is joined to its start.
            crease: Cosine of the largest angle between faces that share normals.
            caps: Surfaces that close the first and the last ring; None leaves an end open.
            influences: The parts that the points of a skin follow, ring by ring; None: the base part.
        """
        p = np.asarray(points, np.float64)
        rows, columns = p.shape[:2]
        triangles = lattice(rows, columns, closed)
        if isinstance(surfaces, Surface):
            runs: list[tuple[Surface | None, int]] = [(surfaces, len(triangles))]
        else:
            wide = columns if closed else columns - 1
            runs = [(name, 2) for row in surfaces[: rows - 1] for name in row[:wide]]
        for end in (0, 1):
            cap = caps[end]
            if cap is not None:
                base = 0 if end == 0 else (rows - 1) * columns
                order = [base + (columns - 1 - k if end == 0 else k) for k in range(columns)]
                fan = [(order[0], order[k], order[k + 1]) for k in range(1, columns - 1)]
                triangles = np.concatenate([triangles, np.array(fan, triangles.dtype)])
                runs.append((cap, len(fan)))
        self._pending.append(Sheet(runs, p.reshape(-1, 3), triangles, crease, influences))

    def smooth(
        self,
        surface: Surface | Sequence[tuple[Surface | None, int]],
        points: Array,
        triangles: Index,
        crease: float,
        influences: Influences | None = None,
    ) -> None:
        """Add triangles over shared points; normals are shared across edges flatter than the crease.

        Args:
            surface: One surface for all triangles, or the surfaces of consecutive triangles with their numbers; None
            leaves a hole.
            points: Points [N, 3].
            triangles: Indices of points [T, 3].
            crease: Cosine of the largest angle between faces that share normals.
            influences: The parts that the points of a skin follow; None: the base part.
        """
        runs = [(surface, len(triangles))] if isinstance(surface, Surface) else surface
        self._pending.append(Sheet(runs, points, triangles, crease, influences))

    def _settle(self) -> None:
        """Number the pending surfaces and add the pending sheets in one pass, which is faster than one by one."""
        pending, self._pending = self._pending, []
        sheets = [item for item in pending if isinstance(item, Sheet)]
        flat = flatten(sheets) if sheets else None
        numbers: dict[int, int] = {}
        used = iter(flat.used if flat else ())
        for item in pending:
            if isinstance(item, Surface):
                self._number(item)
            elif flat:
                numbers |= {code: self._number(flat.surfaces[code]) for code in next(used)}
        if flat is None or not len(flat.codes):
            return
        table = np.array([numbers.get(code, -1) for code in range(len(flat.surfaces))], np.int64)
        uvs = _plane_uv(flat.corners, flat.faces).reshape(-1, 2)
        index = np.arange(3 * len(flat.codes), dtype=np.int64).reshape(-1, 3)
        followed = None
        if any(sheet.influences is not None for sheet in sheets):
            rows = joined([sheet.influences for sheet in sheets], [len(sheet.points) for sheet in sheets])
            at = flat.points.reshape(-1)
            followed = Influences(rows.parts[at], rows.weights[at])
        corners, normals = flat.corners.reshape(-1, 3), flat.normals.reshape(-1, 3)
        self._append(corners, normals, uvs, index, table[flat.codes], followed)
        self._loose.append(self._count - 1 - np.arange(len(corners)))

    def mesh(self, transform: Array | None = None, joints: Sequence[Joint] = ()) -> Mesh:
        """Return the mesh of all triangles; equal vertices are merged.

        Args:
            transform: Transform of the triangles [3, 4], the identity by default; not of a skin.
            joints: The actor's joints if the mesh is a skin, with points in the frame of the base part at rest.
        """
        self._flush()
        points, normals = np.concatenate(self._points), np.concatenate(self._normals)
        lights, levels = tuple(self.lights), tuple(self._levels)
        if transform is not None:
            points, normals = _apply(transform, points, 1.0), _apply(transform, normals, 0.0)
            lights = tuple(_moved(light, transform) for light in lights)
            levels = tuple(replace(level, anchor=_placed(level.anchor, transform)) for level in levels)
        rows = np.concatenate([points, normals, np.concatenate(self._uvs)], axis=1)
        rows = (np.round(rows, 6) + 0.0).astype(np.float32)
        triangles, ids = np.concatenate(self._triangles), np.concatenate(self._ids)
        skin = None
        if joints:
            skin = skin_of(joined(self._influences, [len(points) for points in self._points]), joints)
        first, inverse = distinct(rows, skin, self._loose)
        rows = rows[first]
        return Mesh(
            vertices=np.ascontiguousarray(rows[:, 0:3]),
            normals=np.ascontiguousarray(rows[:, 3:6]),
            uvs=np.ascontiguousarray(rows[:, 6:8]),
            triangles=inverse[triangles].astype(np.int32),
            surface=ids.astype(np.int32),
            surfaces=tuple(self._surfaces),
            lights=lights,
            levels=levels,
            level=np.concatenate(self._level_ids) if levels else None,
            skin=skin and replace(skin, parts=skin.parts[first], weights=skin.weights[first]),
        )


@lru_cache(maxsize=256)
def lattice(rows: int, columns: int, closed: bool) -> Index:
    """Return two triangles per cell of a grid of points, cell by cell.

    Closed rings join their last point to their first.
    """
    wide = columns if closed else columns - 1
    r, c = (g.reshape(-1) for g in np.meshgrid(np.arange(rows - 1), np.arange(wide), indexing="ij"))
    n = (c + 1) % columns
    flat = np.stack([r * columns + c, r * columns + n, (r + 1) * columns + n, (r + 1) * columns + c], axis=1)
    triangles = np.stack([flat[:, [0, 1, 2]], flat[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    triangles.flags.writeable = False
    return triangles


def _plane_uv(points: Array, normal: Array) -> Array:
    """Return uv in metres in each polygon's plane; in an upright plane, u is horizontal and v points up."""
    steep = np.abs(normal[:, 2]) < 0.7
    x = np.where(steep, -normal[:, 1], 1.0)
    y = np.where(steep, normal[:, 0], 0.0)
    length = np.sqrt(x * x + y * y)
    x, y = x / length, y / length
    u = points[..., 0] * x[:, None] + points[..., 1] * y[:, None]
    v = np.where(steep[:, None], points[..., 2], points[..., 1])
    return np.stack([u, v], axis=-1)


def _apply(transform: Array, v: Array, w: float) -> Array:
    return np.stack(
        [
            transform[k, 0] * v[:, 0] + transform[k, 1] * v[:, 1] + transform[k, 2] * v[:, 2] + transform[k, 3] * w
            for k in range(3)
        ],
        axis=1,
    )


def _moved(light: Light, transform: Array) -> Light:
    direction = _apply(transform, np.array([light.direction]), 0.0)[0]
    dx, dy, dz = (round(float(v), 6) + 0.0 for v in direction)
    return Light(_placed(light.position, transform), (dx, dy, dz), light.colour, light.intensity, light.cone)


def _placed(point: tuple[float, float, float], transform: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 6) + 0.0 for v in _apply(transform, np.array([point]), 1.0)[0])
    return x, y, z


def tube(path: Sequence[Vec], radii: Sequence[float], sides: int = 8) -> Array:
    """Return rings around a path that rises along z, for `Builder.grid`: [len(path), sides, 3]."""
    ring = circle(sides)
    return np.array([[(x + r * c, y + r * s, z) for c, s in ring] for (x, y, z), r in zip(path, radii, strict=True)])


def icosphere(levels: int) -> tuple[Array, Index]:
    """Return a unit sphere of 20 * 4^levels triangles."""
    g = (1.0 + math.sqrt(5.0)) / 2.0
    raw = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
           (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]  # fmt: skip
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
             (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
             (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]  # fmt: skip
    points: list[tuple[float, ...]] = [tuple(p) for p in unit(np.array(raw, np.float64)).tolist()]
    for _ in range(levels):
        middle: dict[tuple[int, int], int] = {}

        def between(a: int, b: int, middle: dict[tuple[int, int], int] = middle) -> int:
            key = (min(a, b), max(a, b))
            if key not in middle:
                m = np.array([[(p + q) / 2 for p, q in zip(points[a], points[b], strict=True)]])
                points.append(tuple(unit(m)[0].tolist()))
                middle[key] = len(points) - 1
            return middle[key]

        split = []
        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = split
    return np.array(points), np.array(faces, np.int64)
