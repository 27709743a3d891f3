"""What stands on sidewalks that are lived in: café tables, leaned bicycles, deliveries, boards, letter boxes."""

from __future__ import annotations

from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, Vec, circle, level, noise, upright
from recipe_runtime.meshes.facades import Facade
from recipe_runtime.meshes.furniture import lathed
from recipe_runtime.meshes.lettering import WORDS, write
from recipe_runtime.meshes.lofts import tube
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.typefaces import TYPEFACES, word


def _static(slot: str, pattern: Pattern) -> Surface:
    return Surface(slot, pattern, Tag.STATIC)


_METAL = _static("metal", Pattern.METAL)
_TOP = _static("top", Pattern.WOOD)
_CLOTH = _static("cloth", Pattern.CLOTH)
_SEAT = _static("seat", Pattern.WOOD)
_TYRE = _static("tyre", Pattern.RUBBER)
_FRAMES = tuple(_static(slot, Pattern.CAR_PAINT) for slot in ("paint", "other"))
_SADDLE = _static("tyre", Pattern.PLAIN)
_CARD = _static("card", Pattern.PLAIN)
_TAPE = _static("tape", Pattern.PLAIN)
_PALLET = _static("wood", Pattern.WOOD)
_SLATE = _static("slate", Pattern.PLAIN)
_CHALK = _static("chalk", Pattern.LETTER)
_BOX = _static("paint", Pattern.CAR_PAINT)
_SLOT = _static("slot", Pattern.NICHE)
_LETTERS = _static("chalk", Pattern.LETTER)
_FRONT = Facade((0.0, 0.0), (0, 1), (1, 0), 0.0, 0)  # u along y, d along x


def cafe(b: Builder, e: Element) -> None:
    """Build a round café table with two chairs, under a parasol."""
    key, height = int(e.shape["key"]), e.size[2]
    b.grid(_METAL, lathed([(0.0, 0.24), (0.03, 0.22), (0.05, 0.03), (0.7, 0.03)], 10), crease=0.5)
    b.grid(_TOP, lathed([(0.7, 0.36), (0.72, 0.37), (0.735, 0.36)], 16), crease=0.5, caps=(_TOP, _TOP))
    tube(b, _METAL, [(0.0, 0.0, 0.73), (0.0, 0.0, height)], 0.02, 6)
    for side in (1.0, -1.0):
        _chair(b, side, 0.08 * noise(key, 1))
    edge, top = height - 0.42, height - 0.06
    reach = min(e.size[0], e.size[1]) / 2
    ring = [(reach * c, reach * s, edge) for c, s in circle(8)]
    for n in range(8):
        p, q = ring[n], ring[(n + 1) % 8]
        b.fan(_CLOTH, [p, q, (0.0, 0.0, top)])
        b.fan(_CLOTH, [q, p, (0.0, 0.0, top)])
        low = [(x, y, edge - 0.12) for x, y, _ in (q, p)]
        b.quads(_CLOTH, [[low[1], low[0], q, p], [low[0], low[1], p, q]])


def _chair(b: Builder, side: float, shift: float) -> None:
    """Add a chair along y, which looks at the table."""
    y = side * 0.62
    b.box(_SEAT, (shift - 0.2, min(y - 0.2, y + 0.2), 0.44), (shift + 0.2, y + 0.2, 0.465))
    for x in (-0.18, 0.18):
        back = y + side * 0.19
        tube(
            b,
            _METAL,
            [(shift + x, back, 0.0), (shift + x, back, 0.44), (shift + x, back + side * 0.08, 0.86)],
            0.012,
            5,
        )
        tube(b, _METAL, [(shift + x, y - side * 0.19, 0.0), (shift + x, y - side * 0.19, 0.44)], 0.012, 5)
    for z in (0.6, 0.7, 0.8):
        at = y + side * (0.19 + 0.08 * (z - 0.44) / 0.42)
        b.box(_SEAT, (shift - 0.2, at - 0.01, z), (shift + 0.2, at + 0.01, z + 0.06))


def bicycles(b: Builder, e: Element) -> None:
    """Build a stand of hoops with bicycles that lean against them; each stands along y."""
    key, (long, _, _) = int(e.shape["key"]), e.size
    count = 3
    for n in range(count):
        x = long * ((n + 0.5) / count - 0.5)
        hoop = [(x, -0.32, 0.0), (x, -0.32, 0.62), (x, -0.22, 0.74), (x, 0.22, 0.74), (x, 0.32, 0.62), (x, 0.32, 0.0)]
        tube(b, _METAL, hoop, 0.022, 6)
        if n == 0 or noise(key, n) > -0.4:
            _bicycle(b, x + 0.1, 1.0 if noise(key, 8 + n) > 0 else -1.0, _FRAMES[n % 2])


def _bicycle(b: Builder, x: float, ahead: float, frame: Surface) -> None:
    """Add a bicycle along y that leans by a few degrees towards -x."""

    def at(along: float, z: float, aside: float = 0.0) -> Vec:
        return x - 0.09 * z + aside, ahead * along, z

    radius = 0.34
    for hub in (-0.52, 0.52):
        rim = [at(hub + radius * c, 0.017 + radius + radius * s) for c, s in circle(14)]
        tube(b, _TYRE, [*rim, rim[0]], 0.017, 4)
        for c, s in circle(6, 9.0):
            tube(b, _METAL, [at(hub, 0.35), at(hub + 0.95 * radius * c, 0.35 + 0.95 * radius * s)], 0.0025, 3)
    crank, seat, head = at(-0.08, 0.29), at(-0.22, 0.82), at(0.4, 0.86)
    rear, front = at(-0.52, 0.35), at(0.52, 0.35)
    for path in ([crank, at(-0.2, 0.74)], [at(-0.2, 0.72), at(0.38, 0.78)], [crank, at(0.42, 0.68)], [crank, rear]):
        tube(b, frame, path, 0.017, 6)
    tube(b, frame, [rear, at(-0.2, 0.72)], 0.011, 5)
    tube(b, frame, [front, at(0.43, 0.66), head], 0.014, 6)
    tube(b, _METAL, [at(-0.2, 0.74), seat], 0.012, 5)
    tube(b, _SADDLE, [at(-0.34, 0.87), at(-0.2, 0.87), at(-0.06, 0.86)], [0.07, 0.05, 0.02], 6)
    tube(b, _METAL, [at(0.37, 0.98, -0.27), at(0.42, 1.0), at(0.37, 0.98, 0.27)], 0.011, 5)
    tube(b, _METAL, [at(-0.08, 0.29, -0.12), at(-0.08, 0.29, 0.12)], 0.02, 6)


def delivery(b: Builder, e: Element) -> None:
    """Build a delivery: boxes stacked on a pallet."""
    key, (deep, wide, height) = int(e.shape["key"]), e.size
    for k in range(3):
        y = (k - 1) * (wide / 2 - 0.06)
        b.box(_PALLET, (-deep / 2, y - 0.05, 0.0), (deep / 2, y + 0.05, 0.1), "-z")
    b.box(_PALLET, (-deep / 2, -wide / 2, 0.1), (deep / 2, wide / 2, 0.14))
    z = 0.14
    for layer in range(3):
        tall = (height - 0.14) / 3
        if layer == 2 and noise(key, 5) < 0.0:
            break
        for side in (-1.0, 1.0):
            if layer == 2 and side * noise(key, 6) < 0.0:
                continue
            y0, y1 = sorted((side * 0.01, side * (wide / 2 - 0.03 - 0.04 * abs(noise(key, 2 * layer)))))
            x = deep / 2 - 0.03 - 0.04 * abs(noise(key, 2 * layer + 1))
            b.box(_CARD, (-x, y0, z), (x, y1, z + tall - 0.005))
            y = (y0 + y1) / 2
            b.box(_TAPE, (-x - 0.002, y - 0.03, z), (x + 0.002, y + 0.03, z + tall - 0.002), "-z")
        z += tall


def board(b: Builder, e: Element) -> None:
    """Build a folding board that faces +x and -x, with a word in chalk."""
    depth, width, height = e.size
    key = int(e.shape["key"])
    text = word(WORDS[key % len(WORDS)], TYPEFACES[key % len(TYPEFACES)])
    half, spread = width / 2, depth / 2
    b.quads(_PALLET, [level(-0.03, 0.03, -half, half, height)])
    for sign in (1.0, -1.0):
        low = [(sign * spread, -half, 0.04), (sign * spread, half, 0.04)]
        high = [(sign * 0.03, half, height), (sign * 0.03, -half, height)]
        face = [*low, *high] if sign > 0 else [*low, *high][::-1]
        b.quads(_PALLET, [face])
        end = [
            (sign * x, sign * half, z) for x, z in ((spread, 0.04), (0.03, height), (-0.03, height), (-spread, 0.04))
        ]
        b.quads(_PALLET, [end[::-1]])
        inner = [
            (x + sign * 0.006, 0.84 * y, 0.04 + 0.9 * (z - 0.04) + 0.05 * height)
            for x, y, z in ((sign * spread * 0.97, -half, 0.04), (sign * spread * 0.97, half, 0.04), *high)
        ]
        b.quads(_SLATE, [inner if sign > 0 else inner[::-1]])
    size = min(0.15, 0.8 * width / text.length)
    write(b, _CHALK, _FRONT, text, 0.0, 0.72 * height, size, 0.3 * spread + 0.05)


def letter_box(b: Builder, e: Element) -> None:
    """Build a letter box on a foot, whose slot faces +x."""
    deep, wide, height = e.size
    b.box(_METAL, (-0.08, -0.08, 0.0), (0.08, 0.08, 0.45), "-z +z")
    b.box(_BOX, (-deep / 2, -wide / 2, 0.45), (deep / 2, wide / 2, height - 0.08))
    b.box(_BOX, (-deep / 2 - 0.02, -wide / 2 - 0.02, height - 0.08), (deep / 2 + 0.02, wide / 2 + 0.02, height))
    x = deep / 2 + 0.003
    b.quads(_SLOT, [upright(x, -0.14, 0.14, height - 0.22, height - 0.18)])
    write(b, _LETTERS, _FRONT, word("POST", TYPEFACES[0]), 0.0, height - 0.42, 0.1, x)
