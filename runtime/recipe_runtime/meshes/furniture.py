"""Street furniture: lamps, benches, bins, hydrants, bollards, bus stops, kiosks, billboards."""

from __future__ import annotations

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, Vec, noise, tube, upright
from recipe_runtime.meshes.facades import Facade, pane_uv
from recipe_runtime.meshes.lettering import write
from recipe_runtime.meshes.mesh import Light, Pattern, Surface
from recipe_runtime.meshes.typefaces import TYPEFACES, word
from recipe_runtime.meshes.vectors import Array


def _static(slot: str, pattern: Pattern) -> Surface:
    return Surface(slot, pattern, Tag.STATIC)


_POLE = Surface("metal", Pattern.METAL, Tag.POLES)
_LAMP = Surface("lamp", Pattern.LAMP, Tag.POLES)
_BAND = Surface("band", Pattern.PLAIN, Tag.POLES)
_WOOD = _static("wood", Pattern.WOOD)
_METAL = _static("metal", Pattern.METAL)
_CAP = _static("cap", Pattern.METAL)
_GLASS = _static("glass", Pattern.GLASS)
_ROOF = _static("roof", Pattern.METAL)
_SIGN = _static("sign", Pattern.PLAIN)
_LETTERS = _static("sign", Pattern.LETTER)
_POSTER = _static("board", Pattern.POSTER)
_PANEL = _static("wall", Pattern.CLAPBOARD)
_TRIM = _static("trim", Pattern.PLAIN)
_FRONTAL = Facade((0.0, 0.0), (0, 1), (1, 0), 0.0, 0)  # u along y, d along x
_DISPLAY = _static("shop", Pattern.SHOP_WINDOW)
_AWNING = _static("awning", Pattern.CLOTH)


def lathed(profile: list[tuple[float, float]], sides: int) -> Array:
    """Return rings around the z axis from (height, radius) pairs, for `Builder.grid`."""
    return tube([(0.0, 0.0, z) for z, _ in profile], [r for _, r in profile], sides)


def picture(key: int, names: int = 64) -> Array:
    """Return the uv of a poster, corners counter-clockwise from the lower left; the key selects the picture."""
    return pane_uv([(key % names, 0)])


def lamp(b: Builder, e: Element) -> None:
    """Build a street lamp: a pole with an arm over the street (+x) and a lantern that shines downwards."""
    _, thick, height = e.size
    arm, r = e.shape["arm"], thick / 2
    b.grid(_POLE, lathed([(0, 1.6 * r), (0.7, 1.5 * r), (0.78, r)], 8), crease=0.5)
    b.grid(_POLE, lathed([(0.7, r), (height - 0.5, 0.55 * r)], 8))
    rings = []
    for k in range(4):  # a quarter circle from the pole into the arm
        s, c = exact.sin_cos_deg(30.0 * k)
        x, z = 0.5 * (1 - c), height - 0.5 + 0.5 * s
        ring = [exact.sin_cos_deg(60.0 * n) for n in range(6)]
        rings.append([(x + 0.5 * r * rc * c, 0.5 * r * rs, z - 0.5 * r * rc * s) for rs, rc in ring])
    rings.append([(arm, py, pz) for _, py, pz in rings[-1]])
    b.grid(_POLE, rings)
    b.box(_POLE, (arm - 0.15, -0.13, height - 0.06), (arm + 0.55, 0.13, height + 0.05))
    b.box(_LAMP, (arm - 0.08, -0.1, height - 0.09), (arm + 0.48, 0.1, height - 0.06), "+z")
    b.lights.append(Light((arm + 0.2, 0.0, height - 0.1), (0.0, 0.0, -1.0), (1.0, 0.78, 0.5), 1400.0, 0.25))


def bench(b: Builder, e: Element) -> None:
    """Build a bench that faces +x: slats on two iron legs."""
    depth, width, height = e.size
    half = width / 2
    for k in range(3):
        x = -depth / 2 + 0.08 + 0.16 * k
        b.box(_WOOD, (x, -half, 0.42), (x + 0.12, half, 0.46))
    for k in range(2):
        z = 0.56 + 0.16 * k
        b.box(_WOOD, (-depth / 2 - 0.02, -half, z), (-depth / 2 + 0.02, half, min(z + 0.12, height)))
    for y in (-half + 0.2, half - 0.26):
        b.box(_METAL, (-depth / 2 + 0.02, y, 0.0), (-depth / 2 + 0.07, y + 0.06, height), "-z")
        b.box(_METAL, (depth / 2 - 0.07, y, 0.0), (depth / 2 - 0.02, y + 0.06, 0.42), "-z")
        b.box(_METAL, (-depth / 2, y, 0.37), (depth / 2, y + 0.06, 0.42))


def bin_(b: Builder, e: Element) -> None:
    """Build a round litter bin with a lid."""
    across, _, height = e.size
    r = across / 2 / 1.08
    body = [(0.0, 0.85 * r), (0.8, r), (0.82, 1.08 * r), (0.86, 1.08 * r), (1.0, 0.45 * r)]
    b.grid(_METAL, lathed([(z * height, radius) for z, radius in body], 12), crease=0.6, caps=(None, _METAL))


def hydrant(b: Builder, e: Element) -> None:
    """Build a fire hydrant: a barrel with a domed cap and three outlets."""
    across, _, height = e.size
    r = across / 2
    profile = [(0.0, 0.8), (0.06, 0.8), (0.08, 0.52), (0.62, 0.5), (0.64, 0.7), (0.7, 0.7), (0.72, 0.5)]
    b.grid(_METAL, lathed([(z * height, k * r) for z, k in profile], 10), crease=0.6)
    dome = [(0.72, 0.58), (0.8, 0.54), (0.88, 0.38), (0.93, 0.16), (0.94, 0.12), (1.0, 0.12)]
    b.grid(_CAP, lathed([(z * height, k * r) for z, k in dome], 10), crease=0.6, caps=(None, _CAP))
    for s, c, low, size in ((0, 1, 0.42, 0.2), (1, 0, 0.5, 0.15), (-1, 0, 0.5, 0.15)):
        a = size * r * 1.6
        x, y, z = c * r, s * r, low * height
        corner = (min(x - s * a, x + s * a, 0.3 * x), min(y - c * a, y + c * a, 0.3 * y))
        far = (max(x - s * a, x + s * a, 0.3 * x), max(y - c * a, y + c * a, 0.3 * y))
        b.box(_CAP, (*corner, z - a), (*far, z + a))


def bollard(b: Builder, e: Element) -> None:
    """Build a bollard with a bright band."""
    across, _, height = e.size
    r = across / 2
    b.grid(_POLE, lathed([(0.0, r), (0.05, r), (0.07, 0.72 * r), (0.78 * height, 0.66 * r)], 10), crease=0.6)
    b.grid(_BAND, lathed([(0.78 * height, 0.66 * r), (0.88 * height, 0.66 * r)], 10))
    top = [(0.88 * height, 0.66 * r), (0.95 * height, 0.6 * r), (height, 0.25 * r)]
    b.grid(_POLE, lathed(top, 10), crease=0.5, caps=(None, _POLE))


def bus_stop(b: Builder, e: Element) -> None:
    """Build a bus stop: a shelter open towards +x with a roof on posts, glass panes, a bench and a poster."""
    depth, width, height = e.size
    x, y = depth / 2, width / 2
    b.box(_ROOF, (-x, -y, height - 0.14), (x, y, height))
    posts = [(-x + 0.06, py) for py in (-y + 0.05, -y / 3, y / 3, y - 0.05)]
    posts += [(x - 0.35, -y + 0.05), (x - 0.35, y - 0.05)]
    for px, py in posts:
        b.box(_METAL, (px - 0.04, py - 0.04, 0.0), (px + 0.04, py + 0.04, height - 0.14), "-z +z")
    for z in (0.2, height - 0.5):
        b.box(_METAL, (-x + 0.03, -y + 0.05, z), (-x + 0.09, y - 0.05, z + 0.06), "-y +y")
    b.box(_GLASS, (-x + 0.05, -y + 0.05, 0.26), (-x + 0.07, y - 0.05, 1.1), "-y +y")
    b.box(_SIGN, (x - 0.03, -y + 0.2, height - 0.42), (x - 0.01, -y + 1.6, height - 0.14))
    write(b, _LETTERS, _FRONTAL, word("BUS", TYPEFACES[0]), -y + 0.9, height - 0.38, 0.2, x - 0.006)
    b.box(_WOOD, (-x + 0.16, -y + 0.5, 0.42), (-x + 0.56, y - 1.3, 0.48))
    for py in (-y + 0.7, y - 1.5):
        b.box(_METAL, (-x + 0.3, py - 0.03, 0.0), (-x + 0.36, py + 0.03, 0.42), "-z +z")
    _case(b, (-x + 0.2, x - 0.39), (y - 0.13, y - 0.02), (0.25, 2.0))


def _case(b: Builder, x: Vec, y: Vec, z: Vec) -> None:
    """Add an illuminated case with a poster on both sides."""
    (x0, x1), (y0, y1), (z0, z1), m = x, y, z, 0.05
    b.box(_METAL, (x0, y0, z0), (x1, y1, z1))
    near = [(x0 + m, y0 - 0.004, z0 + m), (x1 - m, y0 - 0.004, z0 + m)]
    near += [(x1 - m, y0 - 0.004, z1 - m), (x0 + m, y0 - 0.004, z1 - m)]
    b.quads(_POSTER, [near], picture(5))
    far = [(px, y1 + 0.004, pz) for px, _, pz in near]
    b.quads(_POSTER, [[far[1], far[0], far[3], far[2]]], picture(9))


def kiosk(b: Builder, e: Element) -> None:
    """Build a kiosk that is open towards +x: a counter and a display under an awning, and a sign on its roof."""
    depth, width, height = e.size
    x, y, key = depth / 2, width / 2, int(e.shape["key"])
    front, top = x - 0.6, height - 0.35  # the awning extends beyond the rest
    b.box(_PANEL, (-x, -y, 0.0), (front, y, top), "-z +x")
    b.quads(_PANEL, [upright(front, -y, y, 0.0, 0.95), upright(front, -y, y, 2.1, top)])
    b.quads(_PANEL, [upright(front, -y, -y + 0.25, 0.95, 2.1), upright(front, y - 0.25, y, 0.95, 2.1)])
    b.quads(_DISPLAY, [upright(front, -y + 0.25, y - 0.25, 0.95, 2.1)], pane_uv([(key, 0)]))
    b.box(_TRIM, (front, -y + 0.15, 0.88), (front + 0.3, y - 0.15, 0.95), "-x")
    b.box(_ROOF, (-x - 0.0, -y, top), (front, y, top + 0.08), "-z")
    b.box(_SIGN, (front - 0.12, -y + 0.3, top + 0.08), (front - 0.04, y - 0.3, height))
    write(b, _LETTERS, _FRONTAL, word("NEWS", TYPEFACES[1]), 0.0, top + 0.11, height - top - 0.14, front - 0.036)
    low, high, reach = 2.05, 2.35, x
    slope = [(reach, -y, low), (reach, y, low), (front, y, high), (front, -y, high)]
    valance = upright(reach, -y, y, low - 0.16, low)
    b.quads(_AWNING, [slope, slope[::-1], valance, valance[::-1]])
    corners = ((0.4, 0.6), (1.3, 0.6), (1.3, 1.9), (0.4, 1.9))
    b.quads(_POSTER, [[(-x + along, -y - 0.01, z) for along, z in corners]], picture(key + 3))


def billboard(b: Builder, e: Element) -> None:
    """Build a billboard that faces +x: a large picture on two posts, with a walkway and lamps below it."""
    depth, width, height = e.size
    x, y, key = depth / 2, width / 2, int(e.shape["key"])
    low = height * (0.42 + 0.04 * noise(key, 1))
    for py in (-0.3 * width, 0.3 * width):
        b.grid(_POLE, tube([(-0.1, py, 0.0), (-0.1, py, height - 0.2)], [0.11, 0.11], 8), caps=(None, _POLE))
    b.box(_METAL, (-0.04, -y, low), (0.06, y, height))
    m = 0.12
    b.quads(_POSTER, [upright(0.066, -y + m, y - m, low + m, height - m)], picture(key))
    b.box(_METAL, (-0.04, -y, low - 0.12), (x, y, low - 0.06))
