"""Plants: trees of three habits, hedges, bushes and planters.

A crown is a few smooth clumps under a coat of leafy sprays that break its outline. All its normals lean outwards
from the crown's middle, so that light rolls over the whole and no facet shows. The uv of leaves says how much of the
sky reaches them: v is 1 at the crown's outer top and falls towards its middle and its underside.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from recipe_compiler import exact
from recipe_compiler.plan import Element

from recipe_runtime.meshes.builder import Array, Builder, Index, cross, icosphere, noise, tube, unit
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.tags import Tag

_BARK = Surface("bark", Pattern.BARK, Tag.VEGETATION)
_LEAVES = Surface("leaves", Pattern.FOLIAGE, Tag.VEGETATION)
_PIT = Surface("pit", Pattern.BARK, Tag.TERRAIN)
_SOIL = Surface("soil", Pattern.BARK, Tag.TERRAIN)
_POT = Surface("pot", Pattern.CONCRETE, Tag.STATIC)
_BROADLEAF, _CONIFER, _POPLAR = 0, 1, 2

Clump = tuple[float, float, float, float, float]  # centre x, y, z; radius on the plan and upright; tree of size 1


def tree(b: Builder, e: Element) -> None:
    """A street tree over its base centre; `species` 0 is a broadleaf, 1 a conifer, 2 a poplar."""
    spread, _, height = e.size
    key, r, species = int(e.shape["key"]), e.shape["trunk"], int(e.shape.get("species", _BROADLEAF))
    b.quads(_PIT, [((-0.6, -0.6, 0.004), (0.6, -0.6, 0.004), (0.6, 0.6, 0.004), (-0.6, 0.6, 0.004))])
    lean = np.array([0.12 * noise(key, 1), 0.12 * noise(key, 2), 0.0])
    if species == _BROADLEAF:
        _forked(b, key, r, spread, height, lean)
    else:
        path = [(0.0, 0.0, t * height) for t in (-0.01, 0.02, 0.08, 0.5)]
        b.grid(_BARK, tube(path, [1.7 * r, 1.3 * r, r, 0.5 * r], 8), crease=0.0)
        lean = lean * 0.0
    points, normals, uvs, triangles = _crown(species, key % 12)
    scale = np.array([spread, spread, height])
    b.add(_LEAVES, points * scale + lean, unit(normals / scale), uvs, triangles)


def _forked(b: Builder, key: int, r: float, spread: float, height: float, lean: Array) -> None:
    """A trunk that leans and forks into the crown."""
    fork, (lx, ly, _) = 0.40 * height, lean.tolist()
    path = [(lx * t, ly * t, fork * t) for t in (-0.01, 0.02, 0.12, 0.5, 1.0)]
    b.grid(_BARK, tube(path, [2.0 * r, 1.6 * r, 1.05 * r, 0.9 * r, 0.7 * r], 8), crease=0.0)
    for k in range(4):
        s, c = exact.sin_cos_deg(90.0 * k + 40.0 * noise(key, 3 + k))
        reach = spread * (0.2 + 0.05 * noise(key, 9 + k))
        branch = [(lx, ly, fork - 0.15), (lx + reach * c, ly + reach * s, fork + 0.24 * height)]
        b.grid(_BARK, tube(branch, [0.5 * r, 0.22 * r], 5), crease=0.0)


@cache
def _crown(species: int, kind: int) -> tuple[Array, Array, Array, Index]:
    """One of twelve crowns of a species for a tree of height and spread 1: vertices, normals, uv, triangles."""
    clumps = {_BROADLEAF: _broadleaf, _CONIFER: _conifer, _POPLAR: _poplar}[species](kind)
    middle = np.array([0.0, 0.0, {_BROADLEAF: 0.6, _CONIFER: 0.3, _POPLAR: 0.45}[species]])
    sprays = {_BROADLEAF: 20, _CONIFER: 14, _POPLAR: 30}[species]
    points, normals, uvs, faces = _foliage(clumps, kind + 53 * species, middle, sprays)
    low = np.array([-0.5, -0.5, points[:, 2].min()])
    return _fitted(points, low, np.array([0.5, 0.5, 1.0])), normals, uvs, faces


def _broadleaf(kind: int) -> list[Clump]:
    found: list[Clump] = [(0.0, 0.0, 0.79, 0.33, 0.18)]
    for k in range(4):
        s, c = exact.sin_cos_deg(90.0 * k + 30.0 * noise(kind, 10 + k))
        out = 0.26 * (1 + 0.2 * noise(kind, 20 + k))
        found.append((out * c, out * s, 0.6 + 0.08 * noise(kind, 30 + k), 0.22 + 0.03 * noise(kind, 40 + k), 0.135))
    return found


def _conifer(kind: int) -> list[Clump]:
    tiers = 6
    return [
        (0.015 * noise(kind, k), 0.015 * noise(kind, 9 + k), 0.2 + 0.13 * k, 0.46 * (1 - k / (tiers + 0.6)), 0.13)
        for k in range(tiers)
    ]


def _poplar(kind: int) -> list[Clump]:
    widths = (0.3, 0.42, 0.4, 0.27)
    return [(0.04 * noise(kind, k), 0.04 * noise(kind, 9 + k), 0.27 + 0.19 * k, w, 0.16) for k, w in enumerate(widths)]


def _foliage(clumps: Sequence[Clump], key: int, middle: Array, sprays: int) -> tuple[Array, Array, Array, Index]:
    """Smooth clumps and the sprays on them, as one mesh; normals lean away from the middle and from each clump's."""
    points, faces = icosphere(1)
    all_points, all_outs, all_faces = [], [], []
    count = 0
    for n, (x, y, z, wide, tall) in enumerate(clumps):
        centre, radii = np.array([x, y, z]), np.array([wide, wide, tall])
        ragged = np.array([0.9 + 0.1 * noise(key + 977 * n, k) for k in range(len(points))])
        spots, outs, quads = _sprays(points, key + 977 * n, sprays)
        all_points += [points * ragged[:, None] * radii + centre, spots * radii + centre]
        all_outs += [points, outs]
        all_faces += [faces + count, quads + count + len(points)]
        count += len(points) + len(spots)
    p, out = np.concatenate(all_points), np.concatenate(all_outs)
    away = unit(p - middle)
    normals = unit(0.55 * out + 0.45 * away + np.array([0.0, 0.0, 0.12]))
    low, high = p.min(0), p.max(0)
    reach = (p - middle) / np.maximum(high - middle, middle - low)
    shell = np.minimum(1.0, np.sqrt(reach[:, 0] * reach[:, 0] + reach[:, 1] * reach[:, 1] + reach[:, 2] * reach[:, 2]))
    under = np.clip(0.5 + 0.6 * out[:, 2], 0.0, 1.0)
    sky = np.clip(0.25 + 0.45 * shell * shell + 0.4 * under, 0.0, 1.0)
    uvs = np.stack([shell, sky], axis=1)
    return p, normals, uvs, np.concatenate(all_faces)


def _sprays(points: Array, key: int, count: int) -> tuple[Array, Array, Index]:
    """Leafy kites that stand out of a unit ball at every angle: corners [4 count, 3], outward directions, faces."""
    spots, outs = [], []
    for k in range(count):
        place = unit(np.array([[noise(key, 100 + 3 * k + axis) for axis in range(3)]]))[0]
        tilt = unit((place + [0.75 * noise(key, 400 + 3 * k + axis) for axis in range(3)])[None])[0]
        side = unit(cross(tilt, np.array([0.3 * noise(key, 700 + k), 0.2, 1.0]))[None])[0]
        up, size = cross(tilt, side), 0.34 + 0.12 * noise(key, 800 + k)
        at = place * (0.96 + 0.12 * noise(key, 900 + k))
        spots += [
            at - size * up,
            at + size * (0.7 * side + 0.1 * up),
            at + 1.25 * size * up,
            at - size * (0.7 * side - 0.2 * up),
        ]
        outs += [place] * 4
    first = 4 * np.arange(count, dtype=np.int64)[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return np.array(spots), np.array(outs), faces


def bush(b: Builder, e: Element) -> None:
    """A round bush on its base centre."""
    x, y, z = e.size
    _shrub(b, int(e.shape["key"]), np.array([0.0, 0.0, 0.0]), np.array([x, y, z]))


def _shrub(b: Builder, key: int, foot: Array, size: Array) -> None:
    """Three clumps within a box that stands on `foot`."""
    points, normals, uvs, faces = _shrub_shape(key % 6)
    b.add(_LEAVES, points * size + foot, unit(normals / size), uvs, faces)


@cache
def _shrub_shape(kind: int) -> tuple[Array, Array, Array, Index]:
    clumps: list[Clump] = []
    for k in range(3):
        s, c = exact.sin_cos_deg(120.0 * k + 50.0 * noise(kind, k))
        clumps.append((0.17 * c, 0.17 * s, 0.42 + 0.1 * noise(kind, 5 + k), 0.26, 0.38))
    points, normals, uvs, faces = _foliage(clumps, kind + 311, np.array([0.0, 0.0, 0.3]), 20)
    points = points * np.array([1.0, 1.0, 1.0])
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    return _fitted(points, np.array([-0.5, -0.5, 0.0]), np.array([0.5, 0.5, 1.0])), normals, uvs, faces


def _fitted(points: Array, low: Array, high: Array) -> Array:
    """Points scaled along each axis so that they fill the box."""
    a, z = points.min(0), points.max(0)
    fitted: Array = (points - a) / (z - a) * (high - low) + low
    return fitted


def hedge(b: Builder, e: Element) -> None:
    """A clipped hedge along y: a rounded bar of leaves."""
    thick, length, height = e.size
    key, count = int(e.shape["key"]), max(2, int(length / 0.8 + 0.5))
    profile = [(1.0, 0.0), (1.0, 0.12), (1.04, 0.5), (1.0, 0.86), (0.8, 0.97), (0.0, 1.0)]
    profile += [(-x, z) for x, z in profile[-2::-1]]
    rings, sky = [], []
    for k in range(count + 1):
        y, end = length * (k / count - 0.5), 0.9 if k in (0, count) else 1.0
        ring = []
        for n, (x, z) in enumerate(profile):
            rough = 0.04 * noise(key, 40 * k + n)
            ring.append((0.45 * thick * x * (end + rough), y, 0.96 * height * z * (1.0 + 0.5 * rough)))
            sky.append((0.0, 0.35 + 0.65 * z))
        rings.append(ring)
    p = np.array(rings)
    b.grid(_LEAVES, p[:, ::-1], closed=False, crease=0.0)
    for ring, sign in ((p[0], 1), (p[-1], -1)):
        b.fan(_LEAVES, [tuple(q) for q in ring[::sign]])


def planter(b: Builder, e: Element) -> None:
    """A stone tub with a shrub in it."""
    x, y, height = e.size
    rim = 0.55 * height
    b.grid(_POT, _square([(0.0, 0.84), (0.82, 0.94), (0.82, 1.0), (1.0, 1.0), (1.0, 0.86), (0.88, 0.86)], x, y, rim))
    low, inner = 0.88 * rim, 0.43
    b.quads(
        _SOIL,
        [
            [
                (-inner * x, -inner * y, low),
                (inner * x, -inner * y, low),
                (inner * x, inner * y, low),
                (-inner * x, inner * y, low),
            ]
        ],
    )
    _shrub(b, int(e.shape["key"]), np.array([0.0, 0.0, low]), np.array([0.92 * x, 0.92 * y, height - low]))


def _square(profile: Sequence[tuple[float, float]], x: float, y: float, height: float) -> Array:
    """Square rings of a tub from (share of the height, share of the width) pairs."""
    corners = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    return np.array([[(k * x * cx, k * y * cy, z * height) for cx, cy in corners] for z, k in profile])
