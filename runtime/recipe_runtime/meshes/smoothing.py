"""Smooth shading of curved sheets: computes the shared corner normals of many sheets in one pass.

A body has dozens of small sheets, and the overhead of a NumPy call exceeds the cost of its arithmetic, so `flatten`
processes them together. Sheets never share normals with each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.meshes.mesh import Surface
from recipe_runtime.meshes.skin import Influences
from recipe_runtime.meshes.vectors import Array, Index, cross, unit

_SLIVER = 1e-10  # twice the area below which a triangle is discarded, square metres


@dataclass(frozen=True)
class Sheet:
    """Triangles [T, 3] over points [N, 3] in metres, and the crease (a cosine).

    `runs` holds the surfaces of consecutive triangles, each with its number of triangles; None is a hole.
    """

    runs: Sequence[tuple[Surface | None, int]]
    points: Array
    triangles: Index
    crease: float
    influences: Influences | None = None  # of the points of a skin


@dataclass(frozen=True)
class Flat:
    """The triangles of many sheets, sheet by sheet, and within a sheet surface by surface."""

    corners: Array  # [T, 3, 3] metres
    points: Index  # [T, 3] the corners' points, numbered through all sheets
    normals: Array  # [T, 3, 3] unit normals at the corners
    faces: Array  # [T, 3] unit normals of the triangles
    codes: Index  # [T] indices into `surfaces`
    surfaces: tuple[Surface, ...]
    used: tuple[tuple[int, ...], ...]  # the codes of each sheet's surfaces, in order of appearance


def flatten(sheets: Sequence[Sheet]) -> Flat:
    """Join sheets. Slivers and holes are omitted, though holes contribute to the normals of their neighbours."""
    surfaces, codes = _coded(sheets)
    first = np.cumsum([0, *(len(sheet.points) for sheet in sheets)])
    triangles = np.concatenate([sheet.triangles + n for sheet, n in zip(sheets, first[:-1].tolist(), strict=True)])
    sheet_of = np.repeat(np.arange(len(sheets)), [len(sheet.triangles) for sheet in sheets])
    points = np.round(np.concatenate([sheet.points for sheet in sheets]), 6)
    corners = points[triangles]
    face = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.sqrt(face[:, 0] * face[:, 0] + face[:, 1] * face[:, 1] + face[:, 2] * face[:, 2])
    solid = area > _SLIVER
    joined = _joined(points, np.repeat(np.arange(len(sheets)), np.diff(first)))
    crease = np.array([sheet.crease for sheet in sheets])[sheet_of]
    normals = np.zeros_like(corners)
    normals[solid] = _corner_normals(joined[triangles[solid]], face[solid], crease[solid])
    kept = np.flatnonzero(solid & (codes >= 0))
    groups, start, member = np.unique(
        sheet_of[kept] * len(surfaces) + codes[kept], return_index=True, return_inverse=True
    )
    rank = np.argsort(start, kind="stable")  # groups in order of appearance
    place = np.empty_like(rank)
    place[rank] = np.arange(len(rank))
    kept = kept[np.argsort(place[member.reshape(-1)], kind="stable")]
    used: list[list[int]] = [[] for _ in sheets]
    for group in groups[rank].tolist():
        used[group // len(surfaces)].append(group % len(surfaces))
    return Flat(
        corners[kept], triangles[kept], normals[kept], unit(face[kept]), codes[kept], surfaces, tuple(map(tuple, used))
    )


def _coded(sheets: Sequence[Sheet]) -> tuple[tuple[Surface, ...], Index]:
    """Return all distinct surfaces, and for each triangle the index of its surface, or -1 for a hole."""
    runs = [run for sheet in sheets for run in sheet.runs]
    numbers: dict[Surface, int] = {}
    by_id: dict[int, int] = {}  # few distinct objects: found by identity, without hashing their fields
    for key, name in {id(name): name for name, _ in runs}.items():
        by_id[key] = -1 if name is None else numbers.setdefault(name, len(numbers))
    return tuple(numbers), np.repeat([by_id[id(name)] for name, _ in runs], [count for _, count in runs])


def _joined(points: Array, sheet: Index) -> Index:
    """Number the points; points of one sheet at the same position (to a micrometre) have the same number."""
    x, y, z = np.round(points * 1e6).astype(np.int64).T
    order = np.lexsort((z, y, x, sheet))
    new: NDArray[np.bool_] = np.zeros(len(points), np.bool_)
    for key in (sheet, x, y, z):
        new[1:] |= key[order][1:] != key[order][:-1]
    number = np.empty(len(points), np.int64)
    number[order] = np.cumsum(new)
    return number


def _corner_normals(points: Index, face: Array, crease: Array) -> Array:
    """Return the area-weighted mean normal at each corner of each triangle, over the faces within the crease angle.

    Args:
        points: [T, 3] the number of each corner's point.
        face: [T, 3] normals whose length is twice the area of the triangle.
        crease: [T] cosine of the largest angle between faces that share a normal.

    Returns:
        [T, 3, 3] unit normals.
    """
    point = points.reshape(-1)
    small = point.astype(np.uint16) if len(point) < 1 << 16 else point  # which NumPy sorts by radix
    order = np.argsort(small, kind="stable")
    valence = np.bincount(point)
    start = np.cumsum(valence) - valence
    direction = unit(face)
    total = np.empty((len(point), 3))
    for count in np.unique(valence[valence > 0]).tolist():  # all points [N] with this many corners, together
        corner = order[start[valence == count][:, None] + np.arange(count)]  # [N, count]
        around = corner // 3
        d, f, limit = direction[around], face[around], crease[around[:, 0]]
        ends = [(d[:, :, None, k], d[:, None, :, k]) for k in range(3)]  # of each pair of faces
        cosine = ends[0][0] * ends[0][1] + ends[1][0] * ends[1][1] + ends[2][0] * ends[2][1]
        near = (cosine >= limit[:, None, None]) | (around[:, :, None] == around[:, None, :])
        for k in range(3):  # cumsum adds in a fixed order, so sums have the same bits on every host
            total[corner, k] = np.cumsum(near * f[:, None, :, k], axis=2)[:, :, -1]
    return unit(total).reshape(-1, 3, 3)
