"""Monuments: a fountain and a statue."""

from __future__ import annotations

import numpy as np
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, icosphere, noise, tube, upright
from recipe_runtime.meshes.furniture import lathed
from recipe_runtime.meshes.mesh import Pattern, Surface

_STONE = Surface("stone", Pattern.STONE, Tag.STATIC)
_SMOOTH = Surface("stone", Pattern.CONCRETE, Tag.STATIC)
_BRONZE = Surface("bronze", Pattern.METAL, Tag.STATIC)
_PLATE = Surface("plate", Pattern.METAL, Tag.STATIC)
_WATER = Surface("water", Pattern.WATER, Tag.WATER)


def fountain(b: Builder, e: Element) -> None:
    """Build a fountain: a round basin, a central column with two bowls, and water in all of them."""
    across, _, height = e.size
    r, rim = across / 2, 0.24 * height
    b.grid(_STONE, lathed([(0.0, r), (0.7 * rim, 0.97 * r)], 32), crease=0.7)
    lip = [(0.7 * rim, 0.97 * r), (0.75 * rim, r), (rim, r), (rim, 0.9 * r), (0.2 * rim, 0.9 * r)]
    b.grid(_SMOOTH, lathed(lip, 32), crease=0.7)
    b.fan(_WATER, [tuple(p) for p in lathed([(0.72 * rim, 0.9 * r)], 32)[0]])
    column = [(0.2 * rim, 0.16), (1.1 * rim, 0.14), (1.3 * rim, 0.07), (0.55 * height, 0.06), (0.58 * height, 0.1)]
    bowl = [(0.58 * height, 0.12), (0.62 * height, 0.3), (0.68 * height, 0.38), (0.69 * height, 0.37)]
    b.grid(_SMOOTH, lathed([(z, k * r) for z, k in column + bowl], 20), crease=0.6)
    b.fan(_WATER, [tuple(p) for p in lathed([(0.685 * height, 0.375 * r)], 20)[0]])
    crown = [(0.66, 0.05), (0.84, 0.04), (0.87, 0.1), (0.91, 0.17), (0.92, 0.16)]
    b.grid(_SMOOTH, lathed([(z * height, k * r) for z, k in crown], 16), crease=0.6)
    b.fan(_WATER, [tuple(p) for p in lathed([(0.915 * height, 0.165 * r)], 16)[0]])
    jet = [(0.9 * height, 0.03 * r), (0.97 * height, 0.022 * r), (height, 0.008 * r)]
    b.grid(_WATER, lathed(jet, 8), crease=0.2, caps=(None, _WATER))


def statue(b: Builder, e: Element) -> None:
    """Build a bronze figure in a long coat on a stepped pedestal; the key turns its head and selects the raised arm."""
    across, _, height = e.size
    half, key = across / 2, int(e.shape["key"])
    base = 0.46 * height
    for low, high, wide in ((0.0, 0.06, 1.0), (0.06, 0.11, 0.86), (0.39, 0.42, 0.66), (0.42, 0.46, 0.74)):
        w = wide * half
        b.box(_SMOOTH, (-w, -w, low * height), (w, w, high * height), "-z" if low == 0.0 else "")
    w = 0.6 * half
    b.box(_STONE, (-w, -w, 0.11 * height), (w, w, 0.39 * height), "-z +z")
    b.quads(_PLATE, [upright(w + 0.006, -0.5 * w, 0.5 * w, 0.2 * height, 0.32 * height)])
    _figure(b, key, base, height - base)


def _figure(b: Builder, key: int, foot: float, tall: float) -> None:
    """Add a standing figure of rounded pieces, `tall` metres high, with its soles at height `foot`."""
    coat = [
        (0.0, 0.15),
        (0.03, 0.16),
        (0.3, 0.145),
        (0.52, 0.105),
        (0.56, 0.11),
        (0.7, 0.135),
        (0.78, 0.13),
        (0.83, 0.07),
    ]
    rings = lathed([(foot + z * tall, r * tall) for z, r in coat], 12)
    folds = np.array([1.0 + 0.07 * noise(key, k) for k in range(12)])[None, :, None]
    rings[:, :, 0:2] = rings[:, :, 0:2] * np.array([0.78, 1.0]) * np.where(np.arange(8)[:, None, None] < 4, folds, 1.0)
    b.grid(_BRONZE, rings, crease=0.2, caps=(None, _BRONZE))
    b.grid(_BRONZE, lathed([(foot + 0.82 * tall, 0.045 * tall), (foot + 0.88 * tall, 0.04 * tall)], 8), crease=0.0)
    points, faces = icosphere(2)
    head = points * np.array([0.058, 0.05, 0.07]) * tall + np.array(
        [0.01 * tall, 0.01 * noise(key, 20), foot + 0.93 * tall]
    )
    b.smooth(_BRONZE, head, faces, 0.0)
    raised = noise(key, 21) > 0.0
    for side in (1, -1):
        shoulder = (0.0, side * 0.125 * tall, foot + 0.775 * tall)
        if side > 0 and raised:
            elbow, hand = (0.09, 0.17, 0.8), (0.24, 0.16, 0.92)
        else:
            elbow, hand = (0.0, 0.165, 0.58), (0.08, 0.14, 0.45)
        path = [shoulder] + [(x * tall, side * y * tall, foot + z * tall) for x, y, z in (elbow, hand)]
        if path[-1][2] < path[0][2]:
            path = path[::-1]
        radii = [0.032 * tall, 0.038 * tall, 0.05 * tall]
        arm = tube(path, radii if path[0] != shoulder else radii[::-1], 8)
        b.grid(_BRONZE, arm, crease=0.0, caps=(_BRONZE, _BRONZE))
