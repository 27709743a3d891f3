"""Typefaces of shop signs: letters as strokes of a flat nib, or of a round pen along curves.

A letter is drawn in a box 6 units high; its width is that of its strokes. Nothing but sums, products and square roots
is computed, so every machine gets the same outlines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from recipe_runtime.meshes.vectors import Array

Point = tuple[float, float]


@dataclass(frozen=True)
class Typeface:
    """A style of letters; lengths are shares of the height of a capital."""

    across: float  # thickness of upright strokes
    level: float  # thickness of level strokes
    width: float  # of letters, as a factor
    gap: float  # between letters
    slant: float = 0.0  # to the right, by height
    serif: float = 0.0  # length of serifs to either side; 0: none
    small: float = 1.0  # height of the letters after the first: small capitals


TYPEFACES = (
    Typeface(0.17, 0.15, 0.84, 0.11),  # bold
    Typeface(0.11, 0.11, 0.5, 0.09),  # condensed
    Typeface(0.125, 0.045, 0.85, 0.13, serif=0.075, small=0.8),  # roman, small capitals
    Typeface(0.12, 0.06, 0.8, 0.07, slant=0.22),  # italic
    Typeface(0.065, 0.06, 0.95, 0.32),  # light, letter-spaced
)

# Strokes of letters: points from the lower left, straight or, after "~", on a curve that they control.
_STROKES: dict[str, str] = {
    "A": "0,0 2,6|2,6 4,0|0.7,1.9 3.3,1.9",
    "B": "0,0 0,6|~0,6 1.8,6 3.6,6 3.6,3.1 1.8,3.1 0,3.1|~0,3.1 2,3.1 4,3.1 4,0 2,0 0,0",
    "C": "~3.9,4.5 3.7,6 2.1,6 0,6 0,3 0,0 2.1,0 3.7,0 3.9,1.5",
    "D": "0,0 0,6|~0,6 1.6,6 4,6 4,3 4,0 1.6,0 0,0",
    "E": "0,0 0,6|0,6 3.4,6|0,3.1 2.9,3.1|0,0 3.5,0",
    "F": "0,0 0,6|0,6 3.4,6|0,3 2.9,3",
    "G": "~3.9,4.6 3.7,6 2.1,6 0,6 0,3 0,0 2.1,0 3.3,0 3.9,0.7|3.9,0.6 3.9,2.7|2.4,2.7 3.9,2.7",
    "H": "0,0 0,6|3.8,0 3.8,6|0,3.1 3.8,3.1",
    "I": "0,0 0,6",
    "K": "0,0 0,6|0,2.4 3.6,6|1.3,3.6 3.8,0",
    "L": "0,0 0,6|0,0 3.3,0",
    "M": "0,0 0,6|0,6 2.4,1.2|2.4,1.2 4.8,6|4.8,0 4.8,6",
    "N": "0,0 0,6|0,6 3.9,0|3.9,0 3.9,6",
    "O": "~2.1,6 0.6,6 0,4.6 0,1.4 0.6,0 3.6,0 4.2,1.4 4.2,4.6 3.6,6 2.1,6",
    "P": "0,0 0,6|~0,6 1.8,6 3.8,6 3.8,2.8 1.8,2.8 0,2.8",
    "R": "0,0 0,6|~0,6 1.8,6 3.8,6 3.8,3 1.8,3 0,3|1.7,3 3.9,0",
    "S": "~3.6,4.6 3.5,6 1.9,6 0.2,6 0.2,3.3 1.9,3.1 3.8,2.8 3.8,0 1.9,0 0.1,0 0,1.4",
    "T": "2,0 2,6|0,6 4,6",
    "U": "~0,6 0,4 0,2 0,0 1.9,0 3.8,0 3.8,2 3.8,4 3.8,6",
    "W": "1.3,0 0,6|1.3,0 2.6,5|3.9,0 2.6,5|3.9,0 5.2,6",
    "X": "0,0 3.9,6|3.9,0 0,6",
    "Y": "2,0 2,2.7|2,2.7 0,6|2,2.7 4,6",
    "Z": "0,6 3.8,6|0,0 3.8,6|0,0 3.8,0",
}


@dataclass(frozen=True)
class Word:
    """A word of height 1: its outlines, and a box around each letter."""

    quads: Array  # [N, 4, 2], counter-clockwise, to the right and upwards
    boxes: tuple[tuple[str, float, float, float], ...]  # letter, left, right, height
    length: float


@lru_cache(maxsize=256)
def word(text: str, face: Typeface) -> Word:
    """Return a word in a typeface."""
    quads, boxes, at = [], [], 0.0
    for n, letter in enumerate(text):
        size = 1.0 if n == 0 else face.small
        outline, wide = _letter(letter, face)
        quads.append(outline * size + np.array([at, 0.0]))
        boxes.append((letter, at, at + wide * size, size))
        at += wide * size + face.gap
    return Word(np.concatenate(quads), tuple(boxes), at - face.gap)


@lru_cache(maxsize=256)
def _letter(letter: str, face: Typeface) -> tuple[Array, float]:
    """Return a letter's outlines [N, 4, 2] of height 1 and its width."""
    found: list[list[Point]] = []
    widest = 0.0
    for text in _STROKES[letter].split("|"):
        points = [(float(u), float(v)) for u, v in (p.split(",") for p in text.lstrip("~").split())]
        half, rise = face.across / 2, face.level / 2
        line = [(half + u / 6 * face.width, rise + v / 6 * (1.0 - face.level)) for u, v in points]
        widest = max(widest, *(x for x, _ in line))
        if text.startswith("~"):
            found += _ribbon(_rounded(_rounded(line)), half, rise)
        else:
            found += _straight(line[0], line[1], half, rise)
            found += _serifs(line[0], line[1], face) if face.serif else []
    outline = np.array(found)
    outline[..., 0] += face.slant * outline[..., 1]
    return outline, widest + face.across / 2


def _straight(a: Point, c: Point, half: float, rise: float) -> list[list[Point]]:
    """Return what a flat nib, narrower for oblique strokes, covers between two points."""
    (ax, az), (cx, cz) = sorted((a, c), key=lambda p: p[1])
    if ax == cx or az == cz:
        x0, x1 = min(ax, cx) - half, max(ax, cx) + half
        return [[(x0, az - rise), (x1, az - rise), (x1, cz + rise), (x0, cz + rise)]]
    w = 0.75 * half
    if cx > ax:
        ring = [(ax - w, az - rise), (ax + w, az - rise), (cx + w, cz - rise), (cx + w, cz + rise),
                (cx - w, cz + rise), (ax - w, az + rise)]  # fmt: skip
    else:
        ring = [(ax + w, az - rise), (ax + w, az + rise), (cx + w, cz + rise), (cx - w, cz + rise),
                (cx - w, cz - rise), (ax - w, az - rise)]  # fmt: skip
    return [ring[:4], [ring[0], *ring[3:]]]


def _serifs(a: Point, c: Point, face: Typeface) -> list[list[Point]]:
    """Return the serifs of a straight stroke at the foot and the top of the line."""
    found, upright = [], abs(c[1] - a[1]) > 0.2
    for x, z in (a, c):
        rise = face.level / 2
        if min(z, 1.0 - z) > face.level:
            continue
        if upright:
            wide = face.across / 2 + face.serif
            found.append([(x - wide, z - rise), (x + wide, z - rise), (x + wide, z + rise), (x - wide, z + rise)])
        else:
            low, high = (z - rise, z + 2 * face.serif) if z < 0.5 else (z - 2 * face.serif, z + rise)
            found.append([(x - rise, low), (x + rise, low), (x + rise, high), (x - rise, high)])
    return found


def _rounded(line: list[Point]) -> list[Point]:
    """Cut the corners of a line once (Chaikin), without points on straight parts; its ends stay."""
    cut = [line[0]]
    for (ax, az), (cx, cz) in pairwise(line):
        cut += [(0.75 * ax + 0.25 * cx, 0.75 * az + 0.25 * cz), (0.25 * ax + 0.75 * cx, 0.25 * az + 0.75 * cz)]
    cut.append(line[-1])
    bends = [abs(_turn(a, b, c)) for a, b, c in zip(cut, cut[1:], cut[2:], strict=False)]
    return [cut[0], *(point for point, bend in zip(cut[1:], bends, strict=False) if bend > 1e-6), cut[-1]]


def _ribbon(line: list[Point], half: float, rise: float) -> list[list[Point]]:
    """Return what an elliptical pen covers along a smooth line."""
    left, right = [], []
    for k, (x, z) in enumerate(line):
        (ax, az), (cx, cz) = line[max(k - 1, 0)], line[min(k + 1, len(line) - 1)]
        dx, dz = cx - ax, cz - az
        size = math.sqrt(dx * dx + dz * dz)
        u, v = -dz / size * half, dx / size * rise
        left.append((x + u, z + v))
        right.append((x - u, z - v))
    return [_unfolded(right[k], right[k + 1], left[k + 1], left[k]) for k in range(len(line) - 1)]


def _unfolded(a: Point, c: Point, d: Point, e: Point) -> list[Point]:
    """Return a piece of a ribbon; if it is folded inside of a tight bend, its shorter edge shrinks to a point."""
    if _turn(a, c, d) > 0.0 and _turn(a, d, e) > 0.0:
        return [a, c, d, e]
    right, left = (abs(p[0] - q[0]) + abs(p[1] - q[1]) for p, q in ((a, c), (e, d)))
    if right < left:
        a = c = ((a[0] + c[0]) / 2, (a[1] + c[1]) / 2)
    else:
        d = e = ((d[0] + e[0]) / 2, (d[1] + e[1]) / 2)
    return [a, c, d, e]


def _turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the area of a triangle, positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
