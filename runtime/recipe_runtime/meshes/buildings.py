"""Buildings: facades with recessed windows, shop fronts, balconies, cornices, and a roof behind a parapet.

A building stands with the middle of its front at the origin, x out of the front, y to its left (seen from inside).
Each facade is built in coordinates of its own: u to the right for someone who looks at it, d outwards, z up.
"""

from __future__ import annotations

import numpy as np
from recipe_compiler.plan import Element

from recipe_runtime.meshes.builder import Builder, Vec, noise
from recipe_runtime.meshes.facades import Facade, around, pane_uv
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.tags import Tag

_BRICK, _PLASTER, _CONCRETE, _BALCONIES, _GLASS, _STONE = range(6)
_WALLS = (Pattern.BRICK, Pattern.PLASTER, Pattern.CONCRETE, Pattern.PLASTER, Pattern.CONCRETE, Pattern.STONE)
_REVEAL = 0.22  # depth of a window in its wall


def _surface(slot: str, pattern: Pattern) -> Surface:
    return Surface(slot, pattern, Tag.BUILDINGS)


_TRIM = _surface("trim", Pattern.PLASTER)
_FRAME = _surface("frame", Pattern.PLAIN)
_WINDOW = _surface("window", Pattern.WINDOW)
_BASE = _surface("base", Pattern.CONCRETE)
_SHOP = _surface("shop", Pattern.WINDOW)
_SIGN = _surface("sign", Pattern.PLAIN)
_AWNING = _surface("awning", Pattern.CLOTH)
_DOOR = _surface("door", Pattern.PLAIN)
_ROOF = _surface("roof", Pattern.ROOF)
_METAL = _surface("metal", Pattern.METAL)


def building(b: Builder, e: Element) -> None:
    """The whole building; `shape` says its floors, bays, style, and which ends stand free."""
    depth, width, height = e.size
    s, key = e.shape, int(e.shape["key"]) * 16
    front, left, right, back = around(depth, width, key)
    wall = _surface("wall", _WALLS[int(s["style"])])
    _facade(b, e, front, wall, int(s["bays"]), entrance=True)
    for end, there in ((left, s["left"]), (right, s["right"])):
        if there:
            _facade(b, e, end, wall, 3, entrance=False)
        else:
            b.quads(wall, [end.face(0, end.width, 0, height)])
    b.quads(wall, [back.face(0, width, 0, height)])
    _top(b, e, wall, (front, left, right, back))


def _facade(b: Builder, e: Element, f: Facade, wall: Surface, bays: int, *, entrance: bool) -> None:
    s = e.shape
    style, floors, storey, ground = int(s["style"]), int(s["floors"]), s["storey"], s["ground"]
    bay = f.width / bays
    part, rise, sill = {_BRICK: (0.46, 1.65, 0.85), _CONCRETE: (0.8, 1.75, 0.8)}.get(style, (0.42, 1.8, 0.75))
    if style == _BALCONIES:
        part = 0.5
    _ground_floor(b, e, f, wall, bays, entrance)
    below = ground
    quads, reveals, sills, frames, panes, names = [], [], [], [], [], []
    for floor in range(floors - 1):
        z0 = ground + floor * storey + sill
        quads.append(f.face(0, f.width, below, z0))
        below, edge = z0 + rise, 0.0
        for k in range(bays):
            u0 = k * bay + bay * (1 - part) / 2
            u1 = u0 + bay * part
            quads.append(f.face(edge, u0, z0, below))
            reveals += f.recess((u0, u1), (z0, below), _REVEAL)
            frames += _frame(f, u0, u1, z0, below, style)
            panes.append(f.face(u0, u1, z0, below, -_REVEAL))
            names.append((f.key + k, floor + 1))
            edge = u1
            if style in (_BRICK, _PLASTER):
                sills += f.block((u0 - 0.08, u1 + 0.08), (0, 0.1), (z0 - 0.09, z0), sides=False)
        quads.append(f.face(edge, f.width, z0, below))
    quads.append(f.face(0, f.width, below, e.size[2]))
    b.quads(wall, quads)
    b.quads(wall if style == _BRICK else _TRIM, reveals)
    b.quads(_TRIM, sills)
    b.quads(_FRAME, frames)
    b.quads(_WINDOW, np.array(panes), pane_uv(names))
    b.quads(_TRIM, f.block((0, f.width), (0, 0.12), (ground - 0.25, ground), sides=False))
    if style == _CONCRETE:
        bands = [
            quad
            for k in range(1, floors - 1)
            for quad in f.block((0, f.width), (0, 0.07), (ground + k * storey, ground + k * storey + 0.3), sides=False)
        ]
        b.quads(_TRIM, bands)
    if style == _BALCONIES and entrance:
        _balconies(b, f, bays, floors, ground, storey)


def _frame(f: Facade, u0: float, u1: float, z0: float, z1: float, style: int) -> list[tuple[Vec, ...]]:
    """A mullion and a transom, a little before the pane."""
    d, w = -_REVEAL + 0.05, 0.035
    middle, bar = (u0 + u1) / 2, z0 + (z1 - z0) * 0.68
    quads = [f.face(middle - w, middle + w, z0, z1, d)]
    if style != _CONCRETE:
        quads.append(f.face(u0, u1, bar - w, bar + w, d))
    return quads


def _ground_floor(b: Builder, e: Element, f: Facade, wall: Surface, bays: int, entrance: bool) -> None:
    """Shop windows and a door, or a plinth with smaller windows."""
    s, bay, top = e.shape, f.width / bays, e.shape["ground"]
    shop = bool(s["shop"])
    low, high, part = (0.55, 3.05, 0.84) if shop else (1.25, 2.95, 0.42)
    door = int((noise(f.key, 3) + 1) / 2 * bays) if entrance else -1
    facing = _BASE if shop else wall
    edge, quads, panes, names, plinth = 0.0, [], [], [], []
    for k in range(bays):
        width = min(bay * part, 1.3) if k == door else bay * part
        u0, z0 = (k + 0.5) * bay - width / 2, 0.0 if k == door else low
        u1 = u0 + width
        quads += [f.face(edge, u0, 0, top), f.face(u0, u1, high, top), *f.recess((u0, u1), (z0, high), 0.3)]
        edge = u1
        if k == door:
            b.quads(_DOOR, [f.face(u0, u1, 0, 2.3, -0.3)])
            b.quads(_FRAME, f.block((u0, u1), (-0.3, -0.2), (2.3, 2.42), sides=False))
            panes.append(f.face(u0, u1, 2.42, high, -0.3))
        else:
            quads.append(f.face(u0, u1, 0, low))
            panes.append(f.face(u0, u1, low, high, -0.3))
            b.quads(_FRAME, _frame(f, u0, u1, low, high, _CONCRETE))
            plinth += f.block((u0 - 0.06, u1 + 0.06), (0, 0.08), (low - 0.1, low))
        names.append((f.key + k, 0))
    quads.append(f.face(edge, f.width, 0, top))
    b.quads(facing, quads)
    b.quads(_TRIM, plinth)
    b.quads(_SHOP if shop else _WINDOW, np.array(panes), pane_uv(names))
    b.quads(_BASE, f.block((0, f.width), (0, 0.05), (0, 0.35), sides=False))
    if shop and entrance:
        b.quads(_SIGN, f.block((0.4, f.width - 0.4), (0, 0.14), (high + 0.12, high + 0.62)))
        if s["awning"]:
            _awnings(b, f, bays, door, high)


def _awnings(b: Builder, f: Facade, bays: int, door: int, high: float) -> None:
    bay = f.width / bays
    for k in range(bays):
        if k == door:
            continue
        u0, u1 = k * bay + 0.15, (k + 1) * bay - 0.15
        z0, z1, reach = high - 0.45, high + 0.1, 1.1
        top = (f.at(u0, reach, z0), f.at(u1, reach, z0), f.at(u1, 0.05, z1), f.at(u0, 0.05, z1))
        valance = f.face(u0, u1, z0 - 0.22, z0, reach)
        left = (f.at(u0, 0.05, z0), f.at(u0, reach, z0), f.at(u0, 0.05, z1), f.at(u0, 0.05, z1))
        right = (f.at(u1, reach, z0), f.at(u1, 0.05, z0), f.at(u1, 0.05, z1), f.at(u1, reach, z0))
        b.quads(_AWNING, [top, top[::-1], valance, valance[::-1], left, left[::-1], right, right[::-1]])


def _balconies(b: Builder, f: Facade, bays: int, floors: int, ground: float, storey: float) -> None:
    bay, slabs, rails = f.width / bays, [], []
    for floor in range(1, floors - 1):
        z = ground + floor * storey
        for k in range(int(noise(f.key, 4) > 0), bays, 2):
            u0, u1 = k * bay + 0.2, (k + 1) * bay - 0.2
            slabs += f.block((u0, u1), (0, 1.0), (z - 0.14, z))
            rails += f.block((u0, u1), (0.94, 0.99), (z + 0.95, z + 1.02))
            for n in range(6):
                u = u0 + 0.03 + (u1 - u0 - 0.06) * n / 5
                rails.append(f.face(u - 0.02, u + 0.02, z, z + 0.95, 0.97))
                rails.append(f.face(u - 0.02, u + 0.02, z, z + 0.95, 0.96)[::-1])
    b.quads(_TRIM, slabs)
    b.quads(_METAL, rails)


def _top(b: Builder, e: Element, wall: Surface, facades: tuple[Facade, ...]) -> None:
    """Cornice, parapet and roof, and on some a stair head."""
    depth, width, height = e.size
    top, half = height + 0.85, width / 2
    style = int(e.shape["style"])
    for f in facades:
        b.quads(wall, [f.face(0, f.width, height, top), f.face(0.3, f.width - 0.3, height, top, -0.3)[::-1]])
        b.quads(_TRIM, f.block((-0.06, f.width + 0.06), (-0.36, 0.08), (top, top + 0.1)))
    front = facades[0]
    reach = 0.4 if style == _BRICK else 0.25
    if style != _CONCRETE:
        b.quads(_TRIM, front.block((0, width), (0, reach), (height - 0.1, height + 0.22)))
        b.quads(_TRIM, front.block((0, width), (0, reach / 2), (height - 0.35, height - 0.1)))
    b.quads(_ROOF, [((-depth, -half, height), (0, -half, height), (0, half, height), (-depth, half, height))])
    if noise(int(e.shape["key"]), 7) > -0.2:
        aside = noise(int(e.shape["key"]), 8) * (half - 2.5)
        b.box(_BASE, (-depth + 2.0, aside - 1.5, height), (-depth + 5.0, aside + 1.5, height + 2.6), "-z")
