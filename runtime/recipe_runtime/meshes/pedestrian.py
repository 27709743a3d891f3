"""Pedestrians: thirteen rigid parts lofted from cross-sections, which overlap at the joints so that no gap shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from recipe_compiler.plan import ActorPlan

from recipe_runtime.meshes.builder import Array, Builder, circle
from recipe_runtime.meshes.mesh import Mesh, Pattern, Surface
from recipe_runtime.meshes.skeleton import Figure

_SIDES = 12
_RING = circle(_SIDES)
Section = tuple[float, float, float, float]  # z, half depth (x), half width (y), x of its centre


class _Clothes:
    """The surfaces of one pedestrian."""

    def __init__(self, tag: int) -> None:
        self.skin = Surface("skin", Pattern.SKIN, tag)
        self.hair = Surface("hair", Pattern.HAIR, tag)
        self.shirt = Surface("shirt", Pattern.CLOTH, tag)
        self.trousers = Surface("trousers", Pattern.CLOTH, tag)
        self.shoes = Surface("shoes", Pattern.RUBBER, tag)


def _rings(sections: Sequence[Section], y: float = 0.0, square: float = 0.0) -> Array:
    """Rings of a loft, lowest first; `square` > 0 makes the ovals fuller."""
    rows = []
    for z, rx, ry, cx in sections:
        row = []
        for c, s in _RING:
            k = 1.0 + square * 4.0 * c * c * s * s
            row.append((cx + rx * c * k, y + ry * s * k, z))
        rows.append(row)
    return np.array(rows)


def _loft(b: Builder, surface: Surface, sections: Sequence[Section], y: float = 0.0, square: float = 0.0) -> None:
    """A closed smooth shape through sections listed from below to above."""
    ends = [sections[0], sections[-1]]
    low = (ends[0][0] - 0.25 * min(ends[0][1:3]), 0.6 * ends[0][1], 0.6 * ends[0][2], ends[0][3])
    high = (ends[1][0] + 0.25 * min(ends[1][1:3]), 0.6 * ends[1][1], 0.6 * ends[1][2], ends[1][3])
    b.grid(surface, _rings([low, *sections, high], y, square), crease=-1.0, caps=(surface, surface))


def pedestrian_parts(actor: ActorPlan) -> tuple[tuple[str, Mesh], ...]:
    """The base `pelvis`, then the parts of `Figure.joints` in their order, each about its joint."""
    figure, clothes = Figure.of(actor.shape), _Clothes(actor.tag)
    parts = [("pelvis", _pelvis(figure, clothes, actor))]
    for joint in figure.joints:
        kind, _, _ = joint.part.partition("_left" if joint.part.endswith("left") else "_right")
        s = 1.0 if joint.part.endswith("left") else -1.0
        b = Builder()
        if joint.part == "torso":
            _torso(b, figure, clothes, actor)
        elif joint.part == "head":
            _head(b, figure, clothes, int(actor.shape["hair"]))
        elif kind == "upper_arm":
            _upper_arm(b, figure, clothes, actor.shape["sleeves"] > 0)
        elif kind == "forearm":
            _forearm(b, figure, clothes, actor.shape["sleeves"] > 0, s)
        elif kind == "thigh":
            _thigh(b, figure, clothes, actor.shape["legs"])
        elif kind == "shin":
            _shin(b, figure, clothes, actor.shape["legs"])
        else:
            _foot(b, figure, clothes)
        parts.append((joint.part, b.mesh()))
    return tuple(parts)


def _pelvis(f: Figure, c: _Clothes, actor: ActorPlan) -> Mesh:
    h, g, coat = f.height, f.girth, actor.shape["coat"]
    b = Builder()
    _loft(
        b,
        c.trousers,
        [
            (0.462 * h, 0.045 * h * g, 0.055 * h * g, 0.0),
            (0.485 * h, 0.059 * h * g, 0.086 * h * g, -0.002 * h),
            (0.515 * h, 0.063 * h * g, 0.093 * h * g, -0.004 * h),
            (0.55 * h, 0.055 * h * g, 0.082 * h * g, -0.003 * h),
            (0.59 * h, 0.046 * h * g, 0.070 * h * g, 0.0),
        ],
        square=0.06,
    )
    if actor.shape["legs"] == 2:  # a skirt to the knees
        _skirt(b, c.trousers, [(0.31 * h, 0.128 * h, 0.128 * h), (0.40 * h, 0.102 * h * g, 0.115 * h * g)], h, g)
    if coat > 0.0:
        hem, wide = 0.50 * h - coat, 0.076 * h * g + 0.14 * coat
        _skirt(b, c.shirt, [(hem, wide, 0.108 * h * g + 0.06 * coat)], h, g * 1.06)
    return b.mesh()


def _skirt(b: Builder, surface: Surface, hem: list[tuple[float, float, float]], h: float, g: float) -> None:
    """Cloth from the waist down to a hem, open below, visible from inside too."""
    sections: list[Section] = [(z, rx, ry, 0.0) for z, rx, ry in hem]
    sections += [(0.50 * h, 0.072 * h * g, 0.102 * h * g, 0.0), (0.585 * h, 0.058 * h * g, 0.084 * h * g, 0.0)]
    rings = _rings(sections, square=0.04)
    b.grid(surface, rings, crease=-1.0)
    b.grid(surface, rings[:, ::-1] * [0.97, 0.97, 1.0], crease=-1.0)


def _torso(b: Builder, f: Figure, c: _Clothes, actor: ActorPlan) -> None:
    h, g, w = f.height, f.girth, f.shoulder
    belly = max(0.0, g - 1.0)
    hem = 0.507 * h
    rows = [
        (hem, 0.072 * g, 0.103 * g, -0.004),
        (0.545 * h, 0.069 * g, 0.097 * g, -0.002),
        (0.60 * h, 0.061 * g + 0.03 * belly, 0.084 * g, 0.002 + 0.03 * belly),
        (0.65 * h, 0.061 * g + 0.02 * belly, 0.083 * g, 0.003 + 0.02 * belly),
        (0.71 * h, 0.065 * g, 0.091 * g, 0.003),
        (0.755 * h, 0.065 * g, 0.80 * w / h + 0.016, 0.0),
        (0.788 * h, 0.058 * g, 0.98 * w / h + 0.014, -0.004),
        (0.808 * h, 0.047, 0.95 * w / h + 0.004, -0.006),
        (0.822 * h, 0.039, 0.68 * w / h, -0.007),
        (0.836 * h, 0.034, 0.042, -0.005),
        (0.850 * h, 0.030, 0.031, -0.003),
    ]
    _loft(b, c.shirt, [(z - f.chest, rx * h, ry * h, cx * h) for z, rx, ry, cx in rows], square=0.05)
    neck = [(0.80, 0.030, 0.030, -0.004), (0.84, 0.029, 0.028, -0.002), (0.875, 0.030, 0.029, 0.003)]
    _loft(b, c.skin, [(z * h - f.chest, rx * h, ry * h, cx * h) for z, rx, ry, cx in neck])


# The head above the neck joint, as fractions of its own height: z, front, back (half depths), half width.
_SKULL = (
    (0.02, 0.16, 0.20, 0.18),
    (0.09, 0.34, 0.22, 0.25),
    (0.17, 0.40, 0.26, 0.29),
    (0.28, 0.41, 0.33, 0.32),
    (0.40, 0.42, 0.40, 0.345),
    (0.52, 0.415, 0.44, 0.355),
    (0.64, 0.42, 0.455, 0.355),
    (0.76, 0.39, 0.43, 0.335),
    (0.86, 0.32, 0.36, 0.28),
    (0.94, 0.21, 0.24, 0.18),
    (0.985, 0.09, 0.10, 0.08),
)


def _skull(size: float, base: float, grow: float, lift: float = 0.0) -> Array:
    """Rings of the head, swollen by `grow` metres."""
    rows = []
    for z, front, back, width in _SKULL:
        row = []
        for c, s in _RING:
            depth = front if c > 0 else back
            row.append(((depth * size + grow) * c, (width * size + grow) * s, base + z * size + (grow + lift) * z))
        rows.append(row)
    return np.array(rows)


def _head(b: Builder, f: Figure, c: _Clothes, hair: int) -> None:
    size = 0.142 * f.height * f.head
    base = 0.022 * f.height
    b.grid(c.skin, _skull(size, base, 0.0), crease=-1.0, caps=(c.skin, c.skin))
    x, z = 0.415 * size, base + 0.40 * size  # the nose
    tip, bridge, w = (x + 0.13 * size, 0.0, z - 0.07 * size), (x - 0.01 * size, 0.0, z + 0.12 * size), 0.065 * size
    left, right = (x - 0.02 * size, w, z - 0.09 * size), (x - 0.02 * size, -w, z - 0.09 * size)
    b.smooth([c.skin] * 3, np.array([tip, bridge, left, right]), np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3)]), 0.3)
    for s in (1.0, -1.0):
        y, ex, ez = s * 0.145 * size, 0.385 * size, base + 0.49 * size
        eye = [(ex, y - 0.055 * size, ez), (ex, y + 0.055 * size, ez)]
        top = [(ex, y + 0.055 * size, ez + 0.045 * size), (ex, y - 0.055 * size, ez + 0.045 * size)]
        b.quads(c.hair, [[(px + 0.022 * size, py, pz) for px, py, pz in (*eye, *top)]])
        ear = [(zz * size + base, 0.045 * size, 0.035 * size, -0.02 * size) for zz in (0.37, 0.44, 0.54)]
        _loft(b, c.skin, ear, y=s * 0.36 * size)
    _hair(b, f, c, hair, size, base)


def _hair(b: Builder, f: Figure, c: _Clothes, hair: int, size: float, base: float) -> None:
    """A shell over the skull with the face left open; long hair falls over the neck."""
    thick = {0: 0.004, 1: 0.013, 2: 0.017, 3: 0.010, 4: 0.010}[hair] * f.height / 1.75
    rings = _skull(size, base, thick)
    cells: list[list[Surface | None]] = []
    for row in range(len(_SKULL) - 1):
        z, line = _SKULL[row][0], []
        for k in range(_SIDES):
            front = _RING[k][0] + _RING[(k + 1) % _SIDES][0]  # 2 straight ahead, -2 behind
            lowest = 0.74 if front > 0.6 else 0.5 if front > -0.3 else 0.2
            line.append(c.hair if z >= lowest else None)
        cells.append(line)
    b.grid(cells, rings, crease=-1.0, caps=(None, c.hair))
    if hair == 2:
        falls = [(-0.55, 0.10, 0.30), (-0.3, 0.15, 0.37), (0.1, 0.20, 0.40), (0.5, 0.20, 0.38), (0.7, 0.15, 0.32)]
        _loft(b, c.hair, [(base + z * size, rx * size, ry * size, -0.26 * size) for z, rx, ry in falls])
    if hair == 3:
        bun = [(0.62, 0.10, 0.10), (0.68, 0.17, 0.17), (0.76, 0.19, 0.19), (0.84, 0.15, 0.15)]
        _loft(b, c.hair, [(base + z * size, rx * size, ry * size, -0.52 * size) for z, rx, ry in bun])
    if hair == 4:
        z = base + 0.72 * size
        brim = [(0.36, 0.33), (0.62, 0.27), (0.74, 0.13)]
        low = [[(x * size, s * y * size, z - 0.04 * size * (x > 0.5)) for s in (1, -1)] for x, y in brim]
        quads = [[low[k][1], low[k + 1][1], low[k + 1][0], low[k][0]] for k in range(2)]
        b.quads(c.hair, quads)
        b.quads(c.hair, [q[::-1] for q in quads])


def _upper_arm(b: Builder, f: Figure, c: _Clothes, long: bool) -> None:
    h, g = f.height, 0.5 + 0.5 * f.girth
    sections = [
        (-0.185 * h, 0.0225, 0.0215, 0.0),
        (-0.15 * h, 0.0245, 0.0235, 0.0),
        (-0.09 * h, 0.0280, 0.0265, 0.0),
        (-0.035 * h, 0.0305, 0.0280, 0.0),
        (-0.010 * h, 0.0280, 0.0240, 0.0),
        (0.007 * h, 0.0190, 0.0150, 0.0),
    ]
    skin = [(z, rx * h * g, ry * h * g, cx) for z, rx, ry, cx in sections]
    if long:
        _loft(b, c.shirt, [(z, rx * 1.1, ry * 1.1, cx) for z, rx, ry, cx in skin])
        return
    _loft(b, c.skin, skin[:4])
    sleeve = [(-0.10 * h, 0.034, 0.033, 0.0), (-0.035 * h, 0.0335, 0.031, 0.0), (-0.006 * h, 0.029, 0.025, 0.0)]
    sleeve.append((0.008 * h, 0.020, 0.016, 0.0))
    _loft(b, c.shirt, [(z, rx * h * g, ry * h * g, cx) for z, rx, ry, cx in sleeve])


def _forearm(b: Builder, f: Figure, c: _Clothes, long: bool, side: float) -> None:
    h, g = f.height, 0.6 + 0.4 * f.girth
    arm = [
        (-0.148 * h, 0.0150, 0.0125, 0.0),
        (-0.10 * h, 0.0190, 0.0180, 0.0),
        (-0.04 * h, 0.0235, 0.0220, 0.0),
        (0.004 * h, 0.0225, 0.0215, 0.0),
    ]
    wide = 1.18 if long else 1.0
    surface = c.shirt if long else c.skin
    _loft(b, surface, [(z, rx * h * g * wide, ry * h * g * wide, cx) for z, rx, ry, cx in arm])
    hand = [
        (-0.245, 0.0095, 0.0060, 0.010),
        (-0.222, 0.0180, 0.0095, 0.007),
        (-0.195, 0.0225, 0.0115, 0.003),
        (-0.172, 0.0210, 0.0125, 0.001),
        (-0.150, 0.0145, 0.0120, 0.0),
        (-0.135, 0.0140, 0.0120, 0.0),
    ]
    _loft(b, c.skin, [(z * h, rx * h, ry * h, cx * h) for z, rx, ry, cx in hand])
    thumb = [(-0.205, 0.006, 0.006, 0.027), (-0.185, 0.008, 0.008, 0.023), (-0.165, 0.008, 0.008, 0.014)]
    _loft(b, c.skin, [(z * h, rx * h, ry * h, cx * h) for z, rx, ry, cx in thumb], y=-side * 0.006 * h)


def _thigh(b: Builder, f: Figure, c: _Clothes, legs: float) -> None:
    h, g = f.height, f.girth
    rows = [
        (-0.258, 0.0315, 0.0305, 0.001),
        (-0.21, 0.0345, 0.0330, 0.001),
        (-0.14, 0.0415, 0.0390, 0.0),
        (-0.06, 0.0480, 0.0440, -0.001),
        (-0.02, 0.0490, 0.0440, -0.003),
        (0.01, 0.0400, 0.0340, -0.003),
    ]
    loft = [(z * h, rx * h * g, ry * h * g, cx * h) for z, rx, ry, cx in rows]
    if legs == 1:
        _loft(b, c.trousers, [(z, rx * 1.06, ry * 1.06, cx) for z, rx, ry, cx in loft])
        return
    _loft(b, c.skin, loft)
    if legs == 2:  # where a striding leg pushes the skirt out, cloth shows
        cloth = [(-0.19, 0.052, 0.050, 0.0), (-0.10, 0.054, 0.050, 0.0), (0.0, 0.050, 0.046, -0.002)]
        _loft(b, c.trousers, [(z * h, rx * h * g, ry * h * g, cx * h) for z, rx, ry, cx in cloth])
    if legs == 0:
        shorts = [(-0.205, 0.052, 0.050, 0.0), (-0.12, 0.053, 0.050, 0.0), (0.0, 0.054, 0.050, -0.002)]
        _loft(b, c.trousers, [(z * h, rx * h * g, ry * h * g, cx * h) for z, rx, ry, cx in shorts])


def _shin(b: Builder, f: Figure, c: _Clothes, legs: float) -> None:
    h, g = f.height, 0.5 + 0.5 * f.girth
    rows = [
        (-0.235, 0.0190, 0.0175, 0.002),
        (-0.19, 0.0215, 0.0200, -0.001),
        (-0.12, 0.0285, 0.0265, -0.005),
        (-0.06, 0.0310, 0.0290, -0.005),
        (0.0, 0.0310, 0.0300, 0.0),
        (0.018, 0.0300, 0.0290, 0.001),
    ]
    loft = [(z * h, rx * h * g, ry * h * g, cx * h) for z, rx, ry, cx in rows]
    if legs != 1:
        _loft(b, c.skin, loft)
        return
    cloth = [(-0.232, 0.034, 0.031, 0.0), (-0.18, 0.033, 0.030, -0.001), (-0.12, 0.0335, 0.031, -0.003)]
    full = [(z * h, rx * h * g, ry * h * g, cx * h) for z, rx, ry, cx in cloth]
    _loft(b, c.trousers, full + [(z, rx * 1.08, ry * 1.08, cx) for z, rx, ry, cx in loft[3:]])


def _foot(b: Builder, f: Figure, c: _Clothes) -> None:
    """A shoe: sections along x from heel to toe, flat below, and an ankle."""
    h = f.height
    sole = -f.ankle
    rows = [  # x, half width, top of the shoe above the sole
        (-0.034, 0.014, 0.030),
        (-0.028, 0.021, 0.046),
        (-0.008, 0.0235, 0.052),
        (0.018, 0.0235, 0.046),
        (0.048, 0.0260, 0.034),
        (0.080, 0.0275, 0.026),
        (0.102, 0.0235, 0.021),
        (0.114, 0.0130, 0.014),
    ]
    rings = []
    for x, w, top in rows:
        ring = []
        for cy, sz in _RING:
            z = sz * 0.5 + 0.5
            ring.append(
                (x * h, w * h * cy * (1.0 if sz > -0.3 else 0.92), sole + top * h * max(0.0, min(1.0, z * 1.1 - 0.06)))
            )
        rings.append(ring)
    b.grid(c.shoes, rings, crease=0.2, caps=(c.shoes, c.shoes))
    ankle = [(-0.01, 0.021, 0.019, -0.004), (0.012, 0.020, 0.0185, 0.0)]
    _loft(b, c.skin, [(z * h, rx * h, ry * h, cx * h) for z, rx, ry, cx in ankle])
