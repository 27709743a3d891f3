"""Buildings: styles of facades with recessed windows, string courses and cornices, above a ground floor.

The origin is the middle of the front; x points out of the front, y to the left seen from inside. Free ends have windows
too; the back, and ends hidden by neighbours, are plain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from recipe_compiler.ir.plan import Element

from recipe_runtime.meshes.builder import Builder, noise
from recipe_runtime.meshes.facades import Facade, Hole, Quad, around, niches, pane_uv, pierced, surface
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.roofs import Top, flat_roof, pitched_roof
from recipe_runtime.meshes.shopfronts import Ground, ground_floor


@dataclass(frozen=True)
class _Family:
    """The properties shared by all buildings of a style."""

    wall: Surface
    share: float  # fraction of a bay's width that is window
    sill: float  # height above the floor, metres
    rise: float  # height of a window, metres
    reveal: float  # depth of the recess, metres
    hood: bool = False  # whether each window has a stone hood
    surround: bool = False  # whether each window has a stone surround
    balconies: bool = False
    band: bool = False  # whether each floor has a concrete band
    courses: bool = False  # whether each floor has a moulding


_BRICK = _Family(surface("wall", Pattern.BRICK), 0.44, 0.85, 1.7, 0.2, hood=True)
_PLASTER = _Family(surface("wall", Pattern.PLASTER), 0.40, 0.75, 1.85, 0.2, surround=True)
_CONCRETE = _Family(surface("wall", Pattern.PANELS), 0.82, 0.8, 1.75, 0.28, band=True)
_BALCONIED = _Family(surface("wall", Pattern.PLASTER), 0.5, 0.6, 1.95, 0.22, balconies=True)
_GLASS = _Family(surface("trim", Pattern.CONCRETE), 1.0, 0.0, 3.0, 0.0)
_STONE = _Family(surface("wall", Pattern.STONE), 0.42, 0.8, 1.85, 0.26, hood=True, surround=True, courses=True)
_FAMILIES = (_BRICK, _PLASTER, _CONCRETE, _BALCONIED, _GLASS, _STONE)  # indexed by the parameter `style`

_RUSTIC = surface("base", Pattern.STONE)
_RUSTIC_NICHE = surface("base", Pattern.NICHE)
_SHUTTER = surface("door", Pattern.CLAPBOARD)
_NICHE = surface("wall", Pattern.NICHE)
_TRIM = surface("trim", Pattern.PLASTER)
_UNDER = surface("trim", Pattern.NICHE)
_WINDOW = surface("window", Pattern.WINDOW)
_REAR = surface("window", Pattern.FACADE)
_CURTAIN = surface("window", Pattern.CURTAIN_WALL)
_METAL = surface("metal", Pattern.METAL)


def building(b: Builder, e: Element) -> None:
    """Build a building; `shape` gives floors, bays, style, roof, and which ends are free."""
    depth, width, height = e.size
    s, key = e.shape, int(e.shape["key"]) * 16
    family = _FAMILIES[int(s["style"])]
    facades = front, left, right, back = around(depth, width, key)
    ends = [(left, bool(s["left"])), (right, bool(s["right"]))]
    free = [(front, int(s["bays"])), *((f, 3) for f, there in ends if there)]
    rustic = family in (_PLASTER, _STONE, _BALCONIED) and noise(key, 36) > -0.2
    around_doors = (_RUSTIC, _RUSTIC_NICHE) if rustic else (family.wall, _NICHE)
    for f, bays in free:
        ground_floor(b, f, Ground.of(e, bays, *around_doors), entrance=f is front)
        if family is _GLASS:
            _curtain(b, e, f, bays)
        else:
            _floors(b, e, f, family, bays)
    plain = [f for f, there in ends if not there]
    b.quads(family.wall, [f.face(0, f.width, 0, height) for f in plain])
    _back(b, e, back, family)
    _mouldings(b, e, family, [f for f, _ in free])
    if family in (_BRICK, _PLASTER, _BALCONIED):
        u = 0.12 if noise(key, 33) > 0 else width - 0.24
        b.quads(_METAL, front.block((u, u + 0.12), (0.0, 0.13), (s["ground"], height - 0.4), top=False))  # a downpipe
    if family in (_BRICK, _PLASTER) and noise(key, 37) > 0:  # stones at the corners
        corners = [(f, u) for f, _ in free for u in (0.0, f.width - 0.5)]
        quads = [q for f, u in corners for q in f.block((u, u + 0.5), (0.0, 0.03), (s["ground"], height), top=False)]
        b.quads(surface("trim", Pattern.STONE), quads)
    top = Top(e.size, key, facades, tuple(f for f, _ in free), family.wall)
    if s.get("roof", 0):
        pitched_roof(b, top, 0.75 + 0.15 * noise(key, 31))
    else:
        flat_roof(b, top)


def _floors(b: Builder, e: Element, f: Facade, family: _Family, bays: int) -> None:
    """Build all floors of one facade above the ground floor."""
    s, width = e.shape, f.width / bays
    floors, storey, ground = int(s["floors"]), s["storey"], s["ground"]
    share = family.share * (1.0 + 0.12 * noise(f.key >> 4, 41)) if family is not _CONCRETE else family.share
    rise = min(family.rise, storey - family.sill - 0.35)
    holes: list[Hole] = []
    names = []
    for floor in range(floors - 1):
        low = ground + floor * storey
        z0 = low + family.sill
        row = [Hole((k + 0.5 - share / 2) * width, (k + 0.5 + share / 2) * width, z0, z0 + rise) for k in range(bays)]
        b.quads(family.wall, pierced(f, low, e.size[2] if floor == floors - 2 else low + storey, row))
        holes += row
        names += [(f.key + k, floor + 1) for k in range(bays)]
    b.quads(_NICHE, *niches(f, holes, family.reveal, floor=False))
    b.quads(_WINDOW, [f.face(h.u0, h.u1, h.z0, h.z1, -family.reveal) for h in holes], pane_uv(names))
    b.quads(_TRIM, [q for h in holes for q in _stones(f, h, family)])
    if family is _PLASTER and f.out == (1, 0) and noise(f.key >> 4, 38) > 0.1:
        _shutters(b, f, holes, (1.0 - share) * width / 2)
    if family.balconies and f.out == (1, 0):  # no balconies over a neighbour's yard
        _balconies(b, f, bays, floors, ground, storey)


def _shutters(b: Builder, f: Facade, holes: list[Hole], room: float) -> None:
    """Add open shutters at both sides of windows, `room` metres wide at most."""
    quads: list[Quad] = []
    for h in holes:
        wide = min(0.5 * (h.u1 - h.u0), room - 0.02)
        for u in (h.u0 - wide, h.u1):
            z = (h.z0 + 0.02, h.z1 - 0.02)
            quads += [f.face(u, u + wide, *z, 0.05), f.side(u, (0.0, 0.05), z, -1), f.side(u + wide, (0.0, 0.05), z, 1)]
    b.quads(_SHUTTER, quads)


def _stones(f: Facade, h: Hole, family: _Family) -> list[Quad]:
    """Return a window's sill, and the stones above and at both sides of it."""
    quads = f.block((h.u0 - 0.07, h.u1 + 0.07), (-family.reveal, 0.08), (h.z0 - 0.08, h.z0), sides=False)
    if family.surround:
        quads += [f.face(u, u + 0.13, h.z0, h.z1, 0.015) for u in (h.u0 - 0.13, h.u1)]
        quads.append(f.face(h.u0 - 0.13, h.u1 + 0.13, h.z1, h.z1 + 0.15, 0.015))
    elif family.hood:
        quads.append(f.face(h.u0 - 0.12, h.u1 + 0.12, h.z1, h.z1 + 0.2, 0.015))
    if family.courses:
        quads += f.block((h.u0 - 0.18, h.u1 + 0.18), (0.0, 0.14), (h.z1 + 0.15, h.z1 + 0.24), sides=False)
    return quads


def _curtain(b: Builder, e: Element, f: Facade, bays: int) -> None:
    """Build a glass curtain wall with fins between the bays."""
    s, ground, height = e.shape, e.shape["ground"], e.size[2]
    floors, panes = int(s["floors"]) - 1, 2 * bays
    uv = [(f.key + 0.001, 1.001), (f.key + panes - 0.001, 1.001)]
    uv += [(f.key + panes - 0.001, floors + 0.999), (f.key + 0.001, floors + 0.999)]
    b.quads(_CURTAIN, [f.face(0.0, f.width, ground, height)], np.array([uv]))
    fins: list[Quad] = []
    for k in range(bays + 1):
        u = (f.width - 0.12) * k / bays
        fins += f.block((u, u + 0.12), (0.0, 0.22), (ground, height), top=False)
    b.quads(_METAL, fins)


def _balconies(b: Builder, f: Facade, bays: int, floors: int, ground: float, storey: float) -> None:
    """Build balconies with railings in front of every other bay."""
    bay, slabs, rails = f.width / bays, [], []
    for floor in range(1, floors - 1):
        z = ground + floor * storey
        for k in range(int(noise(f.key, 4) > 0), bays, 2):
            u0, u1 = k * bay + 0.2, (k + 1) * bay - 0.2
            slabs += f.block((u0, u1), (0, 0.95), (z - 0.14, z))
            rails += f.block((u0, u1), (0.88, 0.93), (z + 0.95, z + 1.0))
            rails += [f.face(u0, u1, z + 0.08, z + 0.5, 0.91), f.face(u0, u1, z + 0.08, z + 0.5, 0.9)[::-1]]
            for n in range(5):
                u = u0 + 0.03 + (u1 - u0 - 0.06) * n / 4
                front, back = (f.face(u - 0.02, u + 0.02, z, z + 0.95, d) for d in (0.92, 0.9))
                rails += [front, back[::-1]]
    b.quads(_TRIM, slabs)
    b.quads(_METAL, rails)


def _back(b: Builder, e: Element, f: Facade, family: _Family) -> None:
    """Build the rear facade, which is rarely visible: its windows are part of the surface pattern, without geometry."""
    s, key = e.shape, int(e.shape["key"])
    low, high = s["ground"], s["ground"] + (s["floors"] - 1) * s["storey"]
    u0, v0 = 64 * key + 0.001, 1.001
    u1, v1 = 64 * key + max(1, int(f.width / 3.0)) - 0.001, int(s["floors"]) - 0.001
    b.quads(family.wall, [f.face(0, f.width, 0, low)])
    b.quads(_REAR, [f.face(0, f.width, low, high)], np.array([[(u0, v0), (u1, v0), (u1, v1), (u0, v1)]]))
    if e.size[2] > high + 1e-6:
        b.quads(family.wall, [f.face(0, f.width, high, e.size[2])])


def _mouldings(b: Builder, e: Element, family: _Family, facades: list[Facade]) -> None:
    """Build the moulding above the ground floor and those between floors."""
    s = e.shape
    ground, storey, floors = s["ground"], s["storey"], int(s["floors"])
    quads: list[Quad] = []
    for f in facades:
        quads += f.block((0.0, f.width), (0.0, 0.14), (ground - 0.22, ground), sides=False)
        for k in range(1, floors - 1):
            z = ground + k * storey
            if family.band:
                quads += f.block((0.0, f.width), (0.0, 0.07), (z, z + 0.3), sides=False)
            elif family.courses or (k == floors - 2 and family is _PLASTER):
                quads += f.block((0.0, f.width), (0.0, 0.1), (z - 0.1, z + 0.08), sides=False)
    b.quads(_TRIM, quads)
