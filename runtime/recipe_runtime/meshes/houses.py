"""Detached houses: walls with windows and a door, a tiled roof with eaves and a chimney, a garage and a porch.

The origin is the middle of the front, and x points out of it. The walls fill the element's size; eaves and porch extend
beyond it.
"""

from __future__ import annotations

from recipe_compiler.ir.plan import Element

from recipe_runtime.meshes.builder import Builder, noise
from recipe_runtime.meshes.facades import Facade, Hole, Quad, around, niches, pane_uv, pierced, surface
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.roofs import chimney, gable, hip

EAVES = 0.32  # overhang of the roof beyond the walls, without its gutters, metres
PORCH = 1.6  # depth of a porch, metres


_WALLS = tuple(surface("wall", p) for p in (Pattern.BRICK, Pattern.PLASTER, Pattern.CLAPBOARD))
_NICHE = surface("wall", Pattern.NICHE)
_TRIM = surface("trim", Pattern.PLAIN)
_WINDOW = surface("window", Pattern.WINDOW)
_BASE = surface("base", Pattern.STONE)
_DOOR = surface("door", Pattern.WOOD)
_GARAGE = surface("garage", Pattern.CLAPBOARD)
_STEP = surface("base", Pattern.CONCRETE)
_ROOF = surface("roof", Pattern.METAL)
_REVEAL, _PLINTH = 0.14, 0.4
_RIDGE_ALONG, _HIP = 0, 2


def house(b: Builder, e: Element) -> None:
    """Build a house; `shape` gives floors, roof, pitch, style, and whether it has a garage and a porch."""
    depth, width, height = e.size
    s, key = e.shape, int(e.shape["key"])
    wall = _WALLS[int(s["style"])]
    facades = around(depth, width, key * 16)
    door = _front(b, e, facades[0], wall)
    for facade in facades[1:]:
        _walls(b, e, facade, wall, _windows(e, facade, 0.0, facade.width))
    size, pitch, along_y = (depth, width, height), s["pitch"], int(s["roof"]) == _RIDGE_ALONG
    if int(s["roof"]) == _HIP:
        along_y = width > depth
        hip(b, size, pitch, EAVES)
    else:
        gable(b, size, pitch, EAVES, wall, along_y=along_y)
    chimney(b, size, pitch, key, along_y)
    pipes = [(facade, u) for facade in (facades[0], facades[3]) for u in (0.1, facade.width - 0.19)]
    b.quads(_TRIM, [q for f, u in pipes for q in f.block((u, u + 0.09), (0.05, 0.14), (0.0, height - 0.1), top=False)])
    if s["porch"]:
        _porch(b, facades[0], door, height if s["floors"] == 1 else s["storey"])


def _front(b: Builder, e: Element, f: Facade, wall: Surface) -> float:
    """Add the front with its door and, optionally, a garage door; return the u of the door's middle."""
    s, key = e.shape, int(e.shape["key"])
    start, holes = 0.0, []
    if s["garage"]:
        gate = (0.5, min(3.2, 0.5 * f.width))
        holes.append(Hole(*gate, 0.0, 2.2))
        b.quads(_GARAGE, [f.face(*gate, 0.0, 2.2, -0.2)])
        start = gate[1] + 0.2
    room = f.width - start
    door = start + room * (0.5 + 0.18 * noise(key, 2))
    holes.append(Hole(door - 0.5, door + 0.5, 0.2, 2.3))
    b.quads(_DOOR, [f.face(door - 0.42, door + 0.42, 0.2, 2.2, -0.1)])
    frame = [f.face(u, u + 0.08, 0.2, 2.3, -0.08) for u in (door - 0.5, door + 0.42)]
    b.quads(_TRIM, [*frame, f.face(door - 0.42, door + 0.42, 2.2, 2.3, -0.08)])
    b.quads(_STEP, f.block((door - 0.8, door + 0.8), (0.0, 0.7), (0.0, 0.2)))
    ground = [h for h in _windows(e, f, start, f.width) if h.z0 < s["storey"] and abs((h.u0 + h.u1) / 2 - door) > 1.35]
    upper = [h for h in _windows(e, f, 0.0, f.width) if h.z0 > s["storey"]]
    _walls(b, e, f, wall, [*upper, *ground], sorted(holes, key=lambda h: h.u0))
    return door


def _windows(e: Element, f: Facade, start: float, end: float) -> list[Hole]:
    """Return the windows of a facade between two values of u, floor by floor."""
    storey, found = e.shape["storey"], []
    count = max(1, int((end - start) / 2.7))
    wide = 1.05 if noise(int(e.shape["key"]), 5) < 0 else 1.35
    for floor in range(int(e.shape["floors"])):
        z = floor * storey + 0.95
        for k in range(count):
            u = start + (end - start) * (k + 0.5) / count
            found.append(Hole(u - wide / 2, u + wide / 2, z, min(z + 1.35, e.size[2] - 0.25)))
    return found


def _walls(
    b: Builder, e: Element, f: Facade, wall: Surface, windows: list[Hole], doors: list[Hole] | None = None
) -> None:
    """Add the wall of a facade around its openings, and the windows' panes and frames."""
    storey, floors, doors = e.shape["storey"], int(e.shape["floors"]), doors or []
    for floor in range(floors):
        low, high = floor * storey, e.size[2] if floor == floors - 1 else (floor + 1) * storey
        here = [h for h in windows if low <= h.z0 < high] + (doors if floor == 0 else [])
        b.quads(wall, pierced(f, low, high, sorted(here, key=lambda h: h.u0)))
    b.quads(_NICHE, *niches(f, [*windows, *doors], _REVEAL))
    if windows:
        panes = [f.face(h.u0, h.u1, h.z0, h.z1, -_REVEAL) for h in windows]
        names = [(f.key + n, 1 + int(h.z0 / storey)) for n, h in enumerate(windows)]
        b.quads(_WINDOW, panes, pane_uv(names))
    trim = []
    for h in windows:
        trim += f.block((h.u0 - 0.12, h.u1 + 0.12), (0.0, 0.07), (h.z0 - 0.1, h.z0))
        trim += f.block((h.u0 - 0.1, h.u1 + 0.1), (0.0, 0.04), (h.z1, h.z1 + 0.12))
        trim += [f.face(u, u + 0.1, h.z0, h.z1, 0.025) for u in (h.u0 - 0.1, h.u1)]
    b.quads(_TRIM, trim)
    b.quads(_BASE, _plinth(f, doors))


def _plinth(f: Facade, doors: list[Hole]) -> list[Quad]:
    """Return a projecting plinth, interrupted at doors."""
    edge, quads = 0.0, []
    for h in [*doors, Hole(f.width, f.width, 0.0, 0.0)]:
        if h.u0 - edge > 0.05:
            quads += f.block((edge, h.u0), (0.0, 0.05), (0.0, _PLINTH))
        edge = h.u1
    return quads


def _porch(b: Builder, f: Facade, door: float, height: float) -> None:
    """Add a porch over the door: a small roof on two posts, and a floor."""
    u0, u1, top = door - 1.4, door + 1.4, min(height - 0.15, 2.75)
    b.quads(_STEP, f.block((u0, u1), (0.0, PORCH - 0.15), (0.0, 0.16)))
    b.quads(_ROOF, f.block((u0 - 0.15, u1 + 0.15), (0.0, PORCH), (top, top + 0.14)))
    posts = []
    for u in (u0 + 0.1, u1 - 0.25):
        posts += [*f.block((u, u + 0.15), (PORCH - 0.4, PORCH - 0.25), (0.16, top), top=False)]
        posts += [f.face(u, u + 0.15, 0.16, top, PORCH - 0.4)[::-1]]
    b.quads(_TRIM, posts)
    b.quads(_TRIM, f.block((u0 - 0.1, u1 + 0.1), (0.0, PORCH - 0.06), (top - 0.2, top), top=False))
