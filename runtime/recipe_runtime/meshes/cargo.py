"""What a truck carries: a box, a tank or an open body, on a frame with lamps, guards and mud flaps."""

from __future__ import annotations

import math

import numpy as np

from recipe_runtime.meshes.builder import Builder, circle
from recipe_runtime.meshes.coachwork import Finish, Shell
from recipe_runtime.meshes.lettering import WORDS, bits
from recipe_runtime.meshes.lofts import tube
from recipe_runtime.meshes.mesh import Pattern, Surface


def cargo(b: Builder, f: Finish, shell: Shell) -> None:
    """Add a truck's frame and its load."""
    ends, w, h = (-shell.length / 2, shell.x(0.715)), shell.half, shell.height
    low = 0.30 * h
    load = Surface("cargo", Pattern.CAR_PAINT, f.paint.tag)
    if shell.shape["style"] == 1:
        _tank(b, f, load, (ends[0] + 0.12, ends[1]), (low + 0.04, h - 0.2), 0.94 * w)
    elif shell.shape["style"] == 2:
        _tipper(b, f, load, (ends[0] + 0.05, ends[1]), (low + 0.1, h), w - 0.06)
    else:
        _box_body(b, f, load, ends, w, (low, h))
    _frame(b, f, shell, ends, low)


def _frame(b: Builder, f: Finish, shell: Shell, ends: tuple[float, float], low: float) -> None:
    """Add the frame under the load, its lamps, side guards and the mud flaps behind the rear wheels."""
    (x0, x1), w = ends, shell.half
    rear, wheel = shell.axles[0], shell.shape["wheel"]
    b.box(f.trim, (x0 + 0.02, -0.9 * w, low - 0.12), (x1 + 0.4, 0.9 * w, low))
    b.box(f.trim, (x0 + 0.02, -0.5 * w, 0.5), (x1, 0.5 * w, low - 0.1))
    b.box(f.rim, (x0 - 0.01, 0.05 - w, 0.44), (x0 + 0.1, w - 0.05, 0.56))
    for s in (1.0, -1.0):
        lamps = (f.reverselight, f.indicators[int(s < 0)], f.brakelight, f.taillight)
        for lamp, inner, outer in zip(lamps, (0.54, 0.64, 0.74, 0.84), (0.64, 0.74, 0.84, 0.96), strict=True):
            y0, y1 = sorted((s * inner * w, s * outer * w))
            b.box(lamp, (x0 - 0.015, y0, low - 0.2), (x0 + 0.05, y1, low - 0.04))
        y0, y1 = sorted((s * (w - 0.05), s * (w - 0.09)))
        for z in (0.46, 0.5 * (0.46 + low - 0.14)):
            b.box(f.rim, (rear + 1.5 * wheel, y0, z), (x1 - 0.2, y1, z + 0.1))
        y0, y1 = sorted((s * (w - 0.04), s * (w - 0.42)))
        b.box(f.rubber, (rear - 1.35 * wheel, y0, 0.2), (rear - 1.32 * wheel, y1, low - 0.1))
        wing = [(rear + 1.25 * wheel * c, wheel + 1.2 * wheel * sn) for c, sn in circle(16)[:9]]
        rows = [[(x, y, min(z, low - 0.02)) for y in (y1, y0)] for x, z in wing]
        b.grid(f.trim, rows, closed=False, crease=0.5)


def _box_body(
    b: Builder, f: Finish, load: Surface, ends: tuple[float, float], w: float, heights: tuple[float, float]
) -> None:
    """Add a closed box: bright edges, a name on its sides, and doors with rods and hinges at the rear."""
    (x0, x1), (low, h) = ends, heights
    edge = 0.04
    ring = [(w - edge, low), (w, low + edge), (w, h - edge), (w - edge, h), (edge - w, h), (-w, h - edge),
            (-w, low + edge), (edge - w, low)]  # fmt: skip
    b.grid(load, [[(x, y, z) for y, z in ring] for x in (x0, x1)], crease=0.8, caps=(load, load))
    for x in (x0 - 0.012, x1 - 0.05):
        for s in (1.0, -1.0):
            y0, y1 = sorted((s * (w - 0.07), s * (w + 0.008)))
            b.box(f.rim, (x, y0, low), (x + 0.07, y1, h + 0.006))
        b.box(f.rim, (x, -w, h - 0.06), (x + 0.07, w, h + 0.008))
    for s in (1.0, -1.0):
        y0, y1 = sorted((s * (w - 0.02), s * (w + 0.012)))
        b.box(f.rim, (x0, y0, low - 0.01), (x1, y1, low + 0.11))
        b.box(f.rim, (x0, y0, h - 0.08), (x1, y1, h + 0.008))
        _name(b, f, (x0, x1), s * (w + 0.004), (low, h))
    _doors(b, f, x0 - 0.004, w, (low, h))


def _doors(b: Builder, f: Finish, x: float, w: float, heights: tuple[float, float]) -> None:
    """Add the seal between two doors, their locking rods, handles and hinges."""
    low, h = heights
    b.box(f.trim, (x - 0.006, -0.014, low + 0.04), (x, 0.014, h - 0.06))
    b.box(f.trim, (x - 0.006, -w, low), (x, w, low + 0.03))
    for s in (1.0, -1.0):
        for y in (0.2 * w, 0.62 * w):
            tube(b, f.rim, [(x - 0.03, s * y, low + 0.05), (x - 0.03, s * y, h - 0.08)], 0.017, 6)
        y0, y1 = sorted((s * 0.2 * w, s * 0.5 * w))
        b.box(f.trim, (x - 0.055, y0, low + 0.42), (x - 0.03, y1, low + 0.47))
        for k in range(4):
            z = low + 0.14 + (h - low - 0.4) * k / 3
            y0, y1 = sorted((s * 0.86 * w, s * (w - 0.005)))
            b.box(f.trim, (x - 0.018, y0, z), (x, y1, z + 0.07))


def _name(b: Builder, f: Finish, ends: tuple[float, float], y: float, heights: tuple[float, float]) -> None:
    """Add a band with a word in light letters to a side of a box."""
    (x0, x1), (low, h) = ends, heights
    text = WORDS[int(100.0 * (x1 - x0)) % len(WORDS)]
    side = 1.0 if y > 0 else -1.0
    tall = 0.2 * (h - low)
    z, step = low + 0.5 * (h - low), 0.8 * tall
    out = ((0.004, 0.004), (0.996, 0.004), (0.996, 0.996), (0.004, 0.996))
    band = Surface("livery", Pattern.CAR_PAINT, f.paint.tag)
    for a, c in ((z - 0.25 * tall, z + 1.25 * tall), (low + 0.16, low + 0.24)):
        strip = [(x0 + 0.06, y, a), (x1 - 0.06, y, a), (x1 - 0.06, y, c), (x0 + 0.06, y, c)]
        b.quads(band, [[strip[k] for k in (1, 0, 3, 2)] if side > 0 else strip])
    quads, places = [], []
    for n, letter in enumerate(text):
        x = (x0 + x1) / 2 + side * (len(text) / 2 - n) * step
        last, at = x - side * 0.68 * tall, y + 0.003 * side
        high, down = bits(letter)
        quads.append([(x, at, z), (last, at, z), (last, at, z + tall), (x, at, z + tall)])
        places.append([(high + i, down + j) for i, j in out])
    b.quads(Surface("livery", Pattern.LETTER, f.paint.tag), quads, np.array(places))


def _tank(
    b: Builder, f: Finish, load: Surface, ends: tuple[float, float], heights: tuple[float, float], half: float
) -> None:
    """Add an oval tank with flat domed ends, bands, a walkway, a ladder and a band of colour."""
    (x0, x1), (low, high) = ends, heights
    z, tall = (low + high) / 2, (high - low) / 2
    ring = circle(28)
    dome = [(0.0, 0.7), (0.02, 0.86), (0.06, 0.96), (0.12, 1.0)]
    profile = [(x0 + d, k) for d, k in dome] + [(x1 - d, k) for d, k in dome[::-1]]
    b.grid(load, [[(x, half * k * c, z + tall * k * s) for c, s in ring] for x, k in profile], crease=0.7,
           caps=(load, load))  # fmt: skip
    for n in range(5):
        x = x0 + 0.16 + (x1 - x0 - 0.32) * n / 4
        band = [[(x + d, 1.014 * half * c, z + 1.014 * tall * s) for c, s in ring] for d in (-0.03, 0.03)]
        b.grid(f.rim, band, crease=0.7)
    mark = Surface("livery", Pattern.CAR_PAINT, f.paint.tag)
    for s in (1.0, -1.0):
        arc = [(s * 1.006 * half * c, z + 1.006 * tall * sn) for c, sn in circle(28, -12.857)[:3]]
        rows = [[(x, y, up) for y, up in arc] for x in (x0 + 0.14, x1 - 0.14)]
        b.grid(mark, rows if s > 0 else rows[::-1], closed=False, crease=0.3)
        b.box(f.trim, (x0 - 0.06, s * 0.3 - 0.02, low), (x0 - 0.02, s * 0.3 + 0.02, high))
        tube(b, f.rim, [(x0 + 0.4, s * 0.3, z + tall + 0.2), (x1 - 0.4, s * 0.3, z + tall + 0.2)], 0.018, 6)
        y0, y1 = sorted((s * 0.8 * half, s * 0.98 * half))
        b.box(f.trim, (x0 + 0.1, y0, low - 0.02), (x1, y1, low + 0.3 * tall))
    for n in range(5):
        step = low + 0.2 + (high - low - 0.3) * n / 4
        b.box(f.trim, (x0 - 0.06, -0.3, step), (x0 - 0.03, 0.3, step + 0.03))
    b.box(f.trim, (x0 + 0.3, -0.3, z + tall - 0.02), (x1 - 0.3, 0.3, z + tall + 0.03))
    for n in range(3):
        x = x0 + (x1 - x0) * (n + 1) / 4
        b.box(f.rim, (x - 0.2, -0.2, z + tall), (x + 0.2, 0.2, z + tall + 0.12))


def _tipper(
    b: Builder, f: Finish, load: Surface, ends: tuple[float, float], heights: tuple[float, float], half: float
) -> None:
    """Add an open body with ribs on its sides and its tailgate, and a wall up to the roof behind the cab."""
    (x0, x1), (low, roof) = ends, heights
    high = low + 0.6 * (roof - low)
    b.box(load, (x0, -half, low), (x1, half, low + 0.12))
    thick = 0.05
    for y0, y1 in ((-half, thick - half), (half - thick, half)):
        b.box(load, (x0, y0, low + 0.12), (x1, y1, high))
    for a, c, top in ((x0, x0 + thick, high), (x1 - thick, x1, roof)):
        b.box(load, (a, -half, low + 0.12), (c, half, top))
    count = math.floor((x1 - x0) / 0.6)
    for n in range(count + 1):
        x = x0 + (x1 - x0) * n / count
        for s in (1.0, -1.0):
            y0, y1 = sorted((s * half, s * (half + 0.05)))
            b.box(load, (x - 0.04, y0, low), (x + 0.04, y1, high))
    for n in range(4):
        y = half * (n / 1.5 - 1.0) * 0.96
        b.box(load, (x0 - 0.05, y - 0.04, low), (x0, y + 0.04, high))
    for s in (1.0, -1.0):
        y0, y1 = sorted((s * (half - 0.02), s * (half + 0.055)))
        b.box(f.trim, (x0 - 0.05, y0, high - 0.02), (x1, y1, high + 0.05))
    b.box(f.trim, (x0 - 0.055, -half, high - 0.02), (x0 + 0.03, half, high + 0.05))
    b.box(f.trim, (x0 - 0.055, -half, low - 0.02), (x0, half, low + 0.07))
    b.box(f.trim, (x0 + thick, thick - half, high - 0.25), (x1 - thick, half - thick, high - 0.2))
