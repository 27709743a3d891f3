"""Roofs: gables, hips and mansards with tiles, chimneys, and parapets with what stands behind them.

All cover a block that reaches from x = 0 back to -depth, its size (depth, width, height of the eaves).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from recipe_runtime.meshes.builder import Builder, Vec, cross, noise, unit
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.tags import Tag

_TILES = Surface("roof", Pattern.ROOF, Tag.BUILDINGS)
_EDGE = Surface("trim", Pattern.PLAIN, Tag.BUILDINGS)
_SOFFIT = Surface("trim", Pattern.NICHE, Tag.BUILDINGS)
_STACK = Surface("base", Pattern.BRICK, Tag.BUILDINGS)
_THICK = 0.14

Size = tuple[float, float, float]


def slope(b: Builder, surface: Surface, corners: Sequence[Vec]) -> None:
    """A tiled plane of three or four corners, the first two along its lower edge; uv in metres along it and up it."""
    p = np.array(corners if len(corners) == 4 else [*corners, corners[2]], np.float64)
    along = p[1] - p[0]
    along = along / math.sqrt(float((along * along).sum()))
    across = p - p[0]
    u = (across * along).sum(axis=1)
    up = across - u[:, None] * along
    v = np.sqrt((up * up).sum(axis=1))
    uv = np.stack([u, v], axis=1)
    if len(corners) == 4:
        b.quads(surface, p[None], uv[None])
        return
    normal = unit(cross(p[1] - p[0], p[2] - p[0])[None])
    b.add(surface, p[:3], np.repeat(normal, 3, axis=0), uv[:3], np.array([[0, 1, 2]], np.int64))


def gable(
    b: Builder, size: Size, pitch: float, eaves: float, wall: Surface, *, along_y: bool, ends: float = -1.0
) -> None:
    """A roof with two slopes; its ridge runs along y or, towards the street, along x. `ends`: reach over the gables."""
    depth, width, height = size
    half, length = (depth / 2, width / 2) if along_y else (width / 2, depth / 2)
    reach, rise = length + (eaves if ends < 0 else ends), pitch * half
    low = height - pitch * eaves

    def at(across: float, along: float, z: float) -> tuple[float, float, float]:
        return (across - depth / 2, along, z) if along_y else (along - depth / 2, -across, z)

    for s in (1, -1):
        outer, t = s * (half + eaves), _THICK
        foot, ridge = ((outer, -s * reach), (outer, s * reach)), ((0.0, s * reach), (0.0, -s * reach))
        slope(
            b,
            _TILES,
            [
                at(*foot[0], low + t),
                at(*foot[1], low + t),
                at(*ridge[0], height + rise + t),
                at(*ridge[1], height + rise + t),
            ],
        )
        below = [at(*foot[0], low), at(*foot[1], low), at(*ridge[0], height + rise), at(*ridge[1], height + rise)][::-1]
        b.quads(_SOFFIT, [below], np.array([[(0, 1), (0, 1), (0, 0.3), (0, 0.3)]]))
        b.quads(_EDGE, [[at(*foot[0], low), at(*foot[1], low), at(*foot[1], low + t), at(*foot[0], low + t)]])
        for a, c in ((foot[1], ridge[0]), (ridge[1], foot[0])):
            za, zc = (low, height + rise) if a in foot else (height + rise, low)
            b.quads(_EDGE, [[at(*a, za), at(*c, zc), at(*c, zc + t), at(*a, za + t)]])
        end = s * length
        triangle = [at(-s * -half, end, height), at(-s * half, end, height), at(0.0, end, height + rise)]
        b.fan(wall, triangle)


def hip(b: Builder, size: Size, pitch: float, eaves: float) -> None:
    """A roof that slopes to all four sides."""
    depth, width, height = size
    low, half = height - pitch * eaves, min(depth, width) / 2 + eaves
    top = low + pitch * half
    x0, x1, y = -depth - eaves, eaves, width / 2 + eaves
    feet = [(x1, -y), (x1, y), (x0, y), (x0, -y)]
    ridge = [(x1 - half, -y + half), (x1 - half, y - half), (x0 + half, y - half), (x0 + half, -y + half)]
    t = _THICK
    for k in range(4):
        (ax, ay), (cx, cy), (px, py), (qx, qy) = feet[k], feet[(k + 1) % 4], ridge[(k + 1) % 4], ridge[k]
        corners = [(ax, ay, low + t), (cx, cy, low + t), (px, py, top + t)]
        if abs(px - qx) + abs(py - qy) > 1e-6:
            corners.append((qx, qy, top + t))
        slope(b, _TILES, corners)
        b.quads(_EDGE, [[(ax, ay, low), (cx, cy, low), (cx, cy, low + t), (ax, ay, low + t)]])
    soffit = [(fx, fy, low) for fx, fy in feet[::-1]]
    b.quads(_SOFFIT, [soffit], np.array([[(0, 1)] * 4]))


def chimney(b: Builder, size: Size, pitch: float, key: int) -> None:
    """A stack near the ridge, with a cap and two pots."""
    depth, width, height = size
    top = height + pitch * min(depth, width) / 2 + 0.7
    x, y = -depth / 2 + 0.16 * depth * noise(key, 11), 0.3 * width * (1 if noise(key, 12) > 0 else -1)
    b.box(_STACK, (x - 0.35, y - 0.45, height), (x + 0.35, y + 0.45, top), "-z +z")
    b.box(_EDGE, (x - 0.42, y - 0.52, top), (x + 0.42, y + 0.52, top + 0.1))
    for s in (1, -1):
        b.box(_STACK, (x - 0.12, y + s * 0.22 - 0.12, top + 0.1), (x + 0.12, y + s * 0.22 + 0.12, top + 0.45), "-z")
