"""Wheels in the frame of their hub; the axle is y."""

from __future__ import annotations

from recipe_runtime.meshes.builder import Builder, circle
from recipe_runtime.meshes.coachwork import Finish
from recipe_runtime.meshes.mesh import Mesh, Surface

_SIDES = 18


def car_wheel(f: Finish, radius: float, width: float, outside: float, spokes: int = 5) -> Mesh:
    """Return a tyre on a dished rim with openings on the side of +y if `outside` is 1, of -y if it is -1."""
    b = Builder()
    half = width / 2
    profile = [(-half, 0.66), (-half, 0.91), (-0.7 * half, 1.0)]
    profile += [(-y, r) for y, r in reversed(profile)]
    b.grid(f.rubber, [_around(y, r * radius) for y, r in profile], crease=0.6)
    s = outside
    dish = [(half, 0.66), (half - 0.035, 0.60), (half - 0.028, 0.20), (half - 0.01, 0.16)]
    rows = [_around(s * y, r * radius) for y, r in [*dish, (half - 0.01, 0.0)]]
    b.grid(f.rim, rows if s > 0 else rows[::-1], crease=0.8)
    b.fan(f.trim, _around(-s * 0.7 * half, 0.67 * radius)[:: -int(s)])
    for k in range(spokes):
        quad = []
        wide = 0.36 * 180.0 / spokes
        for r, angle in ((0.24, -0.8 * wide), (0.55, -1.3 * wide), (0.55, 1.3 * wide), (0.24, 0.8 * wide)):
            c, sn = circle(1, 360.0 / spokes * k + angle)[0]
            quad.append((r * radius * sn, s * (half - 0.02), r * radius * c))
        b.quads(f.trim, [quad if s > 0 else quad[::-1]])
    return b.mesh()


def spoked_wheel(rubber: Surface, rim: Surface, radius: float, tyre: float, spokes: int, disc: Surface | None) -> Mesh:
    """Return a two-wheeler's wheel: a round tyre of half thickness `tyre`, rim, spokes, hub and brake `disc`."""
    b = Builder()
    ring = [(tyre * s, radius - tyre + tyre * c) for c, s in circle(8, 22.5)]
    b.grid(rubber, [_around(y, r) for y, r in [*ring, ring[0]]], crease=-1.0)
    inner = radius - 1.7 * tyre
    edge = [(-0.7 * tyre, inner), (0.7 * tyre, inner), (0.7 * tyre, inner - 0.018), (-0.7 * tyre, inner - 0.018)]
    b.grid(rim, [_around(y, r) for y, r in [*edge, edge[0]]][::-1], crease=0.3)
    hub = 0.03 if disc is None else 0.06
    b.grid(rim, [_around(-0.045, hub), _around(0.045, hub)], crease=0.5)
    for y in (-0.045, 0.045):
        b.fan(rim, _around(y, hub)[:: 1 if y < 0 else -1])
    thick = 0.004 if disc is None else 0.016
    for k in range(spokes):
        (c, s), (tc, ts) = circle(1, 360.0 * k / spokes)[0], circle(1, 360.0 * k / spokes + 90.0)[0]
        side = 0.03 if k % 2 else -0.03
        for turn in (1.0, -1.0):
            corners = ((hub, turn, side), (hub, -turn, side), (inner, -turn, 0.0), (inner, turn, 0.0))
            b.quads(rim, [[(r * s + t * thick * ts, y, r * c + t * thick * tc) for r, t, y in corners]])
    if disc is not None:
        for y in (-0.07, 0.07):
            b.fan(disc, _around(y, 0.45 * radius)[:: 1 if y < 0 else -1])
    return b.mesh()


def _around(y: float, r: float) -> list[tuple[float, float, float]]:
    """Return a ring about the axle, clockwise seen from +y."""
    return [(r * s, y, r * c) for c, s in circle(_SIDES)]
