"""Distant buildings: plain walls and rows of windows on all sides."""

from __future__ import annotations

import numpy as np
from recipe_compiler.plan import Element

from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.tags import Tag

_TOWER = Surface("wall", Pattern.CONCRETE, Tag.BUILDINGS)
_PANES = Surface("window", Pattern.WINDOW, Tag.BUILDINGS)


def tower(b: Builder, e: Element) -> None:
    """A distant building: plain walls and rows of windows on all sides."""
    depth, width, height = e.size
    x, y, key = depth / 2, width / 2, int(e.shape["key"]) * 16
    b.box(_TOWER, (-x, -y, 0.0), (x, y, height), "-z")
    floors, gap = int(height / 3.5), 0.05
    strips, uvs = [], []
    for ax, ay, bx, by in ((x, -y, x, y), (-x, y, -x, -y), (x, y, -x, y), (-x, -y, x, -y)):
        ox, oy = (gap if ax == bx else 0.0) * (1 if ax > 0 else -1), (gap if ay == by else 0.0) * (1 if ay > 0 else -1)
        across = int((abs(bx - ax) + abs(by - ay)) / 3.0)
        for floor in range(1, floors):
            z0, z1 = floor * 3.5, floor * 3.5 + 1.9
            lo, hi = 0.03, 0.97
            p = (ax + (bx - ax) * lo + ox, ay + (by - ay) * lo + oy)
            q = (ax + (bx - ax) * hi + ox, ay + (by - ay) * hi + oy)
            strips.append(((p[0], p[1], z0), (q[0], q[1], z0), (q[0], q[1], z1), (p[0], p[1], z1)))
            u0, u1 = float(key), key + across - 0.001
            uvs.append(((u0, floor + 0.001), (u1, floor + 0.001), (u1, floor + 0.999), (u0, floor + 0.999)))
    b.quads(_PANES, np.array(strips), np.array(uvs))
