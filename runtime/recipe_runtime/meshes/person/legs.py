"""Legs and feet: trouser legs that continue the hips, bare legs below shorts and skirts, shoes with soles."""

from __future__ import annotations

import numpy as np

from recipe_runtime.meshes.builder import circle
from recipe_runtime.meshes.curves import smooth
from recipe_runtime.meshes.person.hull import Hull, Weights
from recipe_runtime.meshes.person.outfit import SHORTS, SKIRT, TROUSERS, Outfit
from recipe_runtime.meshes.person.trunk import Build, ramp
from recipe_runtime.meshes.vectors import Array, Index

# Share of the way from the hip (0) to the ankle (1), then half depth in front, behind, and half width. The knee: 0.505.
_FRONT = ((0.0, 0.050), (0.15, 0.050), (0.3, 0.044), (0.45, 0.036), (0.505, 0.035), (0.6, 0.030), (0.75, 0.024),
    (0.9, 0.0195),
          (1.0, 0.021))  # fmt: skip
_BEHIND = ((0.0, 0.056), (0.15, 0.050), (0.3, 0.042), (0.45, 0.033), (0.505, 0.031), (0.6, 0.035), (0.68, 0.037),
    (0.8, 0.029),
           (0.9, 0.022), (1.0, 0.022))  # fmt: skip
_WIDTH = ((0.0, 0.048), (0.15, 0.0475), (0.3, 0.0425), (0.45, 0.0345), (0.505, 0.0325), (0.6, 0.0315),
    (0.68, 0.0325), (0.8, 0.026),
          (0.9, 0.0195), (1.0, 0.0180))  # fmt: skip


def add_legs(hull: Hull, b: Build, o: Outfit, edge: Index, low: Array) -> None:
    """Add both legs and feet; `edge` numbers the lowest ring of the hips, whose points are `low` [C, 3]."""
    columns = b.columns
    inner = columns // 4 - 1
    front, back = low[0], low[columns // 2]
    steps = [(n + 1) / (inner + 1) for n in range(inner)]
    crotch = np.array([back + (front - back) * t for t in steps]) if inner else np.zeros((0, 3))
    seam: Index | None = None
    for side, s in (("left", 1.0), ("right", -1.0)):
        half = [(columns - k) % columns if s < 0 else k for k in range(columns // 2 + 1)]
        first = np.concatenate([low[half], crotch])
        numbers = np.concatenate([edge[half], -np.ones(inner, np.int64)])
        if seam is not None:
            numbers[len(half) :] = seam
        found = _leg(hull, b, o, side, s, first, numbers)
        seam = found[len(half) :]
        _foot(hull, b, o, side, s)


def _ring(b: Build, t: float, ease: float, count: int, s: float) -> Array:
    """Return a level ring of a leg, in the order of the hips: from the front outwards."""
    f = b.figure
    h, g = f.height, 0.35 + 0.65 * f.girth + 0.04 * b.female * max(0.0, 1.0 - 2.0 * t)
    front, behind, wide = (smooth(table, t) * g for table in (_FRONT, _BEHIND, _WIDTH))
    z = f.hip - t * (f.thigh + f.shin)
    x = (-0.006 * t - 0.004 * max(0.0, 1.0 - abs(t - 0.6) / 0.25)) * h * 0.5
    y = 0.05 * h
    rows = []
    for k in range(count):
        sn, c = circle(1, -30.0 + 360.0 * k / count)[0][::-1]
        depth = (front if c > 0.0 else behind) + ease
        rows.append((x + depth * h * c, s * (y + (wide + ease) * h * sn), z))
    return np.array(rows)


def _leg(hull: Hull, b: Build, o: Outfit, side: str, s: float, first: Array, numbers: Index) -> Index:
    count = len(first)
    cut = {TROUSERS: 0.985, SHORTS: 0.44, SKIRT: 0.16}[o.legs]
    steps = (
        (0.16, 0.30, 0.505, 0.68, 0.985),
        (0.14, 0.24, 0.36, 0.45, 0.505, 0.56, 0.64, 0.78, 0.92),
        (0.11, 0.16, 0.22, 0.30, 0.37, 0.43, 0.475, 0.505, 0.535, 0.58, 0.64, 0.71, 0.79, 0.87, 0.94),
    )[b.detail]
    ease = [0.007 + 0.006 * max(0.0, t - 0.2) for t in steps]
    if o.legs == SHORTS:
        ease = [0.010 + 0.012 * t for t in steps]
    rings = [_ring(b, t, e, count, s) for t, e in zip(steps, ease, strict=True) if t < cut - 0.03]
    last = 0.018 if o.legs == SHORTS else 0.0155 if o.legs == TROUSERS else 0.006
    rings.append(_ring(b, cut, last, count, s))
    points = np.stack([first, *rings])
    if len(rings) > 1:  # the first ring is between the edge of the hips and a level ring
        points[1] = points[1] * 0.72 + first * 0.28
    own = hull.sheet(
        points,
        _weights(b, side, s, points),
        o.trousers,
        welds={0: numbers} if (numbers >= 0).all() else None,
        mirrored=s > 0,
    )
    if not (numbers >= 0).all():
        hull.weld(own[0][numbers >= 0], numbers[numbers >= 0])
    hem = np.stack([points[-1], points[-1] + (points[-1].mean(axis=0) - points[-1]) * 0.25 + (0.0, 0.0, 0.004)])
    hull.sheet(hem, _weights(b, side, s, hem), o.trousers, mirrored=s > 0)
    bare = [max(0.02, cut - 0.07), *(t for t in steps if t > cut), 1.0]
    bare = [*bare, 1.04] if o.legs != TROUSERS else [0.93, 1.04]
    skin = np.stack([_ring(b, t, 0.0, count, s) for t in bare])
    hull.sheet(skin, _weights(b, side, s, skin), o.skin, mirrored=s > 0)
    found: Index = own[0]
    return found


def _weights(b: Build, side: str, s: float, points: Array) -> Weights:
    f = b.figure
    h = f.height
    y, z = points[..., 1], points[..., 2]
    knee, ankle = f.hip - f.thigh, f.ankle
    thigh = 0.75 + 0.25 * ramp(-z, -f.hip + 0.02 * h, -f.hip + 0.10 * h)
    thigh = np.minimum(
        thigh,
        0.75 * ramp(-z, -f.hip - 0.012 * h, -f.hip + 0.055 * h) + 2.0 * ramp(-z, -f.hip + 0.04 * h, -f.hip + 0.10 * h),
    )
    near = ramp(s * y, -0.03 * h, 0.03 * h)
    far = ramp(-z, -f.hip + 0.04 * h, -f.hip + 0.09 * h)
    near = near + (1.0 - near) * far
    shin = ramp(-z, -knee - 0.032 * h, -knee + 0.032 * h)
    foot = 0.85 * ramp(-z, -ankle - 0.022 * h, -ankle + 0.01 * h)
    other = "right" if side == "left" else "left"
    shares = np.stack(
        [
            1.0 - thigh,
            thigh * (1.0 - near),
            thigh * near * (1.0 - shin),
            thigh * near * shin * (1.0 - foot),
            thigh * near * shin * foot,
        ],
        -1,
    )
    return Weights(("pelvis", f"thigh_{other}", f"thigh_{side}", f"shin_{side}", f"foot_{side}"), shares)


def _foot(hull: Hull, b: Build, o: Outfit, side: str, s: float) -> None:
    """Add a shoe with a sole: sections along x from heel to toe."""
    f = b.figure
    h = f.height
    rows: tuple[tuple[float, ...], ...] = (  # x, inner and outer half width, height of the upper, thickness of the sole
        (-0.0385, 0.002, 0.002, 0.016, 0.013), (-0.036, 0.012, 0.011, 0.026, 0.013),
        (-0.032, 0.0185, 0.0190, 0.042, 0.014), (-0.020, 0.0215, 0.0220, 0.058, 0.014),
        (0.004, 0.0220, 0.0225, 0.060, 0.013), (0.028, 0.0215, 0.0240, 0.050, 0.011),
        (0.055, 0.0245, 0.0265, 0.0385, 0.010),
        (0.082, 0.0265, 0.0260, 0.031, 0.010), (0.101, 0.0235, 0.0215, 0.0255, 0.010),
        (0.112, 0.0165, 0.0135, 0.020, 0.010),
        (0.117, 0.009, 0.007, 0.016, 0.010), (0.119, 0.002, 0.002, 0.0115, 0.010),
    )  # fmt: skip
    if b.detail == 0:
        rows = tuple(rows[k] for k in (0, 1, 4, 7, 10, 11))
    count = (6, 10, 14)[b.detail]
    upper = []
    for x, inside, outside, top, sole in rows:
        ring = []
        for k in range(count + 1):
            sn, c = circle(1, 180.0 * k / count)[0][::-1]
            wide = outside if c > 0.0 else inside
            ring.append(
                (x * h, s * (0.05 * h + wide * h * c * (1.0 + 0.12 * sn)), (sole * 0.8 + (top - sole * 0.8) * sn) * h)
            )
        upper.append(ring)
    foot = Weights.whole(f"foot_{side}")
    points = np.array(upper)
    hull.sheet(points, foot, o.shoes, closed=False, mirrored=s < 0)
    edge = []
    for x, inside, outside, _, sole in rows:
        wide = 1.06
        low = max(0.0, -x - 0.036, 1.6 * (x - 0.117))  # bent up at its ends, about which it rolls
        across = (
            (-inside * wide, sole),
            (-inside * wide, low + 0.001),
            (0.0, low),
            (outside * wide, low + 0.001),
            (outside * wide, sole),
        )
        ring = [(x * h, s * (0.05 * h + y * h), z * h) for y, z in across]
        edge.append(ring)
    under = np.array(edge)
    for n in range(4):
        hull.sheet(under[:, n : n + 2], foot, o.sole, closed=False, mirrored=s < 0)
    ledge = np.stack([under[:, 4], points[:, 0]], axis=1)
    hull.sheet(ledge, foot, o.sole, closed=False, mirrored=s < 0)
    ledge = np.stack([points[:, -1], under[:, 0]], axis=1)
    hull.sheet(ledge, foot, o.sole, closed=False, mirrored=s < 0)
