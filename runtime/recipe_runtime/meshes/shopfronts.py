"""Ground floors: shop fronts with signs and awnings, or plinths with windows and a door."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from recipe_compiler.ir.plan import Element

from recipe_runtime.meshes.builder import Builder, noise
from recipe_runtime.meshes.facades import Facade, Hole, Quad, niches, pane_uv, pierced, surface
from recipe_runtime.meshes.lettering import WORDS, write
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.typefaces import TYPEFACES, word

_TRIM = surface("trim", Pattern.PLASTER)
_FRAME = surface("frame", Pattern.PLAIN)
_WINDOW = surface("window", Pattern.WINDOW)
_BASE = surface("base", Pattern.STONE)
_FRONT = surface("base", Pattern.PLASTER)
_NICHE = surface("base", Pattern.NICHE)
_SHOP = surface("shop", Pattern.SHOP_WINDOW)
_SIGN = surface("sign", Pattern.PLAIN)
_LETTERS = surface("sign", Pattern.LETTER)
_AWNING = surface("awning", Pattern.CLOTH)
_UNDER = surface("awning", Pattern.NICHE)
_DOOR = surface("door", Pattern.WOOD)
_STEP = surface("base", Pattern.CONCRETE)
_DEEP = 0.3  # depth of the recesses of shop windows and doors, metres


@dataclass(frozen=True)
class Ground:
    """The properties of a ground floor: height, bays, whether it is a shop, and the surfaces around its openings."""

    height: float
    bays: int
    shop: bool
    awning: bool
    wall: Surface
    niche: Surface

    @classmethod
    def of(cls, e: Element, bays: int, wall: Surface, niche: Surface) -> Ground:
        """Return the ground floor of a building; shops have their own wall surface."""
        shop = bool(e.shape["shop"])
        return cls(
            e.shape["ground"], bays, shop, bool(e.shape["awning"]), _FRONT if shop else wall, _NICHE if shop else niche
        )


def ground_floor(b: Builder, f: Facade, g: Ground, entrance: bool) -> None:
    """Add the ground floor of one facade; only the front has an entrance, a sign and awnings."""
    bay = f.width / g.bays
    door = int((noise(f.key, 3) + 1) / 2 * g.bays) if entrance else -1
    low, high, part = (0.5, min(3.05, g.height - 0.95), 0.86) if g.shop else (1.2, min(2.95, g.height - 0.6), 0.42)
    holes = []
    for k in range(g.bays):
        wide = min(bay * part, 1.25) if k == door else bay * part
        middle = (k + 0.5) * bay
        holes.append(Hole(middle - wide / 2, middle + wide / 2, 0.0 if k == door else low, high))
    windows = [(k, h) for k, h in enumerate(holes) if k != door]
    b.quads(g.wall, pierced(f, 0.0, g.height, holes))
    b.quads(g.niche, *niches(f, [h for _, h in windows], _DEEP, floor=False))
    panes = [f.face(h.u0, h.u1, h.z0, h.z1, -_DEEP) for _, h in windows]
    b.quads(_SHOP if g.shop else _WINDOW, panes, pane_uv([(f.key + k, 0) for k, _ in windows]))
    sills: list[Quad] = []
    for _, h in windows:
        sills += f.block((h.u0 - 0.05, h.u1 + 0.05), (-_DEEP, 0.07), (h.z0 - 0.09, h.z0), sides=False)
    b.quads(_TRIM, sills)
    if door >= 0:
        _entrance(b, f, g, holes[door], door)
    _plinth(b, f, holes[door] if door >= 0 else None)
    if g.shop:
        _shop(b, f, g, holes, door, high)


def _entrance(b: Builder, f: Facade, g: Ground, h: Hole, name: int) -> None:
    """Add a door in a deep recess, with a light above it, a stone frame and a step."""
    top = 2.25
    b.quads(g.niche, *niches(f, [h], _DEEP, floor=False))
    b.quads(_DOOR, [f.face(h.u0, h.u1, 0.0, top, -_DEEP)])
    lamp = (h.u1 + 0.34, h.u1 + 0.46)  # beside the door
    b.quads(_FRAME, f.block(lamp, (0.0, 0.12), (1.95, 2.2)))
    middle, inner = (h.u0 + h.u1) / 2, (h.u1 - h.u0) / 2 - 0.16
    panel = [f.face(middle - inner, middle + inner, 1.0, top - 0.18, -_DEEP + 0.02)]
    b.quads(_SHOP if g.shop else _DOOR, panel, pane_uv([(f.key + name, 2)]) if g.shop else None)
    b.quads(_FRAME, f.block((h.u0, h.u1), (-_DEEP, -_DEEP + 0.08), (top, top + 0.1), sides=False))
    handle = [f.face(h.u1 - 0.14, h.u1 - 0.11, 0.95, 1.2, -_DEEP + 0.05)]
    b.quads(_FRAME, handle)
    b.quads(_WINDOW, [f.face(h.u0, h.u1, top + 0.1, h.z1, -_DEEP)], pane_uv([(f.key + name, 0)]))
    if not g.shop:
        jambs = [q for u in (h.u0 - 0.2, h.u1) for q in f.block((u, u + 0.2), (0.0, 0.07), (0.0, h.z1), top=False)]
        b.quads(_TRIM, jambs + f.block((h.u0 - 0.3, h.u1 + 0.3), (0.0, 0.16), (h.z1, h.z1 + 0.22)))
    b.quads(_STEP, f.block((h.u0 - 0.05, h.u1 + 0.05), (-_DEEP, 0.12), (0.0, 0.07)))


def _plinth(b: Builder, f: Facade, door: Hole | None) -> None:
    spans = [(0.0, f.width)] if door is None else [(0.0, door.u0 - 0.2), (door.u1 + 0.2, f.width)]
    quads: list[Quad] = []
    for u0, u1 in spans:
        if u1 - u0 > 0.1:
            quads += f.block((u0, u1), (0.0, 0.05), (0.0, 0.38))
    b.quads(_BASE, quads)


def _shop(b: Builder, f: Facade, g: Ground, holes: list[Hole], door: int, high: float) -> None:
    """Add pilasters between the windows, a fascia with a cornice and, on a front, sign and awnings."""
    bay, quads = f.width / g.bays, []
    for k in range(g.bays + 1):
        u0, u1 = max(0.0, k * bay - 0.13), min(f.width, k * bay + 0.13)
        quads += f.block((u0, u1), (0.0, 0.09), (0.0, high + 0.1), top=False)
    b.quads(_FRONT, quads)
    b.quads(_TRIM, f.block((0.0, f.width), (0.0, 0.16), (high + 0.1, high + 0.18), sides=False))
    if door < 0:
        return
    u0, u1, z0, z1 = 0.3, f.width - 0.3, high + 0.2, high + 0.2 + 0.5
    b.quads(_SIGN, f.block((u0, u1), (0.0, 0.12), (z0, z1)))
    name = WORDS[int((noise(f.key, 17) + 1) / 2 * len(WORDS))]
    text = word(name, TYPEFACES[int((noise(f.key, 19) + 1) / 2 * len(TYPEFACES))])
    for height in (0.34, 0.26):
        long = text.length * height
        if long < u1 - u0 - 0.4:
            left = f.width > 12 and noise(f.key, 18) > 0
            middle = u0 + 0.4 + long / 2 if left else f.width / 2
            write(b, _LETTERS, f, text, middle, (z0 + z1 - height) / 2, height, 0.124)
            break
    if g.awning:
        for k, _ in enumerate(holes):
            if k != door:
                _awning(b, f, (k * bay + 0.16, (k + 1) * bay - 0.16), high + 0.08)


def _awning(b: Builder, f: Facade, u: tuple[float, float], high: float) -> None:
    """Add a stretched cloth awning with a valance, visible from both sides."""
    (u0, u1), low, reach = u, high - 0.5, 1.1
    top = (f.at(u0, reach, low), f.at(u1, reach, low), f.at(u1, 0.1, high), f.at(u0, 0.1, high))
    valance = f.face(u0, u1, low - 0.2, low, reach)
    left = (f.at(u0, 0.1, low), f.at(u0, reach, low), f.at(u0, 0.1, high), f.at(u0, 0.1, high))
    right = (f.at(u1, reach, low), f.at(u1, 0.1, low), f.at(u1, 0.1, high), f.at(u1, 0.1, high))
    b.quads(_AWNING, [top, valance, left, right])
    shade = [[(0.0, 0.8)] * 4] * 4
    b.quads(_UNDER, [top[::-1], valance[::-1], left[::-1], right[::-1]], np.array(shade))
