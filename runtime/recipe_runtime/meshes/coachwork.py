"""Car bodies: a shell lofted from cross-sections along its length, and the surface of each patch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from recipe_runtime.body.skeleton import axle_shift
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.cabin import Cabin
from recipe_runtime.meshes.curves import Curve, quarter, smooth, straight
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.shut_lines import Edges, ShutLines, marked

# The flank below the windows: heights as fractions from sill to belt, and half widths as fractions of the station's.
_FLANK = ((0.0, 0.925), (0.05, 0.962), (0.14, 0.982), (0.28, 0.990), (0.45, 0.993), (0.60, 0.996), (0.72, 1.0),
          (0.775, 0.999), (0.82, 0.988), (0.92, 0.973), (1.0, 0.950))  # fmt: skip
# Above the belt: half widths on the roof and, outside the cabin, on bonnet or boot; distance below the roof.
_TOP = ((1.05, 0.92, 9.0), (1.0, 0.84, 1.0), (0.95, 0.72, 0.36), (0.86, 0.62, 0.13), (0.66, 0.46, 0.04),
        (0.36, 0.24, 0.0), (0.0, 0.0, 0.0))  # fmt: skip
_LOW = len(_FLANK) - 1  # rows of patches below the belt; above it: moulding, window, rail, and four rows of the roof
_ARCH = 1.12  # radius of a wheel arch, in wheel radii
_FILL = 0.7  # largest distance between cross-sections of the coarse version, metres
_NOSE = 0.16  # length over which bumpers are rounded, metres


Point = tuple[float, float, float]
Opening = tuple[float, float, float]
"""Lower and upper edge, as fractions from sill to belt, and half width, as a share of the nose's."""


@dataclass(frozen=True)
class Front:
    """What gives a make its face: the openings of the nose and the inner edges of the lamps.

    Attributes:
        grille: Between the headlights; it has bars.
        intake: In the bumper.
        bars: Number of bars of the grille; the outer ones are bright.
        upright: Whether the bars are upright.
        lamp: Inner edge of the headlights, as a share of the nose's half width.
        tail: The same of the tail lamps.
        bumper: Upper edge of unpainted plastic, as a fraction from sill to belt.
    """

    grille: Opening = (0.55, 0.86, 0.5)
    intake: Opening = (0.1, 0.3, 0.6)
    bars: int = 4
    upright: bool = False
    lamp: float = 0.6
    tail: float = 0.6
    bumper: float = 0.14

    def is_open(self, height: float, aside: float) -> bool:
        """Return whether a place lies in the grille or the intake."""
        return any(low < height < high and aside < half for low, high, half in (self.grille, self.intake))


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
    nose: tuple[float, float] = (0.17, 0.07)  # how far the nose recedes at the flanks, and above the bumper, metres
    stern: tuple[float, float] = (0.10, 0.05)  # the same of the rear
    rows: int = 2  # of seats
    livery: bool = False  # whether the doors have a band in another colour
    rails: bool = False  # on the roof
    strip: bool = False  # whether a plastic strip protects the flanks
    fill: float = 0.2  # largest distance between cross-sections, metres
    front: Front = Front()


@dataclass(frozen=True)
class Sight:
    """From where the versions of a vehicle's parts are seen: see `Level`; metres."""

    near: float
    anchor: Point


@dataclass(frozen=True)
class Finish:
    """The surfaces of a vehicle."""

    paint: Surface
    glass: Surface
    trim: Surface
    rubber: Surface
    rim: Surface
    disc: Surface
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
            Surface("disc", Pattern.METAL, tag),
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

    def __init__(self, style: Style, shape: Mapping[str, float], coarse: bool = False) -> None:
        self.style, self.shape, self._coarse = style, shape, coarse
        self.length, self.half, self.height = shape["length"], shape["width"] / 2, shape["height"]
        shift = axle_shift(shape)
        self.axles = (shift - shape["wheelbase"] / 2, shift + shape["wheelbase"] / 2)
        self.arch = _ARCH * shape["wheel"]
        self._plastic = max(style.front.bumper, 0.28 if style.clad else 0.0)
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
        marks |= {style.start, 1.0, *style.screens, *style.windows, *style.door}
        keen = {self.x(u) for u in marks}
        for u, wide in ((p, 0.035) for p in style.pillars):
            keen |= {self.x(u) - wide, self.x(u) + wide}
        for axle in self.axles:
            if axle + self.arch > self.x(style.start):
                places = (0.34, 0.87, 1.0, 1.014) if self._coarse else (0.0, 0.34, 0.64, 0.87, 0.97, 1.0, 1.014)
                keen |= {axle + sign * self.arch * k for k in places for sign in (-1.0, 1.0)}
        for t in (0.0, 0.34, 1.0) if self._coarse else (0.0, 0.12, 0.34, 0.64, 1.0):
            keen |= {self.x(1.0) - _NOSE * t, self.x(style.start) + _NOSE * t}
        found: list[float] = []
        for x in sorted(round(x, 4) for x in keen):
            if self.x(style.start) <= x <= self.x(1.0) and (not found or x - found[-1] > 0.004):
                found.append(x)
        fill = [
            a + (b - a) * k / n
            for a, b in pairwise(found)
            for n in [int((b - a) / (_FILL if self._coarse else self.style.fill)) + 1]
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

    def bend(self, x: float, y: float, z: float) -> Point:
        """Return a point of the straight shell on the rounded one: nose and tail recede at the flanks and above."""
        ends = (1.0, self.style.nose, self.axles[1], self.x(1.0)), (-1.0, self.style.stern, self.axles[0], self.x(0.0))
        for sign, (sweep, lean), axle, end in ends:
            first = sign * axle + self.arch + 0.04
            t = min(1.0, (sign * x - first) / (sign * end - first))
            if t > 0.0 and (sign > 0 or self.style.start == 0.0):
                bumper, aside = 1.5 * self.shape["wheel"], abs(y) / self.half
                over = max(0.0, min(1.0, (z - bumper) / 0.3))
                under = max(0.0, min(1.0, (bumper - 0.2 - z) / 0.25))
                back = sweep * aside * aside + lean * over * over + 0.07 * under * under
                x -= sign * t * t * (3.0 - 2.0 * t) * back
        return x, y, z

    def end(self, sign: float, y: float, z: float) -> float:
        """Return x of the nose (sign 1) or of the tail (-1) at a place seen from ahead or behind, metres."""
        x = self.x(1.0) if sign > 0 else self.x(self.style.start)
        edge = straight([(pz, py) for py, pz in self.profile(x)], z)
        t = min(1.0, abs(y) / max(edge, 0.01))
        return self.bend(x + sign * 0.05 * (1.0 - t * t), y, z)[0]

    def cabin(self, driver: bool) -> Cabin:
        """Return what one sees through the windows."""
        u = self.style.roof[-1][0]
        seat, belt = self.x(u) - 1.35, self.belt(min(u - 0.25, 0.9))
        roof = max(self.roof(u - 0.25 * k / 8) for k in range(9)) - 0.06
        tall = {3: 0.46, 8: 0.55}.get(self.style.rows, 0.32)
        return Cabin(seat, 0.86 * self.half, min(roof - 0.18, belt + tall), belt, roof, self.style.rows, driver)

    def add(self, b: Builder, f: Finish, driver: bool) -> None:
        """Add the shell with its nose and its tail; `driver`: whether one sits behind the wheel."""
        rings = []
        for x in self.stations:
            half = self.profile(x)
            rings.append([self.bend(x, y, z) for y, z in half] + [self.bend(x, -y, z) for y, z in half[-2::-1]])
        skin = Builder()
        skin.grid(self._patches(f), np.array(rings), closed=False, crease=0.86)
        skin.grid(f.trim, np.array([[ring[0], ring[-1]] for ring in rings])[:, ::-1], closed=False)
        for sign, x in ((1.0, self.x(1.0)), (-1.0, self.x(self.style.start))):
            self._face(skin, f, sign, x)
        marked(b, skin.mesh(), ShutLines(self._edges()), self.cabin(driver).uv())

    def _edges(self) -> Edges:
        style, sill = self.style, self.shape["clearance"]
        lids, ends = (style.roof[0][0], style.roof[-1][0]), (style.start, 1.0)
        return Edges(
            half=self.half,
            arches=(self.axles[0] - self.arch, self.axles[1] + self.arch),
            doors=tuple(self.x(u) for u in style.seams),
            lids=(self.x(lids[0]), self.x(lids[1])),
            ends=(self.x(ends[0]), self.x(ends[1])),
            sill=sill + 0.12,
            split=sill + 0.5 * (self.belt(0.97) - sill),
        )

    def _patches(self, f: Finish) -> list[list[Surface | None]]:
        return [self._row(f, self.u((a + b) / 2)) for a, b in pairwise(self.stations)]

    def _row(self, f: Finish, u: float) -> list[Surface | None]:
        """Return the surfaces of the patches between two stations, from the left sill over the roof to the right."""
        style = self.style
        ends = (1.0 - u if u > 0.5 else u) * self.length
        cabin = style.roof[0][0] < u < style.roof[-1][0]
        arch = any(abs(self.x(u) - a) < self.arch for a in self.axles)
        flat = min(abs(self.x(u) - a) for a in self.axles) > 1.03 * self.arch and ends > 0.1
        pillar = any(abs(u - p) * self.length < 0.035 for p in style.pillars)
        lamp, band, deep = (f.headlight, style.lamps, 0.34) if u > 0.5 else (f.taillight, style.tail, 0.2)
        free = self.length / 2 - (self.axles[1] if u > 0.5 else -self.axles[0]) - self.arch
        deep = min(deep, free - 0.02)  # the sill rises at an arch, and all rows with it
        left: list[Surface | None] = []
        for (f0, _), (f1, _) in pairwise(_FLANK):
            middle = (f0 + f1) / 2
            if ends < deep and band[0] < middle < band[1]:
                left.append(lamp)
            elif f0 == 0.0 and (style.clad or not arch):
                left.append(f.trim)
            else:
                livery = style.livery and 0.28 < middle < 0.77 and style.seams[0] < u < style.seams[-1]
                body = Surface("livery", Pattern.CAR_PAINT, f.paint.tag) if livery else f.paint
                strip = style.strip and 0.28 < middle < 0.45 and flat
                left.append(f.trim if strip or (style.clad and f1 < 0.3) else body)
        window = cabin and style.windows[0] < u < style.windows[1]
        side = f.trim if pillar else f.glass
        screen = cabin and not style.screens[0] < u < style.screens[1]
        left += [f.trim if window else f.paint, side if window else f.paint, f.paint]
        left += [f.glass if screen else f.paint] * 4
        if u < style.bed:
            left[_LOW + 1 :] = [None] * (len(left) - _LOW - 1)
        right = list(left)
        for u0, u1 in zip(style.door[::2], style.door[1::2], strict=True):
            if u0 < u < u1:
                right[1:_LOW] = [f.trim if pillar else f.glass] * (_LOW - 1)
        return [*left, *right[::-1]]

    def _face(self, b: Builder, f: Finish, sign: float, x: float) -> None:
        """Add the nose or the tail: a shallow bulge over the last cross-section, with lamps, grille and bumper."""
        half = self.profile(x)
        across = (-1.0, -0.93, -0.86, -0.78, -0.70, -0.61, -0.52, -0.26, 0.26, 0.52, 0.61, 0.70, 0.78, 0.86, 0.93, 1.0)
        rows = []
        for y, z in half:
            rows.append([self.bend(x + sign * 0.05 * (1.0 - t * t), t * y, z) for t in across])
        cells: list[list[Surface | None]] = []
        for n in range(len(half) - 1):
            places = [(t0 + t1) / 2 for t0, t1 in pairwise(across)]
            if self.style.start > 0.0 and sign < 0:
                cells.append([f.paint for _ in places])
            else:
                cells.append([(self._front if sign > 0 else self._back)(f, n, t) for t in places])
        grid = np.array(rows) if sign > 0 else np.array(rows)[:, ::-1]
        b.grid(cells if sign > 0 else [row[::-1] for row in cells], grid, closed=False, crease=0.86)

    def _front(self, f: Finish, row: int, t: float) -> Surface:
        """Return the surface of a patch of the nose, by its row and position from the right flank (-1) to the left."""
        aside = abs(t)
        if row >= _LOW:
            return f.paint if row < _LOW + 2 or self.roof(0.995) <= self.belt(0.995) + 0.2 else f.glass
        middle = (_FLANK[row][0] + _FLANK[row + 1][0]) / 2
        low, high = self.style.lamps
        front = self.style.front
        if low < middle < high and aside > front.lamp:
            return f.indicators[int(t < 0)] if aside > 0.9 and middle < (low + high) / 2 else f.headlight
        return f.trim if middle < self._plastic or front.is_open(middle, aside) else f.paint

    def _back(self, f: Finish, row: int, t: float) -> Surface | None:
        aside = abs(t)
        if row >= _LOW:
            return None if self.style.bed and row > _LOW else f.paint
        middle = (_FLANK[row][0] + _FLANK[row + 1][0]) / 2
        low, high = self.style.tail
        inner = self.style.front.tail
        outer = aside > (1.0 + inner) / 2
        if low < middle < high and aside > inner:
            if middle < low + 0.4 * (high - low):
                return f.indicators[int(t < 0)] if outer else f.reverselight
            return f.taillight if outer else f.brakelight
        return f.trim if middle < self._plastic else f.paint

    def side(self, x: float, z: float) -> float:
        """Return y of the left side at a height, metres; below the sill, that of the sill."""
        return straight([(pz, py) for py, pz in self.profile(x)[: _LOW + 1]], z)

    def top(self, x: float, y: float) -> float:
        """Return the height of the shell above a place, metres."""
        rows = self.profile(x)[_LOW:]
        return straight([(py, pz) for py, pz in rows[::-1]], abs(y))

    def flank(self, u: float, share: float) -> tuple[float, float]:
        """Return a point (y, z) of the left flank at a fraction of the height between sill and belt."""
        rows = self.profile(self.x(u))[: _LOW + 1]
        z = rows[0][1] + share * (rows[-1][1] - rows[0][1])
        return straight([(r[1], r[0]) for r in rows], z), z
