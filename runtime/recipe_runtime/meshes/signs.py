"""Traffic control: traffic lights, road signs, motorway gantries and guard rails.

All face +x, towards the approaching driver, whose right-hand side is +y.
"""

from __future__ import annotations

from collections.abc import Sequence

from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag
from recipe_compiler.ir.signals import LAMPS

from recipe_runtime.meshes.builder import Builder, circle, tube, upright
from recipe_runtime.meshes.glyphs import Point, arrow, stroke, width, write
from recipe_runtime.meshes.mesh import Mesh, Pattern, Surface

_POLE = Surface("metal", Pattern.METAL, Tag.POLES)
_HOUSING = Surface("housing", Pattern.PLAIN, Tag.TRAFFIC_LIGHT)
_RAIL = Surface("rail", Pattern.METAL, Tag.GUARD_RAIL)
_BACK = Surface("metal", Pattern.METAL, Tag.TRAFFIC_SIGNS)
STOP, SPEED, CROSSING, GIVE_WAY, PARKING, AHEAD, DEAD_END = range(7)
"""Values of a sign's parameter `face`."""
PLACES = ("AIRPORT", "HARBOUR", "CENTRE", "NORTHGATE", "STADIUM", "RIVERSIDE", "MUSEUM", "UNIVERSITY", "OLD TOWN",
          "LAKESIDE", "MARKET HALL", "WESTFIELD")  # fmt: skip


def _face(slot: str) -> Surface:
    return Surface(slot, Pattern.PLAIN, Tag.TRAFFIC_SIGNS)


def traffic_light(b: Builder, e: Element) -> None:
    """Build a traffic light with dark lenses: a mast with signals, an arm along -y with signals over the lane.

    `shape` has `arm`, the length of the arm in metres, and the times of `ir.signals`. The lit lenses are parts of their
    own, see `signal_lamps`.
    """
    _, _, height = e.size
    b.grid(_POLE, tube([(0, 0, 0), (0, 0, 0.6), (0, 0, 0.7), (0, 0, height)], [0.13, 0.12, 0.085, 0.06], 8), crease=0.5,
           caps=(None, _POLE))  # fmt: skip
    arm = e.shape["arm"]
    if arm > 0:
        z = height - 0.25
        b.box(_POLE, (-0.045, -arm - 0.1, z - 0.05), (0.045, 0.0, z + 0.05), "+y")
    for x, y, z in _heads(e):
        b.box(_HOUSING, (x, y - 0.17, z - 0.5), (x + 0.2, y + 0.17, z + 0.5))
        for colour, up in _LENSES.items():
            _round_lens(b, _dark(colour), (x, y, z), up, 0.0)
            b.box(_HOUSING, (x + 0.2, y - 0.14, z + up + 0.12), (x + 0.375, y + 0.14, z + up + 0.145), "-x")
    b.box(_HOUSING, (-0.12, -0.26, _WALK_HEIGHT), (0.12, -0.1, _WALK_HEIGHT + 0.56))
    for colour, low in _WALK_LENSES.values():
        _square_lens(b, _dark(colour), low, 0.0)


_LENSES = {"red": 0.31, "amber": 0.0, "green": -0.31}  # lamp -> height above the middle of its head, metres
_WALK_HEIGHT = 2.1  # metres above the ground, of the lower edge of the pedestrian signal
_WALK_LENSES = {"dont_walk": ("red", _WALK_HEIGHT + 0.31), "walk": ("green", _WALK_HEIGHT + 0.05)}
_RAISED = 0.004  # metres by which a lit lens lies before the dark one


def signal_lamps(e: Element) -> tuple[tuple[str, Mesh], ...]:
    """Return the lit lenses of a traffic light, a part for each of `ir.signals.LAMPS`, in the element's frame."""
    parts = []
    for lamp in LAMPS:
        b = Builder()
        if lamp in _WALK_LENSES:
            colour, low = _WALK_LENSES[lamp]
            _square_lens(b, _lit(colour), low, _RAISED)
        else:
            for head in _heads(e):
                _round_lens(b, _lit(lamp), head, _LENSES[lamp], _RAISED)
        parts.append((lamp, b.mesh()))
    return tuple(parts)


def _heads(e: Element) -> list[tuple[float, float, float]]:
    """Return the middles of the signal heads' backs: over the lane, if there is an arm, and on the mast."""
    arm = e.shape["arm"]
    over_lane = [(0.06, -arm, e.size[2] - 0.25)] if arm > 0 else []
    return [*over_lane, (0.1, 0.0, 2.9)]


def _dark(colour: str) -> Surface:
    return Surface(colour, Pattern.PLAIN, Tag.TRAFFIC_LIGHT)


def _lit(colour: str) -> Surface:
    return Surface(f"{colour}_lit", Pattern.SIGNAL, Tag.TRAFFIC_LIGHT)


def _round_lens(b: Builder, surface: Surface, head: tuple[float, float, float], up: float, raised: float) -> None:
    x, y, z = head
    b.fan(surface, [(x + 0.205 + raised, y + 0.115 * c, z + up + 0.115 * s) for c, s in circle(12)])


def _square_lens(b: Builder, surface: Surface, low: float, raised: float) -> None:
    y = -0.265 - raised
    b.quads(surface, [[(-0.08, y, low), (0.08, y, low), (0.08, y, low + 0.2), (-0.08, y, low + 0.2)]])


def sign(b: Builder, e: Element) -> None:
    """Build a sign on a post. `shape` has `face`, one of the constants above, and `value`, the speed limit in km/h."""
    _, across, height = e.size
    face, r = int(e.shape["face"]), across / 2
    z = height - r
    b.grid(_POLE, tube([(0, 0, 0), (0, 0, height - 0.1)], [0.034, 0.034], 6), caps=(None, _POLE))
    if face == STOP:
        _plate(b, "white", _ring(8, r, z, 22.5))
        _layer(b, "red", _ring(8, 0.94 * r, z, 22.5), 1)
        write(b, _face("white"), "STOP", (0.0, z), 0.46 * r, _x(2))
    elif face == SPEED:
        _plate(b, "red", _ring(20, r, z))
        _layer(b, "white", _ring(20, 0.78 * r, z), 1)
        write(b, _face("black"), str(int(e.shape["value"])), (0.0, z), 0.72 * r, _x(2))
    elif face == GIVE_WAY:
        _plate(b, "red", [(0.0, z - r), (r, z + 0.75 * r), (-r, z + 0.75 * r)])
        _layer(b, "white", [(0.0, z - 0.6 * r), (0.66 * r, z + 0.55 * r), (-0.66 * r, z + 0.55 * r)], 1)
    elif face == AHEAD:
        _plate(b, "blue", _ring(20, r, z))
        arrow(b, _face("white"), (0.0, z + 0.75 * r), (0.0, 1.0), 1.5 * r, _x(1))
    else:
        _square(b, face, r, z)


def _square(b: Builder, face: int, r: float, z: float) -> None:
    """Add the face of a blue square sign: crossing, parking or dead end."""
    _plate(b, "white", [(-r, z - r), (r, z - r), (r, z + r), (-r, z + r)])
    i = 0.93 * r
    _layer(b, "blue", [(-i, z - i), (i, z - i), (i, z + i), (-i, z + i)], 1)
    if face == PARKING:
        write(b, _face("white"), "P", (0.0, z), 1.2 * r, _x(2))
    elif face == DEAD_END:
        stroke(b, _face("white"), [(0.0, z - 0.75 * r), (0.0, z + 0.35 * r)], 0.26 * r, _x(2))
        stroke(b, _face("red"), [(-0.4 * r, z + 0.5 * r), (0.4 * r, z + 0.5 * r)], 0.3 * r, _x(3))
    else:
        _layer(b, "white", [(-0.8 * r, z - 0.7 * r), (0.8 * r, z - 0.7 * r), (0.0, z + 0.82 * r)], 2)
        _walker(b, 0.5 * r, z - 0.12 * r)


def _walker(b: Builder, s: float, z: float) -> None:
    """Add the pictogram of a pedestrian on a zebra crossing."""
    black = _face("black")
    b.fan(black, [(_x(3), 0.22 * s * c, z + 0.92 * s + 0.2 * s * q) for c, q in circle(8)])
    for points, wide in (
        ([(0.0, 0.6), (0.0, -0.05)], 0.3), ([(0.05, 0.0), (-0.42, -0.8)], 0.2), ([(0.0, 0.0), (0.42, -0.8)], 0.2),
        ([(0.0, 0.5), (0.45, 0.12)], 0.15), ([(0.0, 0.5), (-0.42, 0.15)], 0.15),
    ):  # fmt: skip
        stroke(b, black, [(u * s, z + v * s) for u, v in points], wide * s, _x(3))
    for k in range(3):
        u = (-0.75 + 0.75 * k) * s
        stroke(b, black, [(u - 0.16 * s, z - 1.06 * s), (u + 0.16 * s, z - 1.06 * s)], 0.14 * s, _x(3))


def _x(layer: int) -> float:
    """Return the x of a layer of a sign's face; each layer is slightly in front of the one before it."""
    return 0.05 + 0.004 * layer


def _ring(count: int, r: float, z: float, start: float = 0.0) -> list[Point]:
    return [(r * c, z + r * s) for c, s in circle(count, start)]


def _plate(b: Builder, slot: str, outline: Sequence[Point]) -> None:
    """Add a sign's plate: its first layer and its grey back."""
    _layer(b, slot, outline, 0)
    b.fan(_BACK, [(0.036, y, z) for y, z in reversed(outline)])
    b.grid(_BACK, [[(x, y, z) for y, z in outline] for x in (0.036, _x(0))])


def _layer(b: Builder, slot: str, outline: Sequence[Point], layer: int) -> None:
    b.fan(_face(slot), [(_x(layer), y, z) for y, z in outline])


def gantry(b: Builder, e: Element) -> None:
    """Build a gantry: a steel bridge over one carriageway, along y, with a board over each lane.

    `shape` has `lanes`, counted from the left, and `lane`, their width; `first`, the y of the leftmost lane's middle;
    `key`, which selects the place names; and `exit`, 1 if the rightmost board shows an exit.
    """
    depth, span, height = e.size
    x, half = depth / 2, span / 2
    for y in (-half, half):
        b.box(_POLE, (-0.2, y - 0.2, 0.0), (0.2, y + 0.2, height), "-z")
    for z in (height - 1.5, height - 0.12):
        for side in (-x, x - 0.12):
            b.box(_POLE, (side, -half, z), (side + 0.12, half, z + 0.12))
    bars = int(span / 1.4)
    for k in range(bars):
        a, c = -half + span * k / bars, -half + span * (k + 1) / bars
        low, high = height - 1.44, height - 0.06
        za, zc = (low, high) if k % 2 == 0 else (high, low)
        stroke(b, _POLE, [(a, za), (c, zc)], 0.07, x)
    lanes, lane, key = int(e.shape["lanes"]), e.shape["lane"], int(e.shape["key"])
    for n in range(lanes):
        out = e.shape["exit"] > 0 and n == lanes - 1
        y, place = e.shape["first"] + n * lane, PLACES[(key + n) % len(PLACES)]
        _board(b, y, height - 0.8, lane - 0.25, place, x + 0.06, out)


def _board(b: Builder, y: float, z: float, wide: float, place: str, x: float, out: bool) -> None:
    """Add a board 2.4 m high with a place name, and an arrow down to its lane or out to the exit."""
    half, low, high = wide / 2, z - 1.2, z + 1.2
    b.box(_BACK, (x - 0.05, y - half, low), (x, y + half, high), "+x")
    slot = "green" if out else "blue"
    b.quads(_face("white"), [upright(x, y - half, y + half, low, high)])
    m = 0.07
    b.quads(_face(slot), [upright(x + 0.012, y - half + m, y + half - m, low + m, high - m)])
    letter = min(0.5, 0.5 * (wide - 0.5) / width(place, 0.5))
    front = x + 0.024
    write(b, _face("white"), place, (y, z + 0.55), letter, front)
    if out:
        write(b, _face("white"), "EXIT", (y - 0.35, z - 0.5), 0.42, front)
        arrow(b, _face("white"), (y + half - 0.3, z - 0.15), (0.6, 0.8), 0.9, front)
    else:
        arrow(b, _face("white"), (y, z - 0.95), (0.0, -1.0), 1.0, front)


def guardrail(b: Builder, e: Element) -> None:
    """Build a W-beam guard rail on posts, with a beam on both sides if `double` is set."""
    thick, long, height = e.size
    half = long / 2
    sides = (1.0, -1.0) if e.shape["double"] > 0 else (1.0,)
    profile = [(0.0, 0.0), (0.055, 0.05), (0.055, 0.1), (0.0, 0.15), (0.055, 0.2), (0.055, 0.25), (0.0, 0.3)]
    for side in sides:
        outer = [(side * (thick / 2 - 0.055 + x), height - 0.3 + z) for x, z in profile]
        inner = [(side * (thick / 2 - 0.075), height - 0.3 + z) for z in (0.3, 0.0)]
        ring = outer + inner
        if side < 0:
            ring.reverse()
        b.grid(_RAIL, [[(x, y, z) for x, z in ring] for y in (half, -half)], crease=0.7, caps=(_RAIL, _RAIL))
    count = max(1, int(long / 4.0 + 0.5))
    for k in range(count):
        y = -half + long * (k + 0.5) / count
        b.box(_RAIL, (-0.05, y - 0.07, 0.0), (0.05, y + 0.07, height - 0.05), "-z")
        for side in sides:
            a, c = sorted((0.05 * side, side * (thick / 2 - 0.05)))
            b.box(_RAIL, (a, y - 0.06, height - 0.25), (c, y + 0.06, height - 0.08), "-x +x")
