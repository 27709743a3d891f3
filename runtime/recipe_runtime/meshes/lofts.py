"""Lofts: smooth round shapes through cross-sections, such as limbs, torsos and tubes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recipe_runtime.meshes.builder import Builder, Vec, circle
from recipe_runtime.meshes.mesh import Surface
from recipe_runtime.meshes.vectors import Array, cross, unit

Section = tuple[float, float, float, float]  # z, half depth (x), half width (y), x of its centre; metres


def rings(sections: Sequence[Section], y: float = 0.0, square: float = 0.0, sides: int = 10) -> Array:
    """Return the rings of a loft, lowest first; `square` > 0 makes the ovals more rectangular."""
    rows = []
    for z, rx, ry, cx in sections:
        row = []
        for c, s in circle(sides):
            k = 1.0 + square * 4.0 * c * c * s * s
            row.append((cx + rx * c * k, y + ry * s * k, z))
        rows.append(row)
    return np.array(rows)


def loft(
    b: Builder,
    surface: Surface,
    sections: Sequence[Section],
    y: float = 0.0,
    square: float = 0.0,
    sides: int = 10,
    domes: int = 2,
) -> None:
    """Add a smooth shape through sections listed from bottom to top.

    Two limbs that end at the same joint with the same radius form a smooth knee or elbow at any angle. `domes` is the
    number of rings of each rounded end; 0 leaves the end flat.
    """
    out = ((), (0.8,), (0.97, 0.72))[domes]
    low = [_dome(sections[0], k, -1.0) for k in out]
    high = [_dome(sections[-1], k, 1.0) for k in out[::-1]]
    b.grid(surface, rings([*low, *sections, *high], y, square, sides), crease=-1.0, caps=(surface, surface))


def _dome(section: Section, out: float, sign: float) -> Section:
    z, rx, ry, cx = section
    k = float(np.sqrt(1.0 - out * out))
    return (z + sign * out * min(rx, ry), rx * k, ry * k, cx)


def tube(b: Builder, surface: Surface, path: Sequence[Vec], radius: float | Sequence[float], sides: int = 8) -> None:
    """Add a round bar along a path, with closed ends."""
    p = np.array(path, np.float64)
    ahead = unit(np.concatenate([p[1:2] - p[0:1], p[2:] - p[:-2], p[-1:] - p[-2:-1]]))
    aside = np.where(np.abs(ahead[:, 1:2]) < 0.8, [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]])
    u = unit(cross(aside, ahead))
    v = cross(ahead, u)
    radii = np.broadcast_to(np.array(radius, np.float64), (len(p),))
    rows = [
        [[o + r * (c * a + s * e) for o, a, e in zip(q, x, y, strict=True)] for c, s in circle(sides)]
        for q, x, y, r in zip(p.tolist(), u.tolist(), v.tolist(), radii.tolist(), strict=True)
    ]
    b.grid(surface, rows, crease=0.3, caps=(surface, surface))
