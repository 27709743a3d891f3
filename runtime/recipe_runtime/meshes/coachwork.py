"""Car bodies: a shell lofted from cross-sections along its length, and the surface of each patch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from recipe_runtime.body.skeleton import axle_shift
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.curves import Curve, quarter, smooth, straight
from recipe_runtime.meshes.mesh import Pattern, Surface

# The flank below the windows: heights as fractions from sill to belt, and half widths as fractions of the station's.
_FLANK = ((0.0, 0.935), (0.09, 0.978), (0.26, 0.994), (0.44, 1.0), (0.60, 0.999), (0.74, 0.996), (0.88, 0.982),
          (1.0, 0.950))  # fmt: skip
# Above the belt: half widths on the roof and, outside the cabin, on bonnet or boot; distance below the roof.
_TOP = ((1.05, 0.92, 9.0), (1.0, 0.84, 1.0), (0.94, 0.70, 0.3), (0.72, 0.5, 0.06), (0.38, 0.26, 0.0), (0.0, 0.0, 0.0))
_LOW = len(_FLANK) - 1  # rows of patches below the belt; above it: moulding, window, rail, and three rows of the roof
_ARCH = 1.12  # radius of a wheel arch, in wheel radii
_NOSE = 0.16  # length over which bumpers are rounded, metres


@dataclass(frozen=True)
class Style:
    """The outlines of a car body: u runs from 0 at the rear to 1 at the nose, heights are fractions of the total."""

    belt: Curve  # height of the lower edge of the windows, and of bonnet and boot
    roof: Curve  # height of the cabin, from the foot of the rear screen to the foot of the windscreen
    plan: Curve  # half width, as a fraction of the vehicle's
    screens: tuple[float, float]  # u of the front edge of the rear screen and of the rear edge of the windscreen
    windows: tuple[float, float]  # u where the side windows start and end
    pillars: tuple[float, ...] = ()
    seams: tuple[float, ...] = ()  # u of the edges of doors
    start: float = 0.0  # u where the shell begins
    roof_width: float = 0.74
    rail: float = 0.07  # distance from the top of the side windows to the roof, metres
    clad: bool = False  # whether arches and sills are unpainted plastic
    lamps: tuple[float, float] = (0.55, 0.9)  # heights of headlights and tail lights, as fractions from sill to belt
    tail: tuple[float, float] = (0.55, 0.92)
    door: tuple[float, ...] = ()  # u of the doors on the right side of a bus
    bed: float = 0.0  # u of the front end of a pickup's open bed; 0 if there is none
    fill: float = 0.36  # largest distance between cross-sections, metres


@dataclass(frozen=True)
class Finish:
    """The surfaces of a vehicle."""

    paint: Surface
    glass: Surface
    trim: Surface
    rubber: Surface
    rim: Surface
    headlight: Surface
    taillight: Surface
    brakelight: Surface
    indicators: tuple[Surface, Surface]  # left, right
    reverselight: Surface
    plate: Surface
    number: Surface
    mirror: Surface

    @classmethod
    def of(cls, tag: int, lit: bool = True) -> Finish:
        """Return the surfaces with a semantic tag; lamps stay dark at night unless `lit`."""
        names = (Pattern.HEADLIGHT, Pattern.TAILLIGHT, Pattern.BRAKELIGHT, Pattern.INDICATOR, Pattern.REVERSELIGHT)
        ahead, behind, brake, turn, back = names if lit else (Pattern.LENS,) * 5
        return cls(
            Surface("paint", Pattern.CAR_PAINT, tag),
            Surface("glass", Pattern.CABIN, tag),
            Surface("trim", Pattern.PLAIN, tag),
            Surface("rubber", Pattern.RUBBER, tag),
            Surface("rim", Pattern.METAL, tag),
            Surface("headlight", ahead, tag),
            Surface("taillight", behind, tag),
            Surface("brakelight", brake, tag),
            (Surface("indicator_left", turn, tag), Surface("indicator_right", turn, tag)),
            Surface("reverselight", back, tag),
            Surface("plate", Pattern.PLAIN, tag),
            Surface("plate", Pattern.NUMBER_PLATE, tag),
            Surface("glass", Pattern.GLASS, tag),
        )


class Shell:
    """The shell of a vehicle: the geometry of its surface, and its patches."""

    def __init__(self, style: Style, shape: Mapping[str, float]) -> None:
        self.style, self.shape = style, shape
        self.length, self.half, self.height = shape["length"], shape["width"] / 2, shape["height"]
        shift = axle_shift(shape)
        self.axles = (shift - shape["wheelbase"] / 2, shift + shape["wheelbase"] / 2)
        self.arch = _ARCH * shape["wheel"]
        self.stations = self._stations()

    def x(self, u: float) -> float:
        """Convert u to metres ahead of the middle of the vehicle."""
        return (u - 0.5) * self.length

    def u(self, x: float) -> float:
        """Convert metres ahead of the middle of the vehicle to u: the inverse of `x`."""
        return x / self.length + 0.5

    def belt(self, u: float) -> float:
        """Height of the belt line at u, metres."""
        return self.height * smooth(self.style.belt, u)

    def width(self, u: float) -> float:
        """Largest half width at u, metres."""
        return self.half * smooth(self.style.plan, u)

    def _stations(self) -> list[float]:
        style = self.style
        marks = {u for curve in (style.belt, style.roof, style.plan) for u, _ in curve if u >= style.start}
        marks |= {style.start, 1.0, *style.screens, *style.windows}
        keen = {self.x(u) for u in marks}
        for u, wide in (*((p, 0.035) for p in style.pillars), *((s, 0.006) for s in style.seams)):
            keen |= {self.x(u) - wide, self.x(u) + wide}
        for axle in self.axles:
            if axle + self.arch > self.x(style.start):
                keen |= {
                    axle + self.arch * k for k in (-1.0, -0.97, -0.87, -0.64, -0.34, 0.0, 0.34, 0.64, 0.87, 0.97, 1.0)
                }
        for t in (0.0, 0.12, 0.34, 0.64, 1.0):
            keen |= {self.x(1.0) - _NOSE * t, self.x(style.start) + _NOSE * t}
        found: list[float] = []
        for x in sorted(round(x, 4) for x in keen):
            if self.x(style.start) <= x <= self.x(1.0) and (not found or x - found[-1] > 0.004):
                found.append(x)
        fill = [
            a + (b - a) * k / n
            for a, b in pairwise(found)
            for n in [int((b - a) / self.style.fill) + 1]
            for k in range(n)
        ]
        return [*fill, found[-1]]

    def sill(self, x: float) -> float:
        """Height of the shell's lower edge, which is higher around the wheels and at both ends, metres."""
        ends = min(x - self.x(self.style.start), self.x(1.0) - x)
        low = self.shape["clearance"] + 0.05 * max(0.0, 1.0 - ends / 0.6) + 0.06 * (1.0 - quarter(ends / _NOSE))
        for axle in self.axles:
            if abs(x - axle) < self.arch:
                low = max(low, self.shape["wheel"] + math.sqrt(self.arch * self.arch - (x - axle) * (x - axle)))
        return min(low, self.belt(self.u(x)) - 0.08)

    def roof(self, u: float) -> float:
        """Height of the cabin's outline at u, metres; outside the cabin, that of the belt line."""
        (first, _), (last, _) = self.style.roof[0], self.style.roof[-1]
        if not first < u < last:
            return self.belt(u)
        inner = ((first, smooth(self.style.belt, first)), *self.style.roof[1:-1], (last, smooth(self.style.belt, last)))
        return max(self.belt(u), self.height * smooth(inner, u))

    def profile(self, x: float) -> list[tuple[float, float]]:
        """Return the left half of a cross-section as (y, z), from the sill over the flank to the middle of the roof."""
        u, style = self.u(x), self.style
        ends = quarter(min(x - self.x(style.start), self.x(1.0) - x) / _NOSE)
        w = self.width(u) * (0.945 + 0.055 * ends)
        belt, roof, low = self.belt(u), self.roof(u), self.sill(x)
        cabin = min(1.0, (roof - belt) / 0.32)
        drop = 0.055 * (1.0 - ends)
        flare = max((1.0 - (x - a) * (x - a) / (1.7 * self.arch * self.arch) for a in self.axles), default=0.0)
        rows = []
        for f, k in _FLANK:
            bulge = 1.0 + 0.016 * max(0.0, flare) * (1.0 - f) * (2.0 if style.clad else 1.0)
            rows.append((w * k * bulge, low + f * (belt - drop - low)))
        top, crown = min(style.roof_width * self.half, 0.93 * w), 0.06 * self.half
        for over, lid, below in _TOP:
            y = w * lid + (top * over - w * lid) * cabin
            bow = crown * (1.0 - (y / w) * (y / w))
            rows.append((y, max(belt + 0.010 + bow, roof - below * style.rail * cabin + 0.4 * bow) - drop))
        rows[_LOW + 1] = (w * (0.938 - 0.02 * (1.0 - cabin)), belt - drop + 0.012 + 0.008 * cabin)
        return rows

    def add(self, b: Builder, f: Finish) -> None:
        """Add the shell with its nose and its tail."""
        rings = []
        for x in self.stations:
            half = self.profile(x)
            rings.append([(x, y, z) for y, z in half] + [(x, -y, z) for y, z in half[-2::-1]])
        b.grid(self._patches(f), np.array(rings), closed=False, crease=0.9)
        b.grid(f.trim, np.array([[ring[0], ring[-1]] for ring in rings])[:, ::-1], closed=False)
        for sign, x in ((1.0, self.x(1.0)), (-1.0, self.x(self.style.start))):
            self._face(b, f, sign, x)

    def _patches(self, f: Finish) -> list[list[Surface | None]]:
        return [self._row(f, self.u((a + b) / 2), b - a) for a, b in pairwise(self.stations)]

    def _row(self, f: Finish, u: float, wide: float) -> list[Surface | None]:
        """Return the surfaces of the patches between two stations, from the left sill over the roof to the right."""
        style = self.style
        ends = (1.0 - u if u > 0.5 else u) * self.length
        cabin = style.roof[0][0] < u < style.roof[-1][0]
        arch = any(abs(self.x(u) - a) < self.arch for a in self.axles)
        seam = wide < 0.0121 and any(abs(u - s) * self.length < 0.006 for s in style.seams)
        pillar = any(abs(u - p) * self.length < 0.035 for p in style.pillars)
        lamp, band, deep = (f.headlight, style.lamps, 0.34) if u > 0.5 else (f.taillight, style.tail, 0.2)
        free = self.length / 2 - (self.axles[1] if u > 0.5 else -self.axles[0]) - self.arch
        deep = min(deep, free - 0.02)  # the sill rises at an arch, and all rows with it
        left: list[Surface | None] = []
        for (f0, _), (f1, _) in pairwise(_FLANK):
            middle = (f0 + f1) / 2
            if seam and f0 > 0.0:
                left.append(f.trim)
            elif ends < deep and band[0] < middle < band[1]:
                left.append(lamp)
            elif f0 == 0.0 and (style.clad or not arch):
                left.append(f.trim)
            else:
                left.append(f.trim if style.clad and (f1 < 0.3) else f.paint)
        window = cabin and style.windows[0] < u < style.windows[1]
        side = f.trim if pillar else f.glass
        screen = cabin and not style.screens[0] < u < style.screens[1]
        left += [f.trim if window else f.paint, side if window else f.paint, f.paint]
        left += [f.glass if screen else f.paint] * 3
        if u < style.bed:
            left[_LOW + 1 :] = [None] * (len(left) - _LOW - 1)
        right = list(left)
        for u0, u1 in pairwise(style.door):
            if u0 < u < u1:
                right[1:_LOW] = [f.trim if pillar or seam else f.glass] * (_LOW - 1)
        return [*left, *right[::-1]]

    def _face(self, b: Builder, f: Finish, sign: float, x: float) -> None:
        """Add the nose or the tail: a shallow bulge over the last cross-section, with lamps, grille and bumper."""
        half = self.profile(x)
        across = (-1.0, -0.86, -0.70, -0.52, -0.26, 0.26, 0.52, 0.70, 0.86, 1.0)
        rows = []
        for y, z in half:
            rows.append([(x + sign * 0.05 * (1.0 - t * t), t * y, z) for t in across])
        cells: list[list[Surface | None]] = []
        for n in range(len(half) - 1):
            places = [abs(t0 + t1) / 2 for t0, t1 in pairwise(across)]
            if self.style.start > 0.0 and sign < 0:
                cells.append([f.paint for _ in places])
            else:
                cells.append([(self._front if sign > 0 else self._back)(f, n, t) for t in places])
        grid = np.array(rows) if sign > 0 else np.array(rows)[:, ::-1]
        b.grid(cells, grid, closed=False, crease=0.9)

    def _front(self, f: Finish, row: int, t: float) -> Surface:
        """Return the surface of a patch of the nose, by its row and position from the middle (0) to the flank (1)."""
        if row >= _LOW:
            return f.paint if row < _LOW + 2 or self.roof(0.995) <= self.belt(0.995) + 0.2 else f.glass
        middle = (_FLANK[row][0] + _FLANK[row + 1][0]) / 2
        low, high = self.style.lamps
        if low < middle < high and t > 0.6:
            return f.headlight
        if low - 0.02 < middle < high and t < 0.6:
            return f.trim
        return f.trim if row == 0 or (row == 1 and t < 0.75) else f.paint

    def _back(self, f: Finish, row: int, t: float) -> Surface | None:
        if row >= _LOW:
            return None if self.style.bed and row > _LOW else f.paint
        middle = (_FLANK[row][0] + _FLANK[row + 1][0]) / 2
        low, high = self.style.tail
        if low < middle < high and t > 0.6:
            return f.taillight
        return f.trim if row == 0 or (row == 1 and self.style.clad) else f.paint

    def flank(self, u: float, share: float) -> tuple[float, float]:
        """Return a point (y, z) of the left flank at a fraction of the height between sill and belt."""
        rows = self.profile(self.x(u))[: _LOW + 1]
        z = rows[0][1] + share * (rows[-1][1] - rows[0][1])
        return straight([(r[1], r[0]) for r in rows], z), z
