"""Ground surfaces: asphalt with markings and repairs, sidewalks with kerbs, and the terrain around them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, Vec, circle, lattice, level, noise
from recipe_runtime.meshes.horizon import hills
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.vectors import unit

_ASPHALT = Surface("asphalt", Pattern.ASPHALT, Tag.ROADS)
_LANES = Surface("asphalt", Pattern.LANES, Tag.ROADS)
_PATCH = Surface("patch", Pattern.ASPHALT, Tag.ROADS)
_TAR = Surface("tar", Pattern.PLAIN, Tag.ROADS)
_IRON = Surface("iron", Pattern.METAL, Tag.ROADS)
_PAINT = Surface("paint", Pattern.ROAD_PAINT, Tag.ROAD_LINES)
_CENTRE = Surface("centre", Pattern.ROAD_PAINT, Tag.ROAD_LINES)
_SLABS = Surface("slabs", Pattern.SLABS, Tag.SIDEWALKS)
_SETTS = Surface("kerb", Pattern.SETTS, Tag.SIDEWALKS)
_COBBLES = Surface("setts", Pattern.SETTS, Tag.SIDEWALKS)
_PLATES = Surface("slabs", Pattern.PLATES, Tag.SIDEWALKS)
_KERB = Surface("kerb", Pattern.KERB, Tag.SIDEWALKS)
_YARD = Surface("yard", Pattern.GRASS, Tag.TERRAIN)
_PAVING = Surface("paving", Pattern.STONE, Tag.SIDEWALKS)
_BAND = Surface("slabs", Pattern.SETTS, Tag.SIDEWALKS)
_VERGE = Surface("verge", Pattern.GRASS, Tag.TERRAIN)
_PATH = Surface("path", Pattern.ASPHALT, Tag.SIDEWALKS)
_DRIVE = Surface("path", Pattern.CONCRETE, Tag.SIDEWALKS)
_GROUND = Surface("ground", Pattern.GRASS, Tag.GROUND)

_MEND, _MARK = 0.003, 0.007  # heights of repairs and of paint above the asphalt, metres


def ground(b: Builder, e: Element) -> None:
    """Build the ground plane, slightly below the streets, in strips of at most 200 m, and the hills at its edge."""
    x, y, _ = e.size
    count = 12
    for i in range(count):
        for j in range(count):
            x0, y0 = x * (i / count - 0.5), y * (j / count - 0.5)
            b.quads(_GROUND, [level(x0, x0 + x / count, y0, y0 + y / count, -0.04)])
    hills(b, e.shape["gap"])


def road(b: Builder, e: Element) -> None:
    """Build a section of a street along x between two junctions: two lanes, with markings and repairs.

    `shape` has `stop_a` and `stop_b`, the distances from the ends at -x and +x to their stop lines (0: no stop line);
    `bay`, the width of the parking bays along each kerb (0: none); `bays`, their number on either side, the first from
    x = `bay_from`, each `bay_length` long; and `key`, which selects the repairs. Lengths are in metres.
    """
    length, width, _ = e.size
    s, half, side = e.shape, length / 2, width / 2
    a, c = -half + s["stop_a"], half - s["stop_b"]
    lane, bay = side - s["bay"], s["bay"]
    _asphalt(b, half, side, lane, int(s["key"]))
    _dashes(b, a + (4.6 if s["stop_a"] else 0.8), c - (4.6 if s["stop_b"] else 0.8))
    if not bay:
        b.quads(_PAINT, [level(a, c, y - 0.05, y + 0.05, _MARK) for y in (-side + 0.25, side - 0.25)])
    if s["stop_a"]:  # traffic towards -x uses the lane at +y
        _stop(b, a, 1.0, lane)
    if s["stop_b"]:
        _stop(b, c, -1.0, lane)
    if s["bays"]:
        _bays(b, e, lane, side)
    _drains(b, (a, c), side)


def _dashes(b: Builder, start: float, end: float) -> None:
    """Add the dashed line between the lanes."""
    count = int((end - start - 1.0) / 4.5)
    first = (start + end) / 2 - (count * 4.5 - 2.5) / 2
    b.quads(_CENTRE, [level(x, x + 2.0, -0.06, 0.06, _MARK) for x in (first + 4.5 * k for k in range(count))])


def _stop(b: Builder, x: float, inward: float, lane: float) -> None:
    """Add a stop line, the solid line before it, and an arrow in its lane; `inward` points away from the junction."""

    def strip(u: float, v: float, y0: float, y1: float) -> tuple[Vec, ...]:
        p, q = sorted((x + inward * u, x + inward * v))
        r, t = sorted((inward * y0, inward * y1))
        return level(p, q, r, t, _MARK)

    b.quads(_PAINT, [strip(0.0, 0.4, 0.1, lane - 0.25)])
    b.quads(_CENTRE, [strip(0.5, 3.7, -0.06, 0.06)])
    mid = lane / 2
    b.quads(_PAINT, [strip(2.4, 5.6, mid - 0.07, mid + 0.07), strip(4.1, 4.24, mid - 0.6, mid + 0.6)])
    heads = [((1.5, mid), (2.5, mid - 0.26), (2.5, mid + 0.26))]
    for k in (1.0, -1.0):
        heads.append(((4.17, mid + k * 1.05), (4.17 - 0.26 * k, mid + k * 0.55), (4.17 + 0.26 * k, mid + k * 0.55)))
    for head in heads:
        b.fan(_PAINT, [(x + inward * u, inward * v, _MARK) for u, v in head])


def _bays(b: Builder, e: Element, lane: float, side: float) -> None:
    """Add the markings of parking bays: a line along the lane, and lines between the bays."""
    low, count, long = e.shape["bay_from"], int(e.shape["bays"]), e.shape["bay_length"]
    high = low + count * long
    for sign in (1, -1):
        y0, y1 = sorted((sign * lane, sign * (side - 0.05)))
        cross = [level(x - 0.05, x + 0.05, y0, y1, _MARK) for x in (low + k * long for k in range(count + 1))]
        edge = level(low, high, sign * lane - 0.05, sign * lane + 0.05, _MARK)
        b.quads(_PAINT, [edge, *cross])


def _strip(b: Builder, half: float, lanes: tuple[float, float, int], edges: tuple[float, float], step: float) -> None:
    """Add asphalt along x between two values of y, in pieces of about `step` metres.

    `lanes` are y of the first and the last lane's outer edges and the number of lanes; beside them, wheels leave no
    tracks.
    """
    low, high, count = lanes
    pieces = max(1, int(2 * half / step))
    xs = [-half + 2 * half * k / pieces for k in range(pieces + 1)]
    corner = [[(a, 0), (c, 0), (c, count), (a, count)] for a, c in pairwise(xs)]
    b.quads(_LANES, [level(a, c, low, high, 0.0) for a, c in pairwise(xs)], np.array(corner, np.float64))
    for y0, y1 in ((edges[0], low), (high, edges[1])):
        if y1 - y0 > 1e-6:
            b.quads(_ASPHALT, [level(a, c, y0, y1, 0.0) for a, c in pairwise(xs)])


def _asphalt(b: Builder, half: float, side: float, lane: float, key: int) -> None:
    """Add the asphalt with its signs of wear: patches, tarred cracks and manholes."""
    _strip(b, half, (-lane, lane, 2), (-side, side), 20.0)
    for k in range(int(half / 10)):
        x, y = 0.86 * half * noise(key, 10 * k), (side - 1.1) * noise(key, 10 * k + 1)
        long, wide = 1.6 + 1.2 * noise(key, 10 * k + 2), 0.8 + 0.4 * noise(key, 10 * k + 3)
        b.quads(_PATCH, [level(x - long, x + long, y - wide, y + wide, _MEND)])
    if key % 3 == 0:  # a filled trench
        y = (side - 1.0) * noise(key, 90)
        b.quads(_PATCH, [level(-0.7 * half, 0.8 * half, y - 0.35, y + 0.35, _MEND)])
    for k in range(int(half / 9)):
        _crack(b, 0.9 * half * noise(key, 200 + k), side, key + k)
    for k in range(max(1, int(half / 14))):
        _manhole(b, 0.8 * half * noise(key, 300 + k), 1.4 * (1 if noise(key, 320 + k) > 0 else -1))


def _crack(b: Builder, x: float, side: float, key: int) -> None:
    """Add a tar-sealed crack across the road."""
    steps, points = 7, []
    low, high = (-side, 0.2) if key % 2 else (-0.1, side)
    for k in range(steps + 1):
        points.append((x + 0.3 * noise(key, 400 + k), low + (high - low) * k / steps))
    w = 0.022
    b.quads(
        _TAR,
        [((ax - w, ay, _MEND), (ax + w, ay, _MEND), (cx + w, cy, _MEND), (cx - w, cy, _MEND))
         for (ax, ay), (cx, cy) in pairwise(points)],
    )  # fmt: skip


def _manhole(b: Builder, x: float, y: float) -> None:
    """Add a manhole cover in a ring of newer asphalt."""
    b.fan(_PATCH, [(x + 0.52 * c, y + 0.52 * s, 2 * _MEND) for c, s in circle(12)])
    b.fan(_IRON, [(x + 0.34 * c, y + 0.34 * s, 3 * _MEND) for c, s in circle(12)])


def _drains(b: Builder, along: tuple[float, float], side: float) -> None:
    """Add drain gratings at the kerbs."""
    a, c = along
    for n in range(max(1, int((c - a) / 22))):
        x = a + (n + 0.62) * (c - a) / max(1, int((c - a) / 22))
        for sign in (1, -1):
            y0, y1 = sorted((sign * (side - 0.42), sign * (side - 0.04)))
            b.quads(_IRON, [level(x - 0.3, x + 0.3, y0, y1, _MEND)])
            bars = [level(x - 0.24 + 0.12 * k, x - 0.18 + 0.12 * k, y0 + 0.06, y1 - 0.06, 2 * _MEND) for k in range(5)]
            b.quads(_TAR, bars)


def carriageway(b: Builder, e: Element) -> None:
    """Build a section of one carriageway of a motorway, towards +x: lanes, hard shoulder at -y, narrow strip at +y.

    `shape` has `lanes` of width `lane`; `shoulder`, the width of the hard shoulder; and `key`. Dashes are 6 m long
    every 12 m, so the length of a section is a multiple of 12 m. y = 0 is the middle of the asphalt.
    """
    length, width, _ = e.size
    s, half, side = e.shape, length / 2, width / 2
    lanes, lane, key = int(s["lanes"]), s["lane"], int(s["key"])
    right = -side + s["shoulder"]
    _asphalt_strips(b, half, side, right, lanes, lane, key)
    solid = [level(-half, half, y - 0.1, y + 0.1, _MARK) for y in (right, right + lanes * lane)]
    dashes = [
        level(x, x + 6.0, right + n * lane - 0.075, right + n * lane + 0.075, _MARK)
        for n in range(1, lanes)
        for x in (-half + 3.0 + 12.0 * k for k in range(int(length / 12.0)))
    ]
    b.quads(_PAINT, solid + dashes)


def _asphalt_strips(b: Builder, half: float, side: float, right: float, lanes: int, lane: float, key: int) -> None:
    """Add the surface of a motorway: darker wheel tracks, a rougher shoulder, joints and repaired sections."""
    _strip(b, half, (right, right + lanes * lane, lanes), (-side, side), 12.0)
    b.quads(_TAR, [level(-half, -half + 0.05, -side, side, _MEND)])
    for k in range(2):
        n, x = int((0.5 + 0.5 * noise(key, k)) * lanes), 0.7 * half * noise(key, 10 + k)
        long = min(4.0 + 3.0 * noise(key, 20 + k), half - abs(x))
        y0 = right + n * lane + 0.12
        b.quads(_PATCH, [level(x - long, x + long, y0, y0 + lane - 0.24, 0.0045)])
    for k in range(2):
        _crack(b, 0.9 * half * noise(key, 30 + k), side, key + k)


def junction(b: Builder, e: Element) -> None:
    """Build a junction: asphalt up to the rounded corners, and a zebra crossing on each arm.

    `shape` has `over_x`, the |x| of the crossings over the street along x; `wide_x`, half that street's width; `over_y`
    and `wide_y`, the same for the street along y; and `key`, which selects the repairs.
    """
    half_x, half_y, s = e.size[0] / 2, e.size[1] / 2, e.shape
    key = int(s["key"])
    b.quads(_ASPHALT, [level(-half_x, half_x, -half_y, half_y, 0.0)])
    x, y = 1.6 * noise(key, 1), 1.6 * noise(key, 2)
    b.quads(_PATCH, [level(x - 1.6, x + 1.4, y - 1.0, y + 1.2, _MEND)])
    _manhole(b, -1.8 * (1 if x > 0 else -1), 1.7 * noise(key, 3))
    _crack(b, 1.5 * noise(key, 4), half_y - 1.0, key)
    stripes = []
    for sign in (1, -1):
        a, c = sorted((sign * (s["over_x"] - 1.5), sign * (s["over_x"] + 1.5)))
        stripes += [level(a, c, u - 0.25, u + 0.25, _MARK) for u in _stripes(s["wide_x"])]
        a, c = sorted((sign * (s["over_y"] - 1.5), sign * (s["over_y"] + 1.5)))
        stripes += [level(u - 0.25, u + 0.25, a, c, _MARK) for u in _stripes(s["wide_y"])]
    b.quads(_PAINT, stripes)


def _stripes(half: float) -> list[float]:
    """Return the middles of a zebra crossing's stripes, one metre apart, for a street of that half width."""
    count = int(2 * half)
    return [-half + 2 * half * (k + 0.5) / count for k in range(count)]


def outline(x: float, y: float, radius: float, inset: float) -> list[tuple[float, float]]:
    """Return a rectangle with rounded corners, counter-clockwise, shrunk by `inset`; 6 points per corner."""
    points = []
    r = max(radius - inset, 0.01)
    for quarter, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        cx, cy = sx * (x / 2 - radius), sy * (y / 2 - radius)
        for k in range(6):
            s, c = exact.sin_cos_deg(90.0 * quarter + 18.0 * k)
            points.append((cx + r * c, cy + r * s))
    return points


def sidewalk(b: Builder, e: Element) -> None:
    """Build the raised ground of a block: kerb stones, paving `walk` metres wide, and the interior.

    `shape` also has `radius`, of the corners; `verge`, the width of the grass strip between kerb and paving; and
    `paved`, 1 if the interior is stone paving instead of grass.
    """
    x, y, top = e.size
    radius, walk, verge, kerb = e.shape["radius"], e.shape["walk"], e.shape["verge"], 0.18
    stone = outline(x, y, radius, kerb)
    _kerb(b, [outline(x, y, radius, inset) for inset in (0.0, 0.025, kerb)], top)
    edge = stone
    if verge:
        edge = _drawn_in(stone, x / 2 - verge, y / 2 - verge)
        b.grid(_VERGE, [[(px, py, top) for px, py in ring] for ring in (stone, edge)], crease=0.6)
        _ramps(b, (x / 2, y / 2), kerb, verge, walk, top)
    ix, iy = x / 2 - walk - 0.5, y / 2 - walk - 0.5
    if not verge:  # a strip of small stones behind the kerb
        inner = outline(x, y, radius, kerb + 0.3)
        b.grid(_SETTS, [[(px, py, top) for px, py in ring] for ring in (edge, inner)], crease=0.6)
        edge = inner
    kind = _PLATES if verge else _SLABS
    b.grid(kind, [[(px, py, top) for px, py in ring] for ring in (edge, _drawn_in(edge, ix, iy))], crease=0.6)
    if e.shape["paved"]:
        _square(b, ix, iy, top)
    else:
        b.quads(_YARD, [level(-ix, ix, -iy, iy, top)])


def _kerb(b: Builder, rings: list[list[tuple[float, float]]], top: float) -> None:
    """Add kerb stones along the outer ring, with a rounded edge up to the second ring and a top up to the third."""
    outer, edge, inner = (np.array([(*point, 0.0) for point in (*ring, ring[0])]) for ring in rings)
    steps = outer[1:] - outer[:-1]
    along = np.concatenate([[0.0], np.cumsum(np.sqrt(steps[:, 0] * steps[:, 0] + steps[:, 1] * steps[:, 1]))])
    out, up = unit(outer - inner), np.array([0.0, 0.0, 1.0])
    profile = ((outer, -0.02, 1.0, 0.0), (outer, top - 0.025, 1.0, 0.4), (edge, top, 0.4, 1.0), (inner, top, 0.0, 1.0))
    points = np.stack([ring + z * up for ring, z, _, _ in profile])
    normals = unit(np.stack([side * out + rise * up for _, _, side, rise in profile]))
    uvs = np.stack([np.stack([along, np.full(len(outer), z)], axis=1) for _, z, _, _ in profile])
    triangles = np.array(lattice(4, len(outer), False))
    b.add(_KERB, points.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2), triangles)


def _drawn_in(ring: list[tuple[float, float]], x: float, y: float) -> list[tuple[float, float]]:
    return [(max(-x, min(x, px)), max(-y, min(y, py))) for px, py in ring]


def _ramps(b: Builder, half: tuple[float, float], kerb: float, verge: float, walk: float, top: float) -> None:
    """Add paving across the verge at the zebra crossings, 3.5 m from the kerbs of the crossing streets."""
    (x, y), middle = half, 3.5
    for sx in (1, -1):
        for sy in (1, -1):
            a, c = sorted((sx * (x - middle - 1.5), sx * (x - middle + 1.5)))
            p, q = sorted((sy * (y - verge), sy * (y - kerb)))
            b.quads(_SLABS, [level(a, c, p, q, top + 0.004)])
            a, c = sorted((sx * (x - verge), sx * (x - kerb)))
            p, q = sorted((sy * (y - middle - 1.5), sy * (y - middle + 1.5)))
            b.quads(_SLABS, [level(a, c, p, q, top + 0.004)])


def _square(b: Builder, x: float, y: float, top: float) -> None:
    """Add the paving of a square: fields of stone between bands of another stone."""
    nx, ny, band = max(1, int(x / 4 + 0.5)), max(1, int(y / 4 + 0.5)), 0.3
    wide, high = 2 * x / nx, 2 * y / ny
    for i in range(nx):
        for j in range(ny):
            x0, y0 = -x + i * wide, -y + j * high
            b.quads(_PAVING, [level(x0 + band, x0 + wide, y0 + band, y0 + high, top)])
            b.quads(_BAND, [level(x0, x0 + band, y0, y0 + high, top), level(x0 + band, x0 + wide, y0, y0 + band, top)])


def parking(b: Builder, e: Element) -> None:
    """Build parking bays along x, flat on a sidewalk whose kerb is at +y. `shape` has their number, `bays`."""
    length, width, thick = e.size
    count, side = int(e.shape["bays"]), width / 2
    edges = [length * (k / count - 0.5) for k in range(count + 1)]
    b.quads(_COBBLES, [level(x0, x1, -side, side, thick) for x0, x1 in pairwise(edges)])
    half, top = 0.05, thick + _MARK - _MEND
    inner = -side + 2 * half
    middles = (edges[0] + half, *edges[1:-1], edges[-1] - half)
    cross = [level(x - half, x + half, inner, side, top) for x in middles]
    b.quads(_PAINT, [*cross, level(edges[0], edges[-1], -side, inner, top)])


def path(b: Builder, e: Element) -> None:
    """Build a path along x, flat on the ground: a footpath or, with `drive`, a concrete driveway."""
    length, width, thick = e.size
    half, side, pieces = length / 2, width / 2, max(1, int(length / 12))
    step, surface = length / pieces, _DRIVE if e.shape["drive"] else _PATH
    b.quads(surface, [level(-half + k * step, -half + (k + 1) * step, -side, side, thick) for k in range(pieces)])
