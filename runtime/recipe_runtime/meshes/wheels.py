"""Wheels in the frame of their hub; the axle is y."""

from __future__ import annotations

from recipe_runtime.meshes.builder import Builder, circle
from recipe_runtime.meshes.coachwork import Finish, Point, Sight
from recipe_runtime.meshes.mesh import Mesh, Surface

_SIDES, _FAR_SIDES = 24, 12


def car_wheel(f: Finish, radius: float, width: float, outside: float, spokes: int, sight: Sight) -> Mesh:
    """Return a tyre on a dished rim with openings on the side of +y if `outside` is 1, of -y if it is -1."""
    b = Builder()
    with b.level(0.0, sight.near, anchor=sight.anchor, casts=False):
        _near_wheel(b, f, radius, width, outside, spokes)
    with b.level(sight.near, anchor=sight.anchor, casts=True):
        half, s = width / 2, outside
        for surface, rows in (
            (
                f.rubber,
                [(-half, 0.66), (-half, 0.93), (-0.7 * half, 1.0), (0.7 * half, 1.0), (half, 0.93), (half, 0.66)],
            ),
            (f.rim, [(half - 0.01, 0.66), (half - 0.03, 0.52)]),
            (f.trim, [(half - 0.05, 0.54), (half - 0.05, 0.3)]),
            (f.rim, [(half - 0.03, 0.34), (half - 0.02, 0.0)]),
        ):
            rings = [_around(s * y, r * radius, _FAR_SIDES) for y, r in rows]
            b.grid(surface, rings if s > 0 else rings[::-1], crease=0.5)
    return b.mesh()


def _near_wheel(b: Builder, f: Finish, radius: float, width: float, outside: float, spokes: int) -> None:
    half, s = width / 2, outside

    def turned(surface: Surface, rows: list[tuple[float, float]], crease: float) -> None:
        rings = [_around(s * y, r * radius) for y, r in rows]
        b.grid(surface, rings if s > 0 else rings[::-1], crease=crease)

    tread = [(0.97, 0.67), (1.0, 0.75), (1.02, 0.84), (0.98, 0.93), (0.86, 0.98), (0.6, 0.995)]
    turned(f.rubber, [(-half * y, r) for y, r in tread] + [(half * y, r) for y, r in tread[::-1]], 0.8)
    deep = half - 0.075
    turned(f.rim, [(half - 0.004, 0.68), (half + 0.002, 0.655), (half - 0.012, 0.625), (deep, 0.60)], 0.8)
    turned(f.trim, [(deep, 0.60), (deep, 0.0)], 0.8)
    turned(f.disc, [(deep + 0.012, 0.47), (deep + 0.02, 0.46), (deep + 0.02, 0.18)], 0.5)
    face = half - 0.016
    turned(f.rim, [(deep, 0.17), (face - 0.004, 0.165), (face + 0.004, 0.13), (face + 0.006, 0.0)], 0.7)
    b.fan(f.trim, _around(-s * 0.9 * half, 0.68 * radius)[:: -int(s)])
    wide = 0.11 if spokes > 7 else 0.17 - 0.008 * spokes
    for k in range(spokes):
        (c, sn), (tc, ts) = circle(1, 360.0 / spokes * k)[0], circle(1, 360.0 / spokes * k + 90.0)[0]

        def at(r: float, t: float, y: float, c: float = c, sn: float = sn, tc: float = tc, ts: float = ts) -> Point:
            return (r * sn + t * ts) * radius, s * y, (r * c + t * tc) * radius

        inner, outer = 0.10, 0.63
        edge = [(inner, -0.55 * wide), (outer, -0.5 * wide), (outer, 0.5 * wide), (inner, 0.55 * wide)]
        high = [at(r, 0.78 * t, face if r > 0.3 else face + 0.003) for r, t in edge]
        low = [at(r, t, face - 0.028) for r, t in edge]
        quads = [high, [low[0], low[1], high[1], high[0]], [high[3], high[2], low[2], low[3]]]
        b.quads(f.rim, [quad if s > 0 else quad[::-1] for quad in quads])


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


def _around(y: float, r: float, sides: int = _SIDES) -> list[tuple[float, float, float]]:
    """Return a ring about the axle, clockwise seen from +y."""
    return [(r * s, y, r * c) for c, s in circle(sides)]
