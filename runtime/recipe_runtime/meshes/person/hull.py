"""Collects the sheets of a person's surface, in the rest pose, and the weights by which the parts move them.

All sheets of one version share their normals where they are welded: an arm continues a torso without an edge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from recipe_runtime.meshes.builder import Builder, lattice
from recipe_runtime.meshes.mesh import Surface
from recipe_runtime.meshes.skin import MAX_INFLUENCES, Influences
from recipe_runtime.meshes.vectors import Array, Index, cross, unit


@dataclass(frozen=True)
class Weights:
    """The parts that move the vertices of a sheet, [..., P] with P names: shares of 1."""

    names: tuple[str, ...]
    shares: Array

    @classmethod
    def whole(cls, name: str) -> Weights:
        """Return weights of one part for all vertices."""
        return cls((name,), np.ones(1))


class Hull:
    """Sheets of vertices in the rest pose: metres, in the frame of the base part."""

    def __init__(self, parts: Mapping[str, int]) -> None:
        """Begin an empty surface; `parts` numbers the actor's parts."""
        self._number, self._count = parts, 0
        self._points: list[Array] = []
        self._uvs: list[Array] = []
        self._twins: list[Index] = []
        self._shares: list[Array] = []
        self._triangles: list[Index] = []
        self._ids: list[Index] = []
        self._surfaces: dict[Surface, int] = {}

    def sheet(
        self,
        points: Array,
        weights: Weights,
        surfaces: Surface | Sequence[Surface | None] | Sequence[Sequence[Surface | None]],
        *,
        uv: Array | None = None,
        closed: bool = True,
        mirrored: bool = False,
        welds: Mapping[int, Index] | None = None,
        caps: tuple[bool, bool] = (False, False),
        seam: int = 0,
    ) -> Index:
        """Add a sheet through rings of points.

        Args:
            points: Rings [R, C, 3]; successive rings, seen against their direction of advance, run counter-clockwise.
            weights: Shares [R, C, P], or of a shape that broadcasts to it.
            surfaces: One surface, one per row of cells, or one per cell; None is a hole.
            uv: Texture coordinates [R, C + 1, 2] (C if the sheet is open), metres; by default lengths along the rings.
            closed: Whether each ring's end is joined to its start.
            mirrored: Whether the rings run clockwise.
            welds: Vertices of earlier sheets that rows continue, as numbers that this method returned.
            caps: Whether to close the first and the last ring.
            seam: Column of a closed sheet at which uv begins and ends.

        Returns:
            The numbers of the vertices [R, C].
        """
        rows, columns = points.shape[:2]
        wide = columns + closed
        points = np.roll(points, -seam, axis=1)
        uvs = _lengths(points, closed) if uv is None else uv
        own = self._count + np.arange(rows * wide, dtype=np.int64).reshape(rows, wide)
        twins = own.copy()
        for row, numbers in (welds or {}).items():
            twins[row, :columns] = np.roll(numbers, -seam)
        if closed:
            points = np.concatenate([points, points[:, :1]], axis=1)
            twins[:, -1] = twins[:, 0]
        triangles = lattice(rows, wide, False)
        cells = [[*row[seam:], *row[:seam]] for row in _cells(surfaces, rows - 1, wide - 1)]
        codes = np.repeat(np.array([self._code(name) for row in cells for name in row], np.int64), 2)
        shares = np.roll(np.broadcast_to(weights.shares, (rows, columns, len(weights.names))), -seam, axis=1)
        if closed:
            shares = np.concatenate([shares, shares[:, :1]], axis=1)
        self._append(points.reshape(-1, 3), uvs.reshape(-1, 2), twins.reshape(-1), shares, weights.names)
        self._face(own.reshape(-1)[triangles], codes, mirrored)
        if caps[0]:
            self._cap(points[0, :columns], own[0], cells[0][0], weights.names, shares[0], mirrored)
        if caps[1]:
            self._cap(points[-1, :columns], own[-1], cells[-1][0], weights.names, shares[-1], not mirrored)
        return np.roll(twins[:, :columns], seam, axis=1)

    def _cap(
        self,
        ring: Array,
        numbers: Index,
        surface: Surface | None,
        names: tuple[str, ...],
        shares: Array,
        forward: bool,
    ) -> None:
        """Close a ring by a fan around its middle, which has the weights of its first point."""
        middle = self._count
        total = np.cumsum(ring, axis=0)[-1] / len(ring)
        self._append(total[None], np.zeros((1, 2)), np.array([middle]), shares[:1], names)
        count = len(ring)
        fan = np.array([(middle, k, k + 1) if forward else (middle, k + 1, k) for k in range(count)])
        fan[:, 1:] = numbers[fan[:, 1:] % len(numbers)]
        self._face(fan, np.full(count, self._code(surface)), False)

    def _append(self, points: Array, uvs: Array, twins: Index, shares: Array, names: Sequence[str]) -> None:
        full = np.zeros((len(points), len(self._number)))
        for column, name in enumerate(names):
            full[:, self._number[name]] += shares.reshape(-1, len(names))[:, column]
        self._points.append(points)
        self._uvs.append(uvs)
        self._twins.append(twins)
        self._shares.append(full)
        self._count += len(points)

    def _face(self, triangles: Index, codes: Index, mirrored: bool) -> None:
        kept = codes >= 0
        self._triangles.append(triangles[kept][:, ::-1] if mirrored else triangles[kept])
        self._ids.append(codes[kept])

    def _code(self, surface: Surface | None) -> int:
        return -1 if surface is None else self._surfaces.setdefault(surface, len(self._surfaces))

    def weld(self, own: Index, others: Index) -> None:
        """Let vertices share their normals with others: `own` with `others`, numbers that `sheet` returned."""
        flat = np.concatenate(self._twins)
        place = np.arange(len(flat))
        place[own] = others
        self._twins = [place[flat]]

    def finish(self, b: Builder, shift: Sequence[float]) -> None:
        """Add the surface to a builder, with smooth normals, without slivers, moved by `shift` metres."""
        twins, triangles = np.concatenate(self._twins), np.concatenate(self._triangles)
        placed: Array = np.concatenate(self._points)
        points: Array = np.round(placed, 6)[twins]  # welded: without cracks in any pose
        ids = np.concatenate(self._ids)
        corners = points[triangles]
        face = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        solid = (face[:, 0] * face[:, 0] + face[:, 1] * face[:, 1] + face[:, 2] * face[:, 2]) > 1e-20
        triangles, ids, face = triangles[solid], ids[solid], face[solid]
        around = twins[triangles].reshape(-1)
        sums = [np.bincount(around, np.repeat(face[:, k], 3), self._count) for k in range(3)]  # in order of triangles
        normals = unit(np.stack(sums, axis=1))[twins]
        shares = np.concatenate(self._shares)[twins]
        parts = np.argsort(-shares, axis=1, kind="stable")[:, :MAX_INFLUENCES]
        weights = np.take_along_axis(shares, parts, axis=1)
        uvs, points = np.concatenate(self._uvs), points + np.array(shift)
        for surface, number in self._surfaces.items():
            used, own = np.unique(triangles[ids == number], return_inverse=True)
            if len(used):
                follow = Influences(parts[used], weights[used])
                b.add(surface, points[used], normals[used], uvs[used], own.reshape(-1, 3), follow)


def _cells(
    surfaces: Surface | Sequence[Surface | None] | Sequence[Sequence[Surface | None]], rows: int, columns: int
) -> list[Sequence[Surface | None]]:
    if isinstance(surfaces, Surface):
        return [[surfaces] * columns] * rows
    return [[row] * columns if row is None or isinstance(row, Surface) else row for row in surfaces]


def _lengths(points: Array, closed: bool) -> Array:
    """Return uv in metres: along the ring from its first point, by the mean length of all rings, and its height."""
    ends = np.concatenate([points, points[:, :1]], axis=1) if closed else points
    step = ends[:, 1:] - ends[:, :-1]
    length = np.sqrt(step[..., 0] * step[..., 0] + step[..., 1] * step[..., 1] + step[..., 2] * step[..., 2])
    mean = np.cumsum(length, axis=0)[-1] / len(points)
    u = np.concatenate([[0.0], np.cumsum(mean)])
    return np.stack([np.broadcast_to(u, ends.shape[:2]), ends[..., 2]], axis=-1)
