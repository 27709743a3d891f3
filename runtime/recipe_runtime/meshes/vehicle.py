"""Vehicles: a body lofted from cross-sections along its length, with wheel arches, glass and lamps; four wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from recipe_compiler.plan import ActorPlan

from recipe_runtime.meshes.builder import Array, Builder, circle
from recipe_runtime.meshes.mesh import Light, Mesh, Pattern, Surface
from recipe_runtime.meshes.skeleton import axle_shift, wheel_joints

Curve = Sequence[tuple[float, float]]  # (place along the vehicle, 0 at its rear and 1 at its nose; value)


@dataclass(frozen=True)
class _Style:
    """Outlines of a kind of body; heights in parts of the vehicle's, half widths in parts of its half width."""

    belt: Curve  # where the windows begin, and the top of bonnet and boot
    roof: Curve  # the cabin; elsewhere the belt is the top
    plan: Curve  # half width
    pillars: tuple[float, ...]
    roof_width: float = 0.74
    rail: float = 0.065  # from the top of the side windows to the roof


_CAR_PLAN = (
    (0.0, 0.76),
    (0.012, 0.86),
    (0.05, 0.95),
    (0.18, 0.99),
    (0.5, 1.0),
    (0.84, 0.985),
    (0.94, 0.92),
    (0.985, 0.80),
    (1.0, 0.70),
)
_BOX_PLAN = ((0.0, 0.94), (0.008, 0.99), (0.03, 1.0), (0.96, 1.0), (0.985, 0.97), (1.0, 0.88))
_STYLES = {
    0: _Style(
        ((0, 0.46), (0.012, 0.58), (0.03, 0.635), (0.14, 0.665), (0.45, 0.645), (0.735, 0.62),
         (0.9, 0.555), (0.965, 0.49), (1, 0.40)),
        ((0.125, 0), (0.20, 0.80), (0.28, 0.925), (0.36, 0.985), (0.46, 1.0), (0.55, 0.98),
         (0.60, 0.945), (0.66, 0.84), (0.755, 0)),
        _CAR_PLAN,
        (0.29, 0.475),
    ),
    1: _Style(
        ((0, 0.44), (0.012, 0.57), (0.03, 0.62), (0.45, 0.61), (0.76, 0.585), (0.92, 0.52), (0.97, 0.46), (1, 0.37)),
        ((0.012, 0), (0.05, 0.78), (0.10, 0.92), (0.18, 0.975), (0.38, 1.0), (0.52, 0.985),
         (0.59, 0.945), (0.67, 0.82), (0.775, 0)),
        _CAR_PLAN,
        (0.20, 0.43),
    ),
    2: _Style(
        ((0, 0.46), (0.012, 0.58), (0.03, 0.625), (0.45, 0.62), (0.73, 0.61), (0.92, 0.565), (0.97, 0.51), (1, 0.42)),
        ((0.012, 0), (0.04, 0.80), (0.08, 0.94), (0.15, 0.985), (0.38, 1.0), (0.52, 0.985),
         (0.585, 0.95), (0.65, 0.84), (0.745, 0)),
        _CAR_PLAN,
        (0.20, 0.435),
        0.76,
    ),
    3: _Style(
        ((0, 0.44), (0.008, 0.50), (0.02, 0.53), (0.80, 0.53), (0.92, 0.50), (0.97, 0.43), (1, 0.34)),
        ((0.006, 0), (0.02, 0.82), (0.035, 0.95), (0.07, 0.99), (0.4, 1.0), (0.70, 0.985),
         (0.76, 0.95), (0.82, 0.83), (0.905, 0)),
        _CAR_PLAN,
        (0.10, 0.40, 0.60),
        0.84,
    ),
    4: _Style(
        ((0, 0.50), (0.006, 0.57), (0.02, 0.585), (0.37, 0.585), (0.39, 0.60), (0.73, 0.60),
         (0.93, 0.56), (0.975, 0.50), (1, 0.42)),
        ((0.385, 0), (0.395, 0.80), (0.41, 0.95), (0.45, 0.99), (0.52, 1.0), (0.585, 0.98),
         (0.62, 0.945), (0.67, 0.84), (0.745, 0)),
        _CAR_PLAN,
        (0.525,),
        0.76,
    ),
    5: _Style(
        ((0, 0.36), (0.004, 0.38), (0.02, 0.385), (0.97, 0.385), (1, 0.36)),
        ((0.003, 0), (0.005, 0.85), (0.01, 0.97), (0.03, 1.0), (0.955, 1.0), (0.975, 0.965),
         (0.985, 0.86), (0.998, 0)),
        _BOX_PLAN,
        (0.13, 0.25, 0.37, 0.49, 0.61, 0.73, 0.82, 0.90),
        0.93,
        0.11,
    ),
    6: _Style(
        ((0, 0.27), (0.715, 0.27), (0.725, 0.43), (0.74, 0.45), (0.95, 0.45), (0.985, 0.40), (1, 0.33)),
        ((0.73, 0), (0.74, 0.64), (0.755, 0.70), (0.80, 0.72), (0.90, 0.71), (0.925, 0.68), (0.95, 0.60), (0.985, 0)),
        _BOX_PLAN,
        (0.79,),
        0.88,
        0.05,
    ),
}  # fmt: skip
_PICKUP, _BUS, _TRUCK = 4, 5, 6


def _value(curve: Curve, u: float) -> float:
    for (u0, v0), (u1, v1) in pairwise(curve):
        if u <= u1:
            return v0 + (v1 - v0) * max(0.0, u - u0) / (u1 - u0)
    return curve[-1][1]


@dataclass(frozen=True)
class _Finish:
    """The surfaces of one vehicle."""

    paint: Surface
    glass: Surface
    trim: Surface
    rubber: Surface
    rim: Surface
    headlight: Surface
    taillight: Surface
    plate: Surface

    @classmethod
    def of(cls, tag: int) -> _Finish:
        return cls(
            Surface("paint", Pattern.CAR_PAINT, tag),
            Surface("glass", Pattern.GLASS, tag),
            Surface("trim", Pattern.PLAIN, tag),
            Surface("rubber", Pattern.RUBBER, tag),
            Surface("rim", Pattern.METAL, tag),
            Surface("headlight", Pattern.HEADLIGHT, tag),
            Surface("taillight", Pattern.TAILLIGHT, tag),
            Surface("plate", Pattern.PLAIN, tag),
        )


def vehicle_parts(actor: ActorPlan) -> tuple[tuple[str, Mesh], ...]:
    """The base `chassis`, its origin on the ground below the vehicle's middle, then the wheels about their hubs."""
    finish, shape = _Finish.of(actor.tag), actor.shape
    wheel = _wheel(finish, shape["wheel"], 0.30 if shape["width"] > 2.1 else 0.215)
    parts = [("chassis", _chassis(finish, shape))]
    parts += [(joint.part, wheel) for joint in wheel_joints(shape)]
    return tuple(parts)


def _chassis(finish: _Finish, shape: Mapping[str, float]) -> Mesh:
    b = Builder()
    style = _STYLES[int(shape["body"])]
    stations = _stations(style, shape)
    b.grid(_cells(finish, style, shape, stations), _sections(style, shape, stations), crease=0.72,
           caps=(finish.paint, finish.paint))  # fmt: skip
    _underside(b, finish, shape)
    _ends(b, finish, style, shape)
    if int(shape["body"]) == _TRUCK:
        _cargo(b, finish, shape)
    elif int(shape["body"]) == _PICKUP:
        _bed(b, finish, shape)
    if int(shape["body"]) != _BUS:
        _mirrors(b, finish, style, shape)
    return b.mesh()


def _axles(shape: Mapping[str, float]) -> tuple[float, float]:
    shift = axle_shift(shape)
    return shift - shape["wheelbase"] / 2, shift + shape["wheelbase"] / 2


def _stations(style: _Style, shape: Mapping[str, float]) -> list[float]:
    """Where cross-sections are taken, from the rear to the nose, in metres: every knot, pillar and arch."""
    length = shape["length"]
    knots = {u for curve in (style.belt, style.roof, style.plan) for u, _ in curve}
    knots |= {u + side * 0.035 / length for u in style.pillars for side in (-1, 1)}
    places = {round((u - 0.5) * length, 4) for u in knots}
    radius = 1.13 * shape["wheel"]
    for axle in _axles(shape):
        places |= {
            round(axle + radius * k, 4) for k in (-1.0, -0.985, -0.9, -0.7, -0.4, 0.0, 0.4, 0.7, 0.9, 0.985, 1.0)
        }
    found: list[float] = []
    for x in sorted(places):
        if not found or x - found[-1] > 0.002:
            found.append(x)
    return found


def _sections(style: _Style, shape: Mapping[str, float], stations: list[float]) -> Array:
    """Rings of the body, each counter-clockwise seen from the front, from the left sill over the roof to the right."""
    length, half, height, wheel = shape["length"], shape["width"] / 2, shape["height"], shape["wheel"]
    rings = []
    for x in stations:
        u = x / length + 0.5
        w, belt = half * _value(style.plan, u), height * _value(style.belt, u)
        roof = max(belt, height * _roof(style, u))
        ends = min(u, 1 - u) * length
        low = shape["clearance"] + 0.10 * max(0.0, 1 - ends / 0.5)
        for axle in _axles(shape):
            reach = 1.13 * wheel
            if abs(x - axle) < reach:
                low = max(low, wheel + math.sqrt(reach * reach - (x - axle) * (x - axle)))
        low = min(low, belt - 0.05)
        cabin = min(1.0, (roof - belt) / 0.3)
        top = style.roof_width * half * (0.97 + 0.03 * cabin)
        rise = belt - low
        side = [
            (0.93 * w, low),
            (0.985 * w, low + 0.16 * rise),
            (w, low + 0.55 * rise),
            (0.985 * w, belt - 0.16 * min(rise, 0.5)),
            (0.945 * w, belt),
            (_mix(0.86 * w, min(top, w) * 1.02 + 0.02, cabin), max(belt + 0.015, roof - style.rail * cabin)),
            (_mix(0.62 * w, min(top, w) * 0.9, cabin), max(belt + 0.03, roof - 0.012)),
            (0.0, max(belt + 0.04, roof + 0.012)),
        ]
        rings.append([(x, y, z) for y, z in side] + [(x, -y, z) for y, z in side[-2::-1]])
    return np.array(rings)


def _mix(a: float, b: float, t: float) -> float:
    return a + (b - a) * t


def _roof(style: _Style, u: float) -> float:
    (first, _), (last, _) = style.roof[0], style.roof[-1]
    if not first < u < last:
        return 0.0
    inner = list(style.roof)
    inner[0] = (first, _value(style.belt, first))
    inner[-1] = (last, _value(style.belt, last))
    return _value(inner, u)


def _cells(f: _Finish, style: _Style, shape: Mapping[str, float], stations: list[float]) -> list[list[Surface | None]]:
    """What each patch between two cross-sections is: trim below, paint, side windows, wind screens, lamps."""
    length = shape["length"]
    full = [u for u, z in style.roof if z >= 0.92 * max(v for _, v in style.roof)]
    first, last = style.roof[0][0], style.roof[-1][0]
    rows: list[list[Surface | None]] = []
    for x0, x1 in pairwise(stations):
        u = (x0 + x1) / 2 / length + 0.5
        cabin = first < u < last
        pillar = any(abs(u - p) * length < 0.04 for p in style.pillars)
        screen = cabin and (u < full[0] or u > full[-1])
        lamp = f.headlight if u > 0.5 else f.taillight
        lit = 0.012 * 4.6 < min(u, 1 - u) * length < 0.045 * 4.6 and int(shape["body"]) < _BUS
        half: list[Surface | None] = [
            f.trim,
            f.paint,
            lamp if lit else f.paint,
            f.paint,
            (f.trim if pillar else f.glass) if cabin else f.paint,
            f.paint,
            f.glass if screen else f.paint,
        ]
        rows.append([*half, *half[::-1], f.trim])
    return rows


def _underside(b: Builder, f: _Finish, shape: Mapping[str, float]) -> None:
    """A dark core, so that no light falls through the wheel arches."""
    reach, y = 1.2 * shape["wheel"], shape["width"] / 2 - 0.36
    rear, front = _axles(shape)
    top = 2.13 * shape["wheel"] + 0.03
    if int(shape["body"]) == _TRUCK:
        top = min(top, 0.29 * shape["height"])
    b.box(f.trim, (rear - reach, -y, shape["clearance"] - 0.02), (front + reach, y, top))


def _ends(b: Builder, f: _Finish, style: _Style, shape: Mapping[str, float]) -> None:
    """Grille, plates, and lamps at nose and tail; the headlights light the road."""
    x, height = shape["length"] / 2, shape["height"]
    for sign, u in ((1.0, 1.0), (-1.0, 0.0)):
        w, belt = shape["width"] / 2 * _value(style.plan, u), height * _value(style.belt, u)
        low = shape["clearance"] + 0.10
        at = sign * (x + 0.006)

        def panel(surface: Surface, y0: float, y1: float, z0: float, z1: float, at: float = at) -> None:
            quad = [(at, y0, z0), (at, y1, z0), (at, y1, z1), (at, y0, z1)]
            b.quads(surface, [quad if at > 0 else quad[::-1]])

        span = belt - low
        panel(f.plate, -0.26, 0.26, low + 0.30 * span, low + 0.30 * span + 0.11, at + sign * 0.004)
        lamp = f.headlight if sign > 0 else f.taillight
        for s in (1.0, -1.0):
            y0, y1 = sorted((s * 0.62 * w, s * 0.96 * w))
            panel(lamp, y0, y1, low + 0.62 * span, low + 0.9 * span)
        if sign > 0:
            panel(f.trim, -0.55 * w, 0.55 * w, low + 0.55 * span, low + 0.85 * span)
            panel(f.trim, -0.8 * w, 0.8 * w, low + 0.05 * span, low + 0.24 * span)
            for s in (1.0, -1.0):
                place = (round(x + 0.05, 6), round(s * 0.78 * w, 6), round(low + 0.76 * span, 6))
                b.lights.append(Light(place, (0.994988, 0.0, -0.1), (1.0, 0.93, 0.82), 9000.0, 0.88))
        else:
            panel(f.trim, -0.85 * w, 0.85 * w, low + 0.02 * span, low + 0.16 * span)
    if int(shape["body"]) == _BUS:
        z0, z1, w = 0.865 * height, 0.955 * height, 0.62 * shape["width"] / 2
        b.box(f.trim, (x - 0.16, -w, z0), (x + 0.012, w, z1))


def _cargo(b: Builder, f: _Finish, shape: Mapping[str, float]) -> None:
    """A truck's box, with doors at its rear."""
    x0, x1, w, h = -shape["length"] / 2, (0.715 - 0.5) * shape["length"], shape["width"] / 2, shape["height"]
    low, edge = 0.30 * h, 0.03
    b.box(f.paint, (x0, -w, low), (x1, w, h))
    b.box(f.trim, (x0 - 0.01, -w - 0.01, low - 0.06), (x1 + 0.01, w + 0.01, low))
    b.quads(
        f.trim, [[(x0 - 0.004, 0.015, low), (x0 - 0.004, -0.015, low), (x0 - 0.004, -0.015, h), (x0 - 0.004, 0.015, h)]]
    )
    for s in (1.0, -1.0):
        y = s * (w - edge)
        b.box(f.rim, (x0 - 0.012, y - edge, low), (x0 + 0.03, y + edge, h + 0.012))


def _bed(b: Builder, f: _Finish, shape: Mapping[str, float]) -> None:
    """A pickup's open bed, shown by its dark floor a little above the loft's top."""
    length, w = shape["length"], shape["width"] / 2
    x0, x1, z = (0.02 - 0.5) * length, (0.375 - 0.5) * length, 0.585 * shape["height"] + 0.045
    y = 0.82 * w
    b.box(f.trim, (x0, -y, z - 0.05), (x1, y, z))
    for s in (1.0, -1.0):
        y0, y1 = sorted((s * 0.80 * w, s * 0.93 * w))
        b.box(f.paint, (x0 - 0.03, y0, z - 0.06), (x1, y1, z + 0.10))
    b.box(f.paint, (x0 - 0.06, -0.9 * w, z - 0.06), (x0 + 0.04, 0.9 * w, z + 0.10))


def _mirrors(b: Builder, f: _Finish, style: _Style, shape: Mapping[str, float]) -> None:
    u = style.roof[-1][0] - 0.05
    x, z = (u - 0.5) * shape["length"], shape["height"] * _value(style.belt, u) + 0.03
    w = shape["width"] / 2 * 0.93
    for s in (1.0, -1.0):
        y0, y1 = sorted((s * w, s * (w + 0.16)))
        b.box(f.paint, (x - 0.06, y0, z), (x + 0.05, y1, z + 0.13))


def _wheel(f: _Finish, radius: float, width: float) -> Mesh:
    """A tyre and a rim with five openings on both sides; its axle is y."""
    b, sides = Builder(), 20
    ring = circle(sides)
    half = width / 2

    def around(y: float, r: float) -> list[tuple[float, float, float]]:
        return [(r * s, y, r * c) for c, s in ring]

    profile = [(-half, 0.64), (-half, 0.90), (-0.84 * half, 0.985), (-0.6 * half, 1.0)]
    profile += [(-y, r) for y, r in reversed(profile)]
    b.grid(f.rubber, [around(y, r * radius) for y, r in profile], crease=0.6)
    for s in (1.0, -1.0):
        dish = [(half, 0.64), (half - 0.025, 0.60), (half - 0.03, 0.2), (half - 0.012, 0.16), (half - 0.012, 0.0)]
        rows = [around(s * y, r * radius) for y, r in dish]
        b.grid(f.rim, rows if s > 0 else rows[::-1], crease=0.8)
        for k in range(5):
            quad = []
            for r, angle in ((0.25, -15.0), (0.55, -24.0), (0.55, 24.0), (0.25, 15.0)):
                c, sn = circle(1, 72.0 * k + angle)[0]
                quad.append((r * radius * sn, s * (half - 0.022), r * radius * c))
            b.quads(f.trim, [quad if s > 0 else quad[::-1]])
    return b.mesh()
