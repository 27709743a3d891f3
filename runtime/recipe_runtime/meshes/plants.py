"""Plants below trees: clipped hedges, bushes, and planters with flowers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, lattice, level, noises
from recipe_runtime.meshes.foliage import Clumps, Growth, Leaves, fitted, foliage, kites, spiral
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.vectors import Array, Index, unit

_LEAVES = Surface("leaves", Pattern.FOLIAGE, Tag.VEGETATION)
_FLOWERS = Surface("flowers", Pattern.FOLIAGE, Tag.VEGETATION)
_SOIL = Surface("soil", Pattern.BARK, Tag.TERRAIN)
_POT = Surface("pot", Pattern.CONCRETE, Tag.STATIC)
_TWIGS = Growth(1, 0.19, 0.0, 0.62, 0.5, 0.8, -0.2)
_FAR_TWIGS = Growth(1, 0.34, 0.0, 0.7, 0.5, 0.8, -0.2)
_PETALS = Growth(1, 0.07, 0.0, 0.9, 0.25, 0.7, -0.5)


def bush(b: Builder, e: Element) -> None:
    """Build a round bush centred on the origin."""
    _shrub(b, int(e.shape["key"]), np.zeros(3), np.array(e.size))


def _shrub(b: Builder, key: int, foot: Array, size: Array) -> None:
    """Add a shrub that fills a box whose base centre is `foot`."""
    leaves = _shrub_shape(key % 6)
    b.add(_LEAVES, leaves.points * size + foot, unit(leaves.normals / size), leaves.uvs, leaves.triangles)


@cache
def _shrub_shape(kind: int) -> Leaves:
    aim = spiral(7, kind + 311, -0.3, 1.0)
    centres = aim * np.array([0.27, 0.27, 0.26]) + np.array([0.0, 0.0, 0.4])
    radius = (0.21 + 0.04 * noises(kind, 40 + np.arange(7)))[:, None]
    clumps = Clumps(centres, radius * np.array([1.0, 1.0, 1.1]))
    leaves = foliage(clumps, Growth(44, 0.12, 0.7, 0.6, 0.6, 0.8, -0.2), kind + 311, np.array([0.0, 0.0, 0.3]))
    leaves = fitted(leaves, np.array([-0.5, -0.5, -0.35]), np.array([0.5, 0.5, 1.0]))
    leaves.points[:, 2] = np.maximum(leaves.points[:, 2], 0.0)  # flatten the base: it must not stand on a point
    return leaves


def hedge(b: Builder, e: Element) -> None:
    """Build a clipped hedge along y: an uneven, rounded bar, covered with twigs, some of which protrude."""
    thick, length, height = e.size
    key, count = int(e.shape["key"]), max(2, int(length / 0.6 + 0.5))
    profile = [(1.0, 0.0), (1.02, 0.4), (1.0, 0.8), (0.82, 0.96), (0.0, 1.0)]
    profile = [*profile, *((-x, z) for x, z in profile[-2::-1])]
    columns = len(profile)
    rough = 1.0 + 0.06 * noises(key, np.arange((count + 1) * columns)).reshape(count + 1, columns)
    wave = 1.0 + 0.03 * noises(key, 90_000 + np.arange(count + 1))[:, None]
    ring = np.array(profile)
    x = 0.42 * thick * ring[:, 0] * rough
    z = 0.93 * height * ring[:, 1] * rough * wave
    y = 0.94 * length * (np.arange(count + 1) / count - 0.5)[:, None] * np.ones(columns)
    bar = np.stack([x, y, z], axis=2)[::-1]
    ends = [np.stack([0.6 * bar[k, :, 0], bar[k, :, 1] + 0.03 * length * s, 0.9 * bar[k, :, 2]], axis=1)
            for k, s in ((0, 1), (count, -1))]  # fmt: skip
    closing = [end * np.array([0.02, 1.0, 1.0]) for end in ends]
    rings = np.concatenate([[closing[0], ends[0]], bar, [ends[1], closing[1]]])
    hull: Array = rings.reshape(-1, 3)
    out = unit((hull - np.array([0.0, 0.0, 0.45 * height])) * np.array([1.0, 0.3 / length, 1.0]))
    faces = lattice(len(rings), columns, False)
    sky = np.stack([np.full(len(hull), -0.1), 0.2 + 0.35 * hull[:, 2] / height], axis=1)
    b.add(_LEAVES, hull, out, sky, faces)
    half = np.array([thick / 2, length / 2, height])
    near = 24.0 + 0.5 * length
    for first, last, dense, growth in ((0.0, near, 17, _TWIGS), (near, math.inf, 4, _FAR_TWIGS)):
        with b.level(first, last, anchor=(0.0, 0.0, 0.5 * height), casts=growth is _FAR_TWIGS):
            k = np.arange(int(dense * length * (height + 0.5 * thick)))
            at, leaning = _scattered(hull, out, faces, key, k)
            spots, hue, quads = kites(at, leaning, growth, key)
            spots = np.minimum(np.maximum(spots, half * np.array([-1.0, -1.0, 0.0])), half)
            uvs = np.stack([hue, 0.3 + 0.6 * spots[:, 2] / height], axis=1)
            b.add(_LEAVES, spots, np.repeat(leaning, 4, axis=0), uvs, quads)


def _scattered(points: Array, out: Array, faces: Index, key: int, k: Index) -> tuple[Array, Array]:
    """Return points on a surface [N, 3], in the order of its faces, and their normals [N, 3]."""
    face = faces[((k + 0.5 + 0.49 * noises(key, k)) * len(faces) / len(k)).astype(np.int64)]
    share = np.stack([1.02 + noises(key, 8 * k + 1000 + n) for n in range(3)], axis=1)
    share = share / (share[:, 0] + share[:, 1] + share[:, 2])[:, None]
    at, normal = (sum(values[face[:, n]] * share[:, n : n + 1] for n in range(3)) for values in (points, out))
    return np.asarray(at), unit(np.asarray(normal))


def planter(b: Builder, e: Element) -> None:
    """Build a stone tub with a shrub and flowers at its foot."""
    x, y, height = e.size
    key, rim = int(e.shape["key"]), 0.55 * height
    b.grid(_POT, _square([(0.0, 0.84), (0.82, 0.94), (0.82, 1.0), (1.0, 1.0), (1.0, 0.86), (0.88, 0.86)], x, y, rim))
    low, inner = 0.88 * rim, 0.43
    b.quads(_SOIL, [level(-inner * x, inner * x, -inner * y, inner * y, low)])
    _shrub(b, key, np.array([0.0, 0.0, low]), np.array([0.8 * x, 0.8 * y, height - low]))
    k = np.arange(60)
    spots = np.stack(
        [0.42 * x * noises(key, 500 + k), 0.42 * y * noises(key, 600 + k), rim + 0.06 * noises(key, 700 + k)]
    )
    outer = np.maximum(np.abs(spots[0]) / x, np.abs(spots[1]) / y)
    spots[2] += (0.42 - outer) * 0.5 * (height - low)
    up = unit(np.stack([0.5 * spots[0] / x, 0.5 * spots[1] / y, 0 * spots[2] + 0.4], axis=1))
    corners, hue, faces = kites(spots.T, up, _PETALS, key)
    corners[:, 2] = np.minimum(corners[:, 2], height)
    b.add(_FLOWERS, corners, np.repeat(up, 4, axis=0), np.stack([hue, 0.8 + 0.4 * hue], axis=1), faces)


def _square(profile: Sequence[tuple[float, float]], x: float, y: float, height: float) -> Array:
    """Return square rings of a tub from pairs of relative height and relative width."""
    corners = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    return np.array([[(k * x * cx, k * y * cy, z * height) for cx, cy in corners] for z, k in profile])
