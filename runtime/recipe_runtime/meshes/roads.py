"""What one walks and drives on: asphalt with its marks, sidewalks with kerbs, and the ground beyond."""

from __future__ import annotations

from recipe_compiler import exact
from recipe_compiler.plan import Element

from recipe_runtime.meshes.builder import Builder, Vec
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.tags import Tag

_ASPHALT = Surface("asphalt", Pattern.ASPHALT, Tag.ROADS)
_PAINT = Surface("paint", Pattern.ROAD_PAINT, Tag.ROAD_LINES)
_CENTRE = Surface("centre", Pattern.ROAD_PAINT, Tag.ROAD_LINES)
_SLABS = Surface("slabs", Pattern.SLABS, Tag.SIDEWALKS)
_KERB = Surface("kerb", Pattern.CONCRETE, Tag.SIDEWALKS)
_YARD = Surface("yard", Pattern.GRASS, Tag.TERRAIN)
_GROUND = Surface("ground", Pattern.GRASS, Tag.GROUND)

_MARK = 0.006  # height of paint over the asphalt


def _sheet(x0: float, x1: float, y0: float, y1: float, z: float) -> tuple[Vec, ...]:
    return (x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)


def ground(b: Builder, e: Element) -> None:
    """A plain under everything, just below the streets; in strips, so that no triangle is kilometres long."""
    x, y, _ = e.size
    count = 12
    for i in range(count):
        for j in range(count):
            x0, y0 = x * (i / count - 0.5), y * (j / count - 0.5)
            b.quads(_GROUND, [_sheet(x0, x0 + x / count, y0, y0 + y / count, -0.04)])


def road(b: Builder, e: Element) -> None:
    """A stretch of street along x between two junctions: asphalt, centre and edge lines, stop lines."""
    length, width, _ = e.size
    half, side, stop = length / 2, width / 2, e.shape["stop"]
    b.quads(_ASPHALT, [_sheet(x, x + length / 6, -side, side, 0.0) for x in (half * (k / 3 - 1) for k in range(6))])
    dashes = int((length - 2 * stop - 2.0) / 4.5)
    first = -(dashes * 4.5 - 2.5) / 2
    b.quads(_CENTRE, [_sheet(x, x + 2.0, -0.06, 0.06, _MARK) for x in (first + 4.5 * k for k in range(dashes))])
    inner = half - stop
    edges = [_sheet(-inner, inner, y - 0.05, y + 0.05, _MARK) for y in (-side + 0.25, side - 0.25)]
    stops = [
        _sheet(-inner - 0.0, -inner + 0.35, 0.1, side - 0.3, _MARK),  # traffic towards -x keeps to +y
        _sheet(inner - 0.35, inner, -side + 0.3, -0.1, _MARK),
    ]
    solid = [_sheet(x, x + 3.2, -0.06, 0.06, _MARK) for x in (-inner + 0.5, inner - 3.7)]
    b.quads(_PAINT, edges + stops)
    b.quads(_CENTRE, solid)


def junction(b: Builder, e: Element) -> None:
    """Where two streets meet: asphalt under the rounded corners, and a zebra over each arm."""
    half, lane = e.size[0] / 2, e.shape["lane"]
    b.quads(_ASPHALT, [_sheet(-half, half, -half, half, 0.0)])
    near, far = e.shape["zebra_from"], e.shape["zebra_to"]
    far = min(far, half + 3.0)
    count, stripe = 6, 0.5
    for k in range(count):
        u = -lane + 2 * lane * (k + 0.5) / count
        for sign in (1, -1):
            a, c = sorted((sign * near, sign * far))
            b.quads(
                _PAINT,
                [
                    _sheet(u - stripe / 2, u + stripe / 2, a, c, _MARK),
                    _sheet(a, c, u - stripe / 2, u + stripe / 2, _MARK),
                ],
            )


def outline(x: float, y: float, radius: float, inset: float) -> list[tuple[float, float]]:
    """A rectangle with rounded corners, counter-clockwise, drawn in by `inset`; 6 points a corner."""
    points = []
    r = max(radius - inset, 0.01)
    for quarter, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        cx, cy = sx * (x / 2 - radius), sy * (y / 2 - radius)
        for k in range(6):
            s, c = exact.sin_cos_deg(90.0 * quarter + 18.0 * k)
            points.append((cx + r * c, cy + r * s))
    return points


def sidewalk(b: Builder, e: Element) -> None:
    """A block's raised ground: a kerb stone round it, paving `walk` metres wide, and the yards inside."""
    x, y, top = e.size
    radius, walk, kerb = e.shape["radius"], e.shape["walk"], 0.18
    outer, stone = outline(x, y, radius, 0.0), outline(x, y, radius, kerb)
    rounded = 0.025
    b.grid(
        _KERB,
        [
            [(px, py, -0.02) for px, py in outer],
            [(px, py, top - rounded) for px, py in outer],
            [(px, py, top) for px, py in outline(x, y, radius, rounded)],
            [(px, py, top) for px, py in stone],
        ],
        crease=0.6,
    )
    ix, iy = x / 2 - walk - 0.5, y / 2 - walk - 0.5
    inner = [(max(-ix, min(ix, px)), max(-iy, min(iy, py)), top) for px, py in stone]
    b.grid(_SLABS, [[(px, py, top) for px, py in stone], inner], crease=0.6)
    b.quads(_YARD, [_sheet(-ix, ix, -iy, iy, top)])
