"""Foliage: clumps of leafy sprays around dark cores, with gaps between the clumps.

A spray is a bent kite of two triangles. All normals point away from the middle of their clump and of the crown, so that
shading is smooth and no facets are visible. The u of leaves is a random number of each spray in [-0.5, 0.5), by which
its green varies; v is the visible fraction of the sky: 1 at the outer top of the crown, less towards its middle and its
underside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.meshes.builder import icosphere, noises
from recipe_runtime.meshes.vectors import Array, Index, cross, unit


@dataclass(frozen=True)
class Leaves:
    """Triangles of leaves: vertices [N, 3], unit normals [N, 3], uv [N, 2], triangles [T, 3]."""

    points: Array
    normals: Array
    uvs: Array
    triangles: Index


@dataclass(frozen=True)
class Clumps:
    """Ellipsoids that sprays cover: centres [K, 3], radii [K, 3]."""

    centres: Array
    radii: Array


@dataclass(frozen=True)
class Growth:
    """How sprays grow: their number for a clump, their length, and what their tips follow."""

    count: int
    length: float
    core: float = 0.0  # radius of a clump's dark core, relative to the clump; 0: none
    width: float = 0.55  # of a spray, relative to its length
    outwards: float = 0.7
    turn: float = 0.9  # by chance
    droop: float = 0.2  # downwards


def foliage(clumps: Clumps, growth: Growth, key: int, middle: Array) -> Leaves:
    """Return the leaves of a crown.

    Args:
        clumps: its clumps.
        growth: how many sprays it has, and of which form.
        key: selects a variation.
        middle: the point [3] from which the crown grows; it is darkest there.
    """
    kinds = [_sprays(clumps, growth, key)]
    if growth.core > 0.0:
        kinds.append(_cores(clumps, growth.core, key))
    firsts = np.cumsum([0, *(len(points) for points, *_ in kinds)])
    triangles = np.concatenate([faces + first for (*_, faces), first in zip(kinds, firsts, strict=False)])
    points, out, depth, hue = (np.concatenate([kind[n] for kind in kinds]) for n in range(4))
    away = unit((points - middle) * np.array([1.0, 1.0, 0.6]))
    normals = unit(0.6 * out + 0.55 * away + np.array([0.0, 0.0, 0.1]))
    reach = (points - middle) / np.maximum(points.max(0) - middle, middle - points.min(0))
    shell = np.minimum(1.0, reach[:, 0] * reach[:, 0] + reach[:, 1] * reach[:, 1] + reach[:, 2] * reach[:, 2])
    sky = (0.25 + 0.3 * shell + 0.5 * np.clip(0.45 + 0.6 * normals[:, 2], 0.0, 1.0)) * depth
    return Leaves(points, normals, np.stack([hue, np.clip(sky, 0.0, 1.0)], axis=1), triangles)


def _directions(key: int, first: int, count: int) -> Array:
    """Return unit vectors in all directions [count, 3]."""
    n = 3 * np.arange(count)
    return unit(np.stack([noises(key, first + n + axis) for axis in range(3)], axis=1))


def _sprays(clumps: Clumps, growth: Growth, key: int) -> tuple[Array, Array, Array, Array, Index]:
    """Return corners, outward directions, depths in [0, 1], hues and triangles of all sprays."""
    total = len(clumps.centres) * growth.count
    centres, radii = (np.repeat(a, growth.count, axis=0) for a in (clumps.centres, clumps.radii))
    aim = _directions(key, 0, total)
    shell = 0.7 + 0.32 * noises(key, 8 * total + np.arange(total))
    out = unit(aim / radii)
    corners, hue, faces = kites(centres + aim * radii * shell[:, None], out, growth, key)
    depth = np.stack([0.6 * shell, shell, 1.1 * shell, shell], axis=1).reshape(-1)
    return corners, np.repeat(out, 4, axis=0), depth, hue, faces


def kites(at: Array, out: Array, growth: Growth, key: int) -> tuple[Array, Array, Index]:
    """Return bent kites, one at each point: corners [4 N, 3], hues [4 N] and triangles [2 N, 3].

    Args:
        at: their middles [N, 3].
        out: unit vectors away from the plant [N, 3].
        growth: their form.
        key: selects a variation.
    """
    total, k = len(at), np.arange(len(at))
    tip = unit(
        growth.outwards * out + growth.turn * _directions(key, 4 * total, total) - np.array([0, 0, growth.droop])
    )
    side = unit(cross(tip, out + 0.8 * _directions(key, 12 * total, total)))
    up = cross(side, tip)
    facing = up[:, 0] * out[:, 0] + up[:, 1] * out[:, 1] + up[:, 2] * out[:, 2]
    back = np.where(facing > 0.2, -1.0, 1.0)[:, None]  # most face outwards, and some of those on edge inwards
    side, up = back * side, -back * up
    long = (growth.length * (1.0 + 0.35 * noises(key, 9 * total + k)))[:, None]
    wide, skew = growth.width * 0.5 * long, (0.16 * noises(key, 10 * total + k))[:, None]
    corners = [
        at - 0.5 * long * tip,
        at + wide * side + (0.05 + skew) * long * tip - 0.12 * long * up,
        at + 0.55 * long * tip - 0.1 * long * up,
        at - wide * side + (0.1 - skew) * long * tip - 0.12 * long * up,
    ]
    hue = np.repeat(0.5 * noises(key, 11 * total + k), 4)
    quads = 4 * k[:, None]
    faces = np.stack([quads + np.array([0, 1, 2]), quads + np.array([0, 2, 3])], axis=1).reshape(-1, 3)
    return np.stack(corners, axis=1).reshape(-1, 3), hue, faces


def _cores(clumps: Clumps, share: float, key: int) -> tuple[Array, Array, Array, Array, Index]:
    """Return the dark, closed cores of the clumps, as `_sprays` returns the sprays."""
    sphere, faces = icosphere(0)
    count, n = len(clumps.centres), len(sphere)
    bulge = (share * (1.0 + 0.22 * noises(key, 700_000 + np.arange(count * n)))).reshape(count, n, 1)
    points = clumps.centres[:, None] + sphere * bulge * clumps.radii[:, None]
    out = np.broadcast_to(sphere, (count, n, 3)).reshape(-1, 3)
    all_faces = (faces + n * np.arange(count)[:, None, None]).reshape(-1, 3)
    depth, hue = np.full(count * n, 0.15), np.full(count * n, -0.1)
    return points.reshape(-1, 3), out, depth, hue, all_faces


def fitted(leaves: Leaves, low: Array, high: Array) -> Leaves:
    """Return leaves translated and scaled along each axis so that they fill a box."""
    start, end = leaves.points.min(0), leaves.points.max(0)
    scale = (high - low) / (end - start)
    return Leaves((leaves.points - start) * scale + low, unit(leaves.normals / scale), leaves.uvs, leaves.triangles)


def spiral(count: int, key: int, first: float = -1.0, last: float = 1.0) -> Array:
    """Return unit vectors evenly spread about z, with heights from `first` to `last`: [count, 3]."""
    found = []
    jitter = noises(key, np.arange(2 * count)).tolist()
    for k in range(count):
        z = first + (last - first) * (k + 0.5 + 0.3 * jitter[k]) / count
        s, c = exact.sin_cos_deg(137.508 * k + 25.0 * jitter[count + k])
        wide = math.sqrt(max(0.0, 1.0 - z * z))
        found.append((wide * c, wide * s, z))
    return np.array(found)
