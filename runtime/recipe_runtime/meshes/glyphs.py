"""Writing on road signs: letters, figures and arrows as strokes made of triangles, legible at any resolution.

A glyph consists of strokes in a box 4 wide and 6 high. Sign faces point along +x; seen from the front, +y is to the
right, so text runs along +y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.mesh import Surface

_STROKES: dict[str, str] = {
    "A": "00 26 40|0.8,2 3.2,2", "B": "33 03 00 30 41 42 33 44 45 36 06 03", "C": "45 36 16 05 01 10 30 41",
    "D": "00 06 26 44 42 20 00", "E": "40 00 06 46|03 33", "F": "00 06 46|03 33", "G": "45 36 16 05 01 10 30 41 43 23",
    "H": "00 06|40 46|03 43", "I": "20 26", "J": "46 41 30 10 01", "K": "00 06|46 03 40", "L": "06 00 40",
    "M": "00 06 23 46 40", "N": "00 06 40 46", "O": "10 01 05 16 36 45 41 30 10", "P": "00 06 36 45 44 33 03",
    "Q": "10 01 05 16 36 45 41 30 10|22 40", "R": "00 06 36 45 44 33 03|23 40",
    "S": "45 36 16 05 04 13 33 42 41 30 10 01", "T": "06 46|26 20", "U": "06 01 10 30 41 46", "V": "06 20 46",
    "W": "06 10 24 30 46", "X": "00 46|06 40", "Y": "06 23 46|23 20", "Z": "06 46 00 40",
    "0": "10 01 05 16 36 45 41 30 10", "1": "15 26 20", "2": "05 16 36 45 44 00 40",
    "3": "05 16 36 45 44 33 42 41 30 10 01|33 13",
    "4": "30 36 02 42", "5": "46 06 04 34 43 41 30 10 01", "6": "45 36 16 05 01 10 30 41 42 33 03", "7": "06 46 10",
    "8": "13 04 05 16 36 45 44 33 13 02 01 10 30 41 42 33", "9": "01 10 30 41 45 36 16 05 04 13 43",
}  # fmt: skip

Point = tuple[float, float]


def _lines(glyph: str) -> list[list[Point]]:
    """Return the strokes of a glyph as points. A point is written as two digits, or as two numbers with a comma."""
    strokes = []
    for stroke in _STROKES[glyph].split("|"):
        points = [p.split(",") if "," in p else list(p) for p in stroke.split()]
        strokes.append([(float(u), float(v)) for u, v in points])
    return strokes


def stroke(b: Builder, surface: Surface, points: Sequence[Point], wide: float, x: float) -> None:
    """Add a polyline through points (y, z) at a given x, `wide` metres wide, with square ends."""
    half, quads = wide / 2, []
    for (ay, az), (cy, cz) in pairwise(points):
        dy, dz = cy - ay, cz - az
        length = math.sqrt(dy * dy + dz * dz)
        uy, uz = dy / length * half, dz / length * half
        p, q = (ay - uy, az - uz), (cy + uy, cz + uz)
        sides = ((p, 1), (q, 1), (q, -1), (p, -1))
        quads.append([(x, y + side * uz, z - side * uy) for (y, z), side in sides])
    b.quads(surface, quads)


def write(b: Builder, surface: Surface, text: str, middle: Point, height: float, x: float) -> None:
    """Add a text of capital letters and figures, centred on (y, z) at a given x; `height` in metres."""
    unit, wide = height / 6, 0.14 * height
    start = middle[0] - width(text, height) / 2
    for n, glyph in enumerate(text):
        if glyph == " ":
            continue
        left, low = start + n * 5.6 * unit, middle[1] - height / 2
        inset = wide / 2
        scale_y, scale_z = (4 * unit - wide) / 4, (height - wide) / 6
        for points in _lines(glyph):
            stroke(b, surface, [(left + inset + u * scale_y, low + inset + v * scale_z) for u, v in points], wide, x)


def width(text: str, height: float) -> float:
    """Return the length in metres of a text of that height."""
    return (5.6 * len(text) - 1.6) * height / 6


def arrow(b: Builder, surface: Surface, tip: Point, way: Point, size: float, x: float) -> None:
    """Add an arrow that ends at `tip` and points along the unit vector `way`, `size` metres long."""
    (ty, tz), (wy, wz) = tip, way
    back = (ty - 0.45 * size * wy, tz - 0.45 * size * wz)
    half = 0.33 * size
    head = [(x, ty, tz), (x, back[0] - half * wz, back[1] + half * wy), (x, back[0] + half * wz, back[1] - half * wy)]
    b.fan(surface, head)
    stroke(b, surface, [(ty - 0.92 * size * wy, tz - 0.92 * size * wz), back], 0.16 * size, x)
