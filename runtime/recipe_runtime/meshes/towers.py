"""Tall buildings of a skyline: few triangles, with windows drawn by patterns, in four shapes.

A tower is centred on the origin and fills its size; the key selects a slab, a stepped, a glass or a crowned tower.
"""

from __future__ import annotations

import numpy as np
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, Vec, noise
from recipe_runtime.meshes.mesh import Pattern, Surface

_WALL = Surface("wall", Pattern.CONCRETE, Tag.BUILDINGS)
_FACADE = Surface("window", Pattern.FACADE, Tag.BUILDINGS)
_GLASS = Surface("window", Pattern.CURTAIN_WALL, Tag.BUILDINGS)
_STOREY, _BAY = 3.5, 3.2
_SLAB, _STEPS, _SHAFT, _CROWN = range(4)


def tower(b: Builder, e: Element) -> None:
    """Build a distant building: rows of windows on all sides, and a roof with rooftop equipment."""
    depth, width, height = e.size
    key = int(e.shape["key"])
    shape = key % 4
    x, y = depth / 2, width / 2
    plant = 0.05 * height + 1.5
    body = height - plant
    skin = _GLASS if shape == _SHAFT or noise(key, 5) > 0.6 else _FACADE
    if shape == _SLAB:
        tiers = [(1.0, 0.0, body)]
    elif shape == _STEPS:
        tiers = [(1.0, 0.0, 0.55 * body), (0.78, 0.55 * body, 0.82 * body), (0.56, 0.82 * body, body)]
    elif shape == _SHAFT:
        tiers = [(1.0, 0.0, min(9.0, 0.3 * body)), (0.86, min(9.0, 0.3 * body), body)]
    else:
        tiers = [(1.0, 0.0, 0.86 * body), (0.82, 0.86 * body, body)]
    for share, low, high in tiers:
        _tier(b, skin, (share * x, share * y), (low, high), key)
    share = tiers[-1][0]
    _box(b, (0.55 * share * x, 0.5 * share * y), (body, height - 0.35 * plant))
    if shape in (_STEPS, _SHAFT):
        _box(b, (0.12 * share * x, 0.1 * share * y), (height - 0.35 * plant, height))
    else:
        _box(b, (0.3 * share * x, 0.2 * share * y), (height - 0.35 * plant, height))


def _tier(b: Builder, skin: Surface, half: tuple[float, float], span: tuple[float, float], key: int) -> None:
    """Add four walls of whole bays and storeys, with a parapet and a flat roof."""
    (x, y), (low, high) = half, span
    top = high - 1.1
    floors = max(1, int((top - low) / _STOREY + 0.5))
    first = int(low / _STOREY) + 1
    quads, uvs, rims = [], [], []
    for n, (ax, ay, cx, cy) in enumerate(((x, -y, x, y), (x, y, -x, y), (-x, y, -x, -y), (-x, -y, x, -y))):
        bays = max(1, int((abs(cx - ax) + abs(cy - ay)) / _BAY + 0.5))
        u, v = 64 * key + 16 * n + 0.001, first + 0.001
        quads.append(((ax, ay, low), (cx, cy, low), (cx, cy, top), (ax, ay, top)))
        uvs.append(((u, v), (u + bays - 0.002, v), (u + bays - 0.002, v + floors - 0.002), (u, v + floors - 0.002)))
        rims.append(((ax, ay, top), (cx, cy, top), (cx, cy, high), (ax, ay, high)))
    b.quads(skin, np.array(quads), np.array(uvs))
    roof: tuple[Vec, ...] = ((-x, -y, high), (x, -y, high), (x, y, high), (-x, y, high))
    b.quads(_WALL, [*rims, roof])


def _box(b: Builder, half: tuple[float, float], span: tuple[float, float]) -> None:
    (x, y), (low, high) = half, span
    b.box(_WALL, (-x, -y, low), (x, y, high), "-z")
