"""Plants: trees of three shapes, hedges, bushes and planters.

A crown is the smooth hull of a few ellipsoids, covered by leafy sprays that break up its outline. All normals point
away from the middle of the crown, so that shading is smooth and no facets are visible. The v of leaves is the visible
fraction of the sky: 1 at the outer top of the crown, less towards its middle and its underside.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, icosphere, lattice, level, noise, noises, tube
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.vectors import Array, Index, cross, unit

_BARK = Surface("bark", Pattern.BARK, Tag.VEGETATION)
_LEAVES = Surface("leaves", Pattern.FOLIAGE, Tag.VEGETATION)
_PIT = Surface("pit", Pattern.BARK, Tag.TERRAIN)
_SOIL = Surface("soil", Pattern.BARK, Tag.TERRAIN)
_POT = Surface("pot", Pattern.CONCRETE, Tag.STATIC)
_BROADLEAF, _CONIFER, _POPLAR = 0, 1, 2

Clump = tuple[float, float, float, float, float]  # centre x, y, z; horizontal, vertical radius; for a plant of size 1
Leaves = tuple[Array, Array, Array, Index]  # vertices, normals, uv, triangles


def tree(b: Builder, e: Element) -> None:
    """Build a street tree centred on the origin; `species` 0 is a broadleaf, 1 a conifer, 2 a poplar."""
    spread, _, height = e.size
    key, r, species = int(e.shape["key"]), e.shape["trunk"], int(e.shape.get("species", _BROADLEAF))
    b.quads(_PIT, [level(-0.6, 0.6, -0.6, 0.6, 0.004)])
    lean: Array = np.zeros(3)
    if species == _BROADLEAF:
        lean = np.array([0.12 * noise(key, 1), 0.12 * noise(key, 2), 0.0])
        _forked(b, key, r, spread, height, lean)
    else:
        path = [(0.0, 0.0, t * height) for t in (-0.01, 0.02, 0.08, 0.5)]
        b.grid(_BARK, tube(path, [1.7 * r, 1.3 * r, r, 0.5 * r], 8), crease=0.0)
    points, normals, uvs, triangles = _crown(species, key % 12)
    scale = np.array([spread, spread, height])
    b.add(_LEAVES, points * scale + lean, unit(normals / scale), uvs, triangles)


def _forked(b: Builder, key: int, r: float, spread: float, height: float, lean: Array) -> None:
    """Add a leaning trunk that forks into the crown."""
    fork, (lx, ly, _) = 0.40 * height, lean.tolist()
    path = [(lx * t, ly * t, fork * t) for t in (-0.01, 0.02, 0.12, 0.5, 1.0)]
    b.grid(_BARK, tube(path, [2.0 * r, 1.6 * r, 1.05 * r, 0.9 * r, 0.7 * r], 8), crease=0.0)
    for k in range(3):
        s, c = exact.sin_cos_deg(120.0 * k + 40.0 * noise(key, 3 + k))
        reach = spread * (0.2 + 0.05 * noise(key, 9 + k))
        branch = [(lx, ly, fork - 0.15), (lx + reach * c, ly + reach * s, fork + 0.24 * height)]
        b.grid(_BARK, tube(branch, [0.5 * r, 0.22 * r], 5), crease=0.0)


@cache
def _crown(species: int, kind: int) -> Leaves:
    """Return one of the twelve crowns of a species, for a tree of height and spread 1."""
    low = np.array([-0.5, -0.5, {_BROADLEAF: 0.27, _CONIFER: 0.1, _POPLAR: 0.12}[species]])
    high = np.array([0.5, 0.5, 1.0])
    if species == _CONIFER:
        return _fitted(_leafy(*_tiers(kind), kind + 29, 150, 0.09, np.array([0.0, 0.0, 0.4])), low, high)
    middle = np.array([0.0, 0.0, {_BROADLEAF: 0.6, _POPLAR: 0.45}[species]])
    points, faces = icosphere(1)
    hull = _hull({_BROADLEAF: _broadleaf, _POPLAR: _poplar}[species](kind), points, middle)
    return _fitted(_leafy(hull, faces, kind + 53 * species, 250, 0.13, middle), low, high)


def _broadleaf(kind: int) -> list[Clump]:
    found: list[Clump] = [(0.05 * noise(kind, 1), 0.05 * noise(kind, 2), 0.74, 0.25, 0.15)]
    for k in range(5):
        s, c = exact.sin_cos_deg(72.0 * k + 30.0 * noise(kind, 10 + k))
        out = 0.27 * (1 + 0.2 * noise(kind, 20 + k))
        found.append((out * c, out * s, 0.57 + 0.09 * noise(kind, 30 + k), 0.18 + 0.03 * noise(kind, 40 + k), 0.11))
    return found


def _poplar(kind: int) -> list[Clump]:
    widths = (0.26, 0.36, 0.34, 0.22)
    return [(0.08 * noise(kind, k), 0.08 * noise(kind, 9 + k), 0.25 + 0.18 * k, w, 0.15) for k, w in enumerate(widths)]


def _hull(clumps: Sequence[Clump], directions: Array, middle: Array) -> Array:
    """Return the points where rays from the middle leave the smoothly blended clumps: a closed surface [N, 3]."""
    squash = np.array([1.0, 1.0, clumps[0][3] / clumps[0][4]])
    low: Array = np.zeros(len(directions))
    high: Array = np.full(len(directions), 2.0)
    for _ in range(24):
        reach = (low + high) / 2
        field: Array = np.zeros(len(directions))
        for x, y, z, radius, _ in clumps:
            gap = directions * reach[:, None] - (np.array([x, y, z]) - middle) * squash
            near = radius * radius / (gap[:, 0] * gap[:, 0] + gap[:, 1] * gap[:, 1] + gap[:, 2] * gap[:, 2] + 1e-9)
            field = field + near * near
        inside = field > 1.0
        low, high = np.where(inside, reach, low), np.where(inside, high, reach)
    hull: Array = middle + directions * low[:, None] / squash
    return hull


def _tiers(kind: int) -> tuple[Array, Index]:
    """Return the branches of a conifer: overlapping, drooping cones with jagged edges."""
    tiers, columns = 7, 14
    rings = []
    for k in range(tiers):
        t = k / tiers
        wide = 0.5 * (1.0 - t) + 0.03
        for share, z in ((1.0, 0.1 + 0.88 * t), (0.42, 0.1 + 0.88 * t + 0.11)):
            ring = []
            for n in range(columns):
                s, c = exact.sin_cos_deg(360.0 * n / columns + 13.0 * k)
                r = wide * share * (1.0 + share * (0.14 * (1 - 2 * (n % 2)) + 0.12 * noise(kind, 31 * k + n)))
                ring.append((r * c, r * s, z - 0.03 * share * (1 - 2 * (n % 2)) * (1.0 - t)))
            rings.append(ring)
    rings.append([(0.0, 0.0, 1.0)] * columns)
    points = np.array(rings).reshape(-1, 3)
    return points, _between(2 * tiers + 1, columns)


def _between(rings: int, columns: int) -> Index:
    """Return the triangles between closed rings of points: the first of each cell, then the second."""
    triangles = lattice(rings, columns, True)
    return np.concatenate([triangles[::2], triangles[1::2]])


def _leafy(hull: Array, faces: Index, key: int, sprays: int, size: float, middle: Array) -> Leaves:
    """Return a hull and its sprays, with normals away from the middle.

    The visible sky decreases inwards and downwards.
    """
    outs = _outwards(hull, faces)
    spots, leaning, quads = _sprays(hull, outs, faces, key, sprays, size)
    p, out = np.concatenate([hull, spots]), np.concatenate([outs, leaning])
    away = unit((p - middle) * np.array([1.0, 1.0, 0.6]))
    normals = unit(0.45 * out + 0.55 * away + np.array([0.0, 0.0, 0.1]))
    reach = (p - middle) / np.maximum(p.max(0) - middle, middle - p.min(0))
    shell = np.minimum(1.0, reach[:, 0] * reach[:, 0] + reach[:, 1] * reach[:, 1] + reach[:, 2] * reach[:, 2])
    sky = np.clip(0.36 + 0.24 * shell + 0.4 * np.clip(0.5 + 0.6 * normals[:, 2], 0.0, 1.0), 0.0, 1.0)
    return p, normals, np.stack([shell, sky], axis=1), np.concatenate([faces, quads + len(hull)])


def _outwards(points: Array, faces: Index) -> Array:
    """Return unit vertex normals of a closed surface: the area-weighted mean of the adjacent faces."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    face = cross(b - a, c - a)
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, faces[:, k], face)
    return unit(total)


def _sprays(hull: Array, outs: Array, faces: Index, key: int, count: int, size: float) -> tuple[Array, Array, Index]:
    """Return leafy kites that protrude from a hull at all angles: corners [4 count, 3], outward directions, faces."""
    k = np.arange(count)
    face = faces[((k + 0.5 + 0.49 * noises(key, k)) * len(faces) / count).astype(np.int64)]  # [count, 3]
    share = np.stack([1.02 + noises(key, 8 * k + 1000 + n) for n in range(3)], axis=1)
    share = share / (share[:, 0] + share[:, 1] + share[:, 2])[:, None]

    def at_shares(values: Array) -> Array:
        corners = [values[face[:, n]] * share[:, n : n + 1] for n in range(3)]
        return corners[0] + corners[1] + corners[2]

    out = unit(at_shares(outs))
    tip, turn = (np.stack([noises(key, 8 * k + 1003 + 3 * m + n) for n in range(3)], axis=1) for m in range(2))
    tip = unit(0.75 * out + 0.8 * tip)
    side = unit(cross(tip, out + 0.9 * turn))
    long = (size * (1.0 + 0.3 * noises(key, 9000 + k)))[:, None]
    wide = 0.52 * long * side
    at = at_shares(hull) - 0.2 * long * tip
    kite = [at - 0.4 * long * tip, at + wide + 0.3 * long * tip, at + 0.8 * long * tip, at - wide + 0.45 * long * tip]
    first = 4 * k[:, None]
    quads = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return np.stack(kite, axis=1).reshape(-1, 3), unit(np.repeat(out, 4, axis=0)), quads


def _fitted(leaves: Leaves, low: Array, high: Array) -> Leaves:
    """Return leaves translated and scaled along each axis so that they fill a box."""
    points, normals, uvs, faces = leaves
    a, z = points.min(0), points.max(0)
    scale = (high - low) / (z - a)
    return (points - a) * scale + low, unit(normals / scale), uvs, faces


def bush(b: Builder, e: Element) -> None:
    """Build a round bush centred on the origin."""
    _shrub(b, int(e.shape["key"]), np.zeros(3), np.array(e.size))


def _shrub(b: Builder, key: int, foot: Array, size: Array) -> None:
    """Add a shrub that fills a box whose base centre is `foot`."""
    points, normals, uvs, faces = _shrub_shape(key % 6)
    b.add(_LEAVES, points * size + foot, unit(normals / size), uvs, faces)


@cache
def _shrub_shape(kind: int) -> Leaves:
    clumps: list[Clump] = []
    for k in range(4):
        s, c = exact.sin_cos_deg(90.0 * k + 40.0 * noise(kind, k))
        clumps.append((0.2 * c, 0.2 * s, 0.42 + 0.12 * noise(kind, 5 + k), 0.24, 0.34))
    points, faces = icosphere(1)
    middle = np.array([0.0, 0.0, 0.35])
    leaves = _leafy(_hull(clumps, points, middle), faces, kind + 311, 60, 0.16, middle)
    points, normals, uvs, faces = _fitted(leaves, np.array([-0.5, -0.5, -0.28]), np.array([0.5, 0.5, 1.0]))
    points[:, 2] = np.maximum(points[:, 2], 0.0)  # flatten the base: the shrub must not stand on a point
    return points, normals, uvs, faces


def hedge(b: Builder, e: Element) -> None:
    """Build a clipped hedge along y: a rounded bar of leaves with some protruding twigs."""
    thick, length, height = e.size
    key, count = int(e.shape["key"]), max(2, int(length / 1.2 + 0.5))
    profile = [(1.0, 0.0), (1.03, 0.45), (1.0, 0.86), (0.8, 0.97), (0.0, 1.0)]
    profile = [*profile, *((-x, z) for x, z in profile[-2::-1])]
    columns = len(profile) + 1  # and back along the ground
    rings = []
    for k in range(count + 3):
        inner = min(max(k - 1, 0), count)
        narrow = 0.02 if k in (0, count + 2) else 1.0
        y = 0.96 * length * (inner / count - 0.5)
        ring = []
        for n, (x, z) in enumerate([*profile, (0.0, 0.0)]):
            rough = 1.0 + 0.03 * noise(key, 40 * k + n)
            ring.append((0.45 * thick * x * rough * narrow, y, height * (0.5 + (0.95 * z * rough - 0.5) * narrow)))
        rings.append(ring)
    points = np.array(rings)[::-1].reshape(-1, 3)
    faces = _between(count + 3, columns)
    outs = _outwards(points, faces)
    spots, leaning, quads = _sprays(points, outs, faces, key, int(8 * length), 0.1)
    spots = np.clip(spots, [-thick / 2, -length / 2, 0.0], [thick / 2, length / 2, height])
    p, out = np.concatenate([points, spots]), np.concatenate([outs, leaning])
    sky = 0.4 + 0.6 * p[:, 2] / height
    uvs = np.stack([sky, sky], axis=1)
    b.add(_LEAVES, p, out, uvs, np.concatenate([faces, quads + len(points)]))


def planter(b: Builder, e: Element) -> None:
    """Build a stone tub with a shrub."""
    x, y, height = e.size
    rim = 0.55 * height
    b.grid(_POT, _square([(0.0, 0.84), (0.82, 0.94), (0.82, 1.0), (1.0, 1.0), (1.0, 0.86), (0.88, 0.86)], x, y, rim))
    low, inner = 0.88 * rim, 0.43
    b.quads(_SOIL, [level(-inner * x, inner * x, -inner * y, inner * y, low)])
    _shrub(b, int(e.shape["key"]), np.array([0.0, 0.0, low]), np.array([0.92 * x, 0.92 * y, height - low]))


def _square(profile: Sequence[tuple[float, float]], x: float, y: float, height: float) -> Array:
    """Return square rings of a tub from pairs of relative height and relative width."""
    corners = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    return np.array([[(k * x * cx, k * y * cy, z * height) for cx, cy in corners] for z, k in profile])
