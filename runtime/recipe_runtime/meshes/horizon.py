"""The land around a town: rings of wooded hills, in which every street's view ends."""

from __future__ import annotations

from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, Vec, circle, noise
from recipe_runtime.meshes.mesh import Pattern, Surface

_WOOD = Surface("wood", Pattern.GRASS, Tag.TERRAIN)
_SIDES = 360
_RIDGES = ((640.0, 30.0, 6.0, 15.0), (740.0, 60.0, 18.0, 62.0))  # radius, depth, lowest and highest crest, metres
_SLOPE = 60.0  # metres over which the hills rise beside a gap
_CROWNS = 3.5  # metres by which the tops of trees vary


def hills(b: Builder, gap: float) -> None:
    """Add the rings around the origin; each rises from its radius over its depth, up to a crest of treetops.

    A road along y passes through a gap, `gap` metres to either side; 0: there is none.
    """
    points = circle(_SIDES)
    for ring, (radius, depth, low, high) in enumerate(_RIDGES):
        crest = [low + (high - low) * _swell(ring, k) + _CROWNS * noise(977 + ring, k) for k in range(_SIDES)]
        crest = [z * _beside(gap, radius * x) for (x, _), z in zip(points, crest, strict=True)]
        foot: list[Vec] = [(radius * x, radius * y, -0.04) for x, y in points]
        top: list[Vec] = [
            ((radius + depth) * x, (radius + depth) * y, z) for (x, y), z in zip(points, crest, strict=True)
        ]
        following = [*range(1, _SIDES), 0]
        b.quads(_WOOD, [(foot[j], foot[k], top[k], top[j]) for k, j in enumerate(following)])


def _beside(gap: float, x: float) -> float:
    """Return the share of the height of the hills beside a road along y, 0 on the road."""
    return min(max((abs(x) - gap) / _SLOPE, 0.0), 1.0) if gap else 1.0


def _swell(ring: int, k: int) -> float:
    """Return the height of the hills at a side, 0 to 1: smooth noise of two lengths that closes around the ring."""
    total = 0.0
    for octave, (share, sides) in enumerate(((0.7, 30), (0.3, 9))):
        t = k / sides
        i = int(t)
        f = (t - i) * (t - i) * (3.0 - 2.0 * (t - i))
        key, count = 31 * ring + octave + 953, _SIDES // sides
        a, c = 0.5 + 0.5 * noise(key, i % count), 0.5 + 0.5 * noise(key, (i + 1) % count)
        total += share * (a + (c - a) * f)
    return total
