"""What people carry: a backpack, a shoulder bag, a handbag, a shopping bag, a telephone."""

from __future__ import annotations

import numpy as np

from recipe_runtime.meshes.builder import circle
from recipe_runtime.meshes.lofts import rings
from recipe_runtime.meshes.person.hull import Hull, Weights
from recipe_runtime.meshes.person.outfit import Outfit
from recipe_runtime.meshes.person.trunk import Build, section
from recipe_runtime.meshes.vectors import Array, cross, unit

BACKPACK, SATCHEL, HANDBAG, SHOPPING = 1, 2, 3, 4  # values of `shape["bag"]`


def add_bag(hull: Hull, b: Build, o: Outfit, kind: int) -> None:
    """Add a bag."""
    if kind == BACKPACK:
        _backpack(hull, b, o)
    elif kind == SATCHEL:
        _satchel(hull, b, o)
    elif kind in (HANDBAG, SHOPPING):
        _hand_bag(hull, b, o, kind)


def _backpack(hull: Hull, b: Build, o: Outfit) -> None:
    f = b.figure
    h, top = f.height, f.shoulders
    torso = Weights.whole("torso")
    sides = (8, 12, 16)[b.detail]
    sack = [
        (-0.215, 0.030, 0.052),
        (-0.20, 0.043, 0.068),
        (-0.15, 0.052, 0.077),
        (-0.09, 0.050, 0.078),
        (-0.03, 0.043, 0.072),
        (-0.008, 0.032, 0.062),
        (0.002, 0.015, 0.04),
    ]
    back = section(b, 0.70)[1]
    hull.sheet(
        rings([(z * h + top, rx * h, ry * h, -back - 0.036 * h) for z, rx, ry in sack], square=0.16, sides=sides),
        torso,
        o.bag,
        caps=(True, True),
    )
    front = section(b, 0.735, 0.012)[0]
    for s in (1.0, -1.0):
        path = [
            (-back, s * 0.045 * h, top - 0.005 * h),
            (-0.02 * h, s * 0.050 * h, top + 0.027 * h),
            (0.5 * front, s * 0.054 * h, top + 0.017 * h),
            (0.97 * front, s * 0.058 * h, top - 0.035 * h),
            (0.96 * front, s * 0.066 * h, top - 0.085 * h),
            (0.3 * front, s * 0.094 * h, top - 0.145 * h),
            (-back, s * 0.07 * h, top - 0.175 * h),
        ]
        _strap(hull, o, path, 0.011 * h, torso)


def _satchel(hull: Hull, b: Build, o: Outfit) -> None:
    """Add a bag at the left hip, with a strap over the right shoulder."""
    f = b.figure
    h, top = f.height, f.shoulders
    torso = Weights.whole("torso")
    sides = (8, 12, 16)[b.detail]
    sack = [
        (-0.33, 0.050, 0.014),
        (-0.32, 0.056, 0.020),
        (-0.27, 0.058, 0.024),
        (-0.225, 0.055, 0.022),
        (-0.215, 0.05, 0.012),
    ]
    wide = section(b, 0.53, 0.02)[2]
    pelvis = Weights.whole("pelvis")
    hull.sheet(
        rings(
            [(z * h + top, rx * h, ry * h, -0.01 * h) for z, rx, ry in sack],
            y=wide + 0.012 * h,
            square=0.2,
            sides=sides,
        ),
        pelvis,
        o.bag,
        caps=(True, True),
    )
    front, back = section(b, 0.70, 0.016)[:2]
    path = [
        (0.03 * h, wide, top - 0.22 * h),
        (front * 0.9, 0.05 * h, top - 0.14 * h),
        (front, 0.0, top - 0.085 * h),
        (0.5 * front, -0.045 * h, top + 0.018 * h),
        (-0.5 * back, -0.045 * h, top + 0.026 * h),
        (-back, 0.0, top - 0.07 * h),
        (-back * 0.9, 0.05 * h, top - 0.14 * h),
        (-0.05 * h, wide, top - 0.22 * h),
    ]
    _strap(hull, o, path, 0.008 * h, torso)


def _hand_bag(hull: Hull, b: Build, o: Outfit, kind: int) -> None:
    """Add a bag that hangs from the right hand."""
    f = b.figure
    h = f.height
    hand = Weights.whole("forearm_right")
    z, y = f.shoulders - 0.405 * h, -f.shoulder
    deep, wide, tall = (0.085, 0.030, 0.11) if kind == HANDBAG else (0.095, 0.042, 0.17)
    drop = 0.055 if kind == HANDBAG else 0.07
    rows = [
        (z - (drop + tall * t) * h, deep * k * h, wide * k2 * h, 0.005 * h)
        for t, k, k2 in ((1.0, 0.9, 0.8), (0.97, 1.0, 1.0), (0.5, 1.0, 1.05), (0.05, 0.97, 0.7), (0.0, 0.93, 0.45))
    ]
    hull.sheet(rings(rows, y=y, square=0.2, sides=(8, 12, 16)[b.detail]), hand, o.bag, caps=(True, True))
    for s in (1.0, -1.0):
        path = [
            (s * 0.05 * h, y, z - drop * h),
            (s * 0.035 * h, y, z - 0.4 * drop * h),
            (0.005 * h, y, z),
            (-s * 0.02 * h, y, z - 0.2 * drop * h),
        ]
        _strap(hull, o, path[:3], 0.005 * h, hand)


def add_telephone(hull: Hull, b: Build, o: Outfit) -> None:
    """Add a telephone in the right hand."""
    f = b.figure
    h = f.height
    x, y, z = 0.016 * h, -f.shoulder + 0.014 * h, f.shoulders - 0.39 * h
    deep, wide, tall = 0.0045, 0.020, 0.043
    rows = [
        [(x + c * wide * h, y + s * deep * h, z + t * tall * h) for c, s in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        for t in (-1, 1)
    ]
    hull.sheet(np.array(rows), Weights.whole("forearm_right"), o.pupil, caps=(True, True))


def _strap(hull: Hull, o: Outfit, path: list[tuple[float, float, float]], radius: float, weights: Weights) -> None:
    p: Array = np.array(path)
    ahead = unit(np.concatenate([p[1:2] - p[0:1], p[2:] - p[:-2], p[-1:] - p[-2:-1]]))
    u = unit(cross(np.where(np.abs(ahead[:, 1:2]) < 0.8, [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]]), ahead))
    v = cross(ahead, u)
    rows = [p + radius * (0.35 * c * u + s * v) for c, s in circle(6)]
    hull.sheet(np.stack(rows, axis=1), weights, o.bag)
