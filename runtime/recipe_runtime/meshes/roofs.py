"""Roofs: tiled gable and hip roofs, chimneys, dormers, and flat roofs with parapets and rooftop equipment.

All cover a block from x = 0 back to -depth, whose size is (depth, width, height of the eaves).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recipe_runtime.meshes.builder import Builder, Vec, level, noise
from recipe_runtime.meshes.facades import Facade, Quad, pane_uv, surface
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.vectors import cross, unit

_TILES = surface("roof", Pattern.ROOF)
_EDGE = surface("trim", Pattern.PLAIN)
_SOFFIT = surface("trim", Pattern.NICHE)
_STACK = surface("base", Pattern.BRICK)
_FLAT = surface("roof", Pattern.CONCRETE)
_PLANT = surface("metal", Pattern.CLAPBOARD)
_HEAD = surface("base", Pattern.PLASTER)
_PANE = surface("window", Pattern.WINDOW)
_THICK = 0.14
_PARAPET = 0.85

Size = tuple[float, float, float]


def slope(b: Builder, surface: Surface, corners: Sequence[Vec]) -> None:
    """Add a tiled plane of three or four corners, the first two along its lower edge.

    Uv in metres along and up the slope.
    """
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
    """Add a gable roof, its ridge along y or, if the gable faces the street, along x.

    `ends` is the overhang at the gables.
    """
    depth, width, height = size
    half, length = (depth / 2, width / 2) if along_y else (width / 2, depth / 2)
    reach, rise = length + (eaves if ends < 0 else ends), pitch * half
    low = height - pitch * eaves

    def at(across: float, along: float, z: float) -> tuple[float, float, float]:
        return (across - depth / 2, along, z) if along_y else (along - depth / 2, -across, z)

    for s in (1, -1):
        outer, t = s * (half + eaves), _THICK
        foot, ridge = ((outer, -s * reach), (outer, s * reach)), ((0.0, s * reach), (0.0, -s * reach))
        top = height + rise
        slope(b, _TILES, [*(at(*place, low + t) for place in foot), *(at(*place, top + t) for place in ridge)])
        below = [*(at(*place, low) for place in foot), *(at(*place, top) for place in ridge)][::-1]
        b.quads(_SOFFIT, [below], np.array([[(0, 1), (0, 1), (0, 0.3), (0, 0.3)]]))
        b.quads(_EDGE, [[at(*foot[0], low), at(*foot[1], low), at(*foot[1], low + t), at(*foot[0], low + t)]])
        _gutter(b, [at(outer + s * d, x, low + z) for x in (-reach, reach) for d, z in _CHANNEL], s)
        for a, c in ((foot[1], ridge[0]), (ridge[1], foot[0])):
            za, zc = (low, top) if a in foot else (top, low)
            b.quads(_EDGE, [[at(*a, za), at(*c, zc), at(*c, zc + t), at(*a, za + t)]])
        end = s * length
        triangle = [at(-s * -half, end, height), at(-s * half, end, height), at(0.0, end, top)]
        b.fan(wall, triangle)


_CHANNEL = ((0.0, 0.02), (0.03, -0.05), (0.1, -0.05), (0.13, 0.06))  # outwards and up, metres


def _gutter(b: Builder, ends: list[Vec], sign: int) -> None:
    """Add a gutter between two ends of four points each, seen from outside and from above."""
    quads = [[ends[k], ends[4 + k], ends[5 + k], ends[1 + k]] for k in range(3)]
    outside = quads if sign > 0 else [q[::-1] for q in quads]
    b.quads(_EDGE, outside)
    b.quads(_EDGE, [q[::-1] for q in outside])


def hip(b: Builder, size: Size, pitch: float, eaves: float) -> None:
    """Add a hip roof."""
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
        ox, oy = (cy - ay) / abs(cx - ax + cy - ay), (ax - cx) / abs(cx - ax + cy - ay)
        _gutter(b, [(x + d * ox, y + d * oy, low + z) for x, y in ((ax, ay), (cx, cy)) for d, z in _CHANNEL], 1)
    soffit = [(fx, fy, low) for fx, fy in feet[::-1]]
    b.quads(_SOFFIT, [soffit], np.array([[(0, 1)] * 4]))


def chimney(b: Builder, size: Size, pitch: float, key: int, along_y: bool = True) -> None:
    """Add a chimney near the ridge, which runs along y or along x, with a cap and two pots."""
    depth, width, height = size
    top = height + pitch * (depth if along_y else width) / 2 + 0.7
    beside, along = 0.12 * noise(key, 11), 0.28 if noise(key, 12) > 0 else -0.28
    x, y = (beside * depth, along * width) if along_y else (along * depth, beside * width)
    x -= depth / 2
    b.box(_STACK, (x - 0.35, y - 0.45, height), (x + 0.35, y + 0.45, top), "-z +z")
    b.box(_EDGE, (x - 0.42, y - 0.52, top), (x + 0.42, y + 0.52, top + 0.1))
    for s in (1, -1):
        b.box(_STACK, (x - 0.12, y + s * 0.22 - 0.12, top + 0.1), (x + 0.12, y + s * 0.22 + 0.12, top + 0.45), "-z")


@dataclass(frozen=True)
class Top:
    """The top of a building: its size, its key, its four facades, the free facades, and the surface of its walls."""

    size: Size
    key: int
    facades: tuple[Facade, Facade, Facade, Facade]
    free: tuple[Facade, ...]
    wall: Surface


def flat_roof(b: Builder, top: Top) -> None:
    """Add a parapet with a coping, a cornice, and rooftop equipment."""
    (depth, _, height), half = top.size, top.size[1] / 2
    rim = height + _PARAPET
    for f in top.facades:
        b.quads(top.wall, [f.face(0, f.width, height, rim), f.face(0.3, f.width - 0.3, height, rim, -0.3)[::-1]])
        b.quads(_EDGE, f.block((-0.06, f.width + 0.06), (-0.36, 0.08), (rim, rim + 0.1)))
        b.quads(_EDGE, [f.face(-0.06, f.width + 0.06, rim, rim + 0.1, -0.36)[::-1]])
    _cornice(b, top, height)
    b.quads(_FLAT, [level(-depth, 0, -half, half, height)])
    if noise(top.key, 7) > -0.3:
        aside = noise(top.key, 8) * (half - 2.5)
        b.box(_HEAD, (-depth + 1.5, aside - 1.5, height), (-depth + 4.5, aside + 1.5, height + 2.5), "-z")
        b.box(_EDGE, (-depth + 1.4, aside - 1.6, height + 2.5), (-depth + 4.6, aside + 1.6, height + 2.62))
    for n in range(2):
        if noise(top.key, 60 + n) > 0.1:
            x, y = -depth * (0.4 + 0.1 * noise(top.key, 62 + n)), (half - 2.0) * noise(top.key, 64 + n)
            wide = 0.7 + 0.3 * noise(top.key, 66 + n)
            b.box(_PLANT, (x - wide, y - 1.0, height + 0.2), (x + wide, y + 1.0, height + 1.5))


def _cornice(b: Builder, top: Top, height: float) -> None:
    """Add stepped mouldings below the parapet of every free facade."""
    reach = 0.32 + 0.12 * noise(top.key, 9)
    front = top.facades[0]
    quads: list[Quad] = []
    for f in top.free:
        ends = (-reach * (top.facades[2] in top.free), f.width + reach * (top.facades[1] in top.free))
        u0, u1 = ends if f is front else (0.0, f.width)
        for low, high, d in ((-0.38, -0.14, 0.35), (-0.14, 0.04, 0.7), (0.04, 0.18, 1.0)):
            quads += f.block((u0, u1), (0.0, d * reach), (height + low, height + high), top=d == 1.0)
    b.quads(_EDGE, quads)


def pitched_roof(b: Builder, top: Top, pitch: float) -> None:
    """Add a tiled gable roof with dormers in the front slope, and chimneys."""
    _, width, height = top.size
    _cornice(b, top, height)
    gable(b, top.size, pitch, 0.3, top.wall, along_y=True, ends=0.06)
    chimney(b, top.size, pitch, top.key)
    f, count = top.facades[0], max(1, int(width / 4.5))
    for k in range(count):
        _dormer(b, f, (k + 0.5) * width / count, height, pitch, (f.key + k, 90))


def _dormer(b: Builder, f: Facade, u: float, eaves: float, pitch: float, name: tuple[int, int]) -> None:
    """Add a dormer window with a small roof to the front slope."""
    back, low = -1.1, eaves + pitch * 1.1 + _THICK
    z0, z1, w = low + 0.1, low + 1.35, 0.62
    deep = back - (z1 + 0.1 - low) / pitch
    b.quads(_EDGE, [f.face(u - w - 0.12, u + w + 0.12, low - 0.1, z1 + 0.1, back)])
    b.quads(_PANE, [f.face(u - w, u + w, z0, z1, back + 0.01)], pane_uv([name]))
    b.quads(_EDGE, [f.side(u + s * (w + 0.12), (deep, back), (low - 0.1, z1 + 0.1), s) for s in (1, -1)])
    rise = z1 + 0.1
    for s in (1, -1):
        eave = [f.at(u + s * (w + 0.25), back + 0.15, rise), f.at(u + s * (w + 0.25), deep, rise)]
        ridge = [f.at(u, deep - 0.4, rise + 0.42), f.at(u, back + 0.15, rise + 0.42)]
        corners = [*eave, *ridge] if s > 0 else [eave[1], eave[0], ridge[1], ridge[0]]
        slope(b, _TILES, corners)
        b.quads(_SOFFIT, [corners[::-1]], np.array([[(0.0, 0.9)] * 4]))
    peak = [f.at(u - w - 0.12, back, rise), f.at(u + w + 0.12, back, rise), f.at(u, back, rise + 0.36)]
    b.fan(_EDGE, peak)
