"""Trees of five species: trunks with flared roots, branches, and crowns of leaves in three levels of detail.

A tree is one of a few shapes of its species, stretched to its size. Shapes are in units of the crown's width, and
their bark is split into axes, which are stretched with the crown, and offsets from them in units of the trunk's radius.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder, circle, lattice, level, noise, noises
from recipe_runtime.meshes.foliage import Clumps, Growth, Leaves, fitted, foliage, spiral
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.vectors import Array, Index, cross, unit

_BARK = Surface("bark", Pattern.BARK, Tag.VEGETATION)
_BIRCH_BARK = Surface("bark", Pattern.BIRCH_BARK, Tag.VEGETATION)
_LEAVES = Surface("leaves", Pattern.FOLIAGE, Tag.VEGETATION)
_PIT = Surface("pit", Pattern.BARK, Tag.TERRAIN)
_GRATE = Surface("grate", Pattern.METAL, Tag.TERRAIN)
_STAKE = Surface("stake", Pattern.WOOD, Tag.VEGETATION)
_SHAPES = 8  # of each species
_YOUNG = 5.2  # metres of height below which a tree has stakes


@dataclass(frozen=True)
class Wood:
    """Trunk and branches: axes [N, 3], offsets from them [N, 3] in trunk radii, triangles [T, 3]."""

    axes: Array
    offsets: Array
    triangles: Index


@dataclass(frozen=True)
class Species:
    """The form of a species, in units of the crown's width."""

    height: float
    low: float  # relative height at which the crown begins
    clumps: Callable[[int], Clumps]
    wood: Callable[[int, Clumps, int], Wood]  # by key, clumps, and the number of sides of its trunk
    growths: tuple[Growth, Growth, Growth]  # near, middle, far
    bark: Surface = _BARK


def tree(b: Builder, e: Element) -> None:
    """Build a tree centred on the origin; `species` is an index of `SPECIES`."""
    spread, _, height = e.size
    key, r, species = int(e.shape["key"]), e.shape["trunk"], int(e.shape.get("species", 0))
    kind = SPECIES[species]
    scale = np.array([spread, spread, height])
    _pit(b, key, height)
    limits = (0.0, 3.0 * height, 10.0 * height, math.inf)
    for detail, (near, far) in enumerate(itertools.pairwise(limits)):
        with b.level(near, far, anchor=(0.0, 0.0, 0.55 * height), casts=detail == 1):
            wood = _wood(species, key % _SHAPES, detail)
            marks = wood.axes[:, :2] * spread
            b.add(kind.bark, wood.axes * scale + wood.offsets * r, unit(wood.offsets), marks, wood.triangles)
            leaves = _crown(species, key % _SHAPES, detail)
            b.add(_LEAVES, leaves.points * scale, leaves.normals, leaves.uvs, leaves.triangles)


def _pit(b: Builder, key: int, height: float) -> None:
    """Add the soil around a trunk; a young tree has a grate and two stakes with a strap."""
    b.quads(_PIT, [level(-0.6, 0.6, -0.6, 0.6, 0.004)])
    if height >= _YOUNG:
        return
    bars = [level(-0.58, 0.58, y, y + 0.05, 0.02) for y in (-0.55, -0.42, -0.29, 0.24, 0.37, 0.5)]
    b.quads(_GRATE, [*bars, level(-0.58, -0.53, -0.55, 0.55, 0.022), level(0.53, 0.58, -0.55, 0.55, 0.022)])
    for y in (-0.32, 0.32):
        b.box(_STAKE, (-0.035, y - 0.035, 0.0), (0.035, y + 0.035, 1.7), without="-z")
    b.box(_STAKE, (-0.012, -0.32, 1.45), (0.012, 0.32, 1.52))


@cache
def _crown(species: int, shape: int, detail: int) -> Leaves:
    """Return one of the crowns of a species in a level of detail, for a tree of height and spread 1."""
    kind = SPECIES[species]
    clumps = kind.clumps(shape)
    middle = np.array([0.0, 0.0, kind.height * (0.35 + 0.5 * kind.low)])
    leaves = foliage(clumps, kind.growths[detail], 100 * species + shape, middle)
    one = fitted(leaves, np.array([-0.5, -0.5, kind.low]), np.array([0.5, 0.5, 1.0]))
    return replace(one, normals=leaves.normals)  # trees are hardly stretched


@cache
def _wood(species: int, shape: int, detail: int) -> Wood:
    """Return trunk and branches of a shape in a level of detail, for a tree of height and spread 1."""
    kind = SPECIES[species]
    wood = kind.wood(shape, kind.clumps(shape), (9, 7, 5)[detail])
    axes = wood.axes / np.array([1.0, 1.0, kind.height])
    return Wood(np.minimum(axes, 0.96), wood.offsets, wood.triangles)  # no branch rises above the crown


def _limb(path: Array, radii: Array, sides: int) -> Wood:
    """Return a tube around a path [R, 3], with radii [R] in trunk radii, or [R, sides] by direction."""
    along = unit(np.concatenate([path[1:2] - path[:1], path[1:] - path[:-1]]))
    x = unit(cross(along, np.array([0.31, 0.95, 0.0])))
    y = cross(along, x)
    ring = np.array(circle(sides))
    around = x[:, None] * ring[:, :1] + y[:, None] * ring[:, 1:]
    offsets = around * np.broadcast_to(radii.reshape(len(path), -1), (len(path), sides))[..., None]
    axes = np.repeat(path, sides, axis=0)
    return Wood(axes, offsets.reshape(-1, 3), lattice(len(path), sides, True))


def _joined(limbs: list[Wood]) -> Wood:
    firsts = np.cumsum([0, *(len(limb.axes) for limb in limbs)])
    return Wood(
        np.concatenate([limb.axes for limb in limbs]),
        np.concatenate([limb.offsets for limb in limbs]),
        np.concatenate([limb.triangles + first for limb, first in zip(limbs, firsts, strict=False)]),
    )


def _trunk(key: int, heights: tuple[float, ...], radii: tuple[float, ...], sides: int, bow: float) -> Wood:
    """Return a slightly bowed trunk; the lowest two of its rings have lobes, the flare of its roots."""
    dx, dy = 0.04 * noise(key, 1), 0.04 * noise(key, 2)
    path = np.array([(bow * dx * z * z, bow * dy * z * z, z) for z in heights])
    lobes = 1.0 + 0.28 * noises(key, 20 + np.arange(sides))
    wide = np.array(radii)[:, None] * np.ones(sides)
    wide[0] *= lobes
    wide[1] *= 0.5 + 0.5 * lobes
    return _limb(path, wide, sides)


def _branches(clumps: Clumps, sides: int, start: float, end: float, thick: float, rise: float) -> list[Wood]:
    """Return a branch from the trunk, between two heights, into each clump: out at first, then up by `rise`.

    Branches with fewer than 3 sides are left out.
    """
    found: list[Wood] = []
    if sides < 3:
        return found
    low, high = clumps.centres[:, 2].min(), clumps.centres[:, 2].max()
    for x, y, z in clumps.centres.tolist():
        foot = min(start + (end - start) * (z - low) / max(high - low, 1e-6), z)
        path = np.array([(0.0, 0.0, foot), (0.55 * x, 0.55 * y, foot + (1.0 - rise) * (z - foot)), (x, y, z)])
        found.append(_limb(path, thick * np.array([1.0, 0.65, 0.06]), sides))
    return found


def _broad_clumps(shape: int) -> Clumps:
    """The crown of a lime or a plane: clumps over an egg, wider above or below."""
    count = 14 + shape % 3
    aim = spiral(count, shape, -0.8, 1.0)
    wide = 1.0 + (0.25 if shape % 2 else -0.2) * aim[:, 2:]
    reach = 0.3 + 0.04 * noises(shape, 90 + np.arange(count))[:, None]
    centres = np.concatenate([aim * reach * np.concatenate([wide, wide, 0 * wide + 1.45], axis=1), np.zeros((1, 3))])
    radius = np.append(0.185 + 0.035 * noises(shape, 60 + np.arange(count)), 0.22)[:, None]
    return Clumps(centres + np.array([0.0, 0.0, 1.18]), radius * np.array([1.0, 1.0, 0.85]))


def _broad_wood(shape: int, clumps: Clumps, sides: int) -> Wood:
    trunk = _trunk(shape, (-0.02, 0.02, 0.09, 0.3, 0.62), (2.2, 1.5, 1.08, 0.9, 0.7), sides, 0.5)
    leader = _limb(np.array([(0.0, 0.0, 0.6), (0.01, 0.0, 0.95), (0.0, 0.0, 1.4)]), np.array([0.7, 0.45, 0.15]), 6)
    return _joined([trunk, leader, *_branches(clumps, sides - 4, 0.55, 1.1, 0.42, 0.55)])


def _poplar_clumps(shape: int) -> Clumps:
    count = 12
    z = (np.arange(count) + 0.5) / count
    side = spiral(count, shape, -0.1, 0.1)
    wide = np.clip(1.5 * (z + 0.25) * (1.25 - z), 0.0, 0.9)
    centres = side * (0.2 * wide)[:, None] + np.stack([0 * z, 0 * z, 0.5 + 2.65 * z], axis=1)
    radius = (0.34 * wide + 0.03 * noises(shape, np.arange(count)))[:, None]
    return Clumps(centres, radius * np.array([1.0, 1.0, 1.25]))


def _poplar_wood(shape: int, clumps: Clumps, sides: int) -> Wood:
    heights, radii = (-0.03, 0.02, 0.12, 1.2, 2.9), (1.9, 1.4, 1.05, 0.7, 0.1)
    return _joined([_trunk(shape, heights, radii, sides, 0.2), *_branches(clumps, sides - 4, 0.3, 2.4, 0.25, 0.8)])


def _birch_clumps(shape: int) -> Clumps:
    """Small, loose clumps that hang from thin branches."""
    count = 19
    aim = spiral(count, shape + 40, -0.75, 1.0)
    reach = 0.34 + 0.09 * noises(shape, 300 + np.arange(count))[:, None]
    wide = 1.0 - 0.3 * np.abs(aim[:, 2:] - 0.0)
    centres = aim * reach * np.concatenate([wide, wide, 0 * wide + 2.1], axis=1) + np.array([0.0, 0.0, 1.45])
    radius = (0.14 + 0.03 * noises(shape, 330 + np.arange(count)))[:, None]
    return Clumps(centres, radius * np.array([1.0, 1.0, 1.35]))


def _birch_wood(shape: int, clumps: Clumps, sides: int) -> Wood:
    heights, radii = (-0.03, 0.02, 0.12, 1.0, 2.1), (1.5, 1.1, 0.85, 0.6, 0.05)
    return _joined([_trunk(shape, heights, radii, sides, 0.4), *_branches(clumps, sides - 4, 0.6, 1.7, 0.2, 0.45)])


def _spruce_clumps(shape: int) -> Clumps:
    """Flat boughs in whorls, shorter and closer towards the top."""
    centres, radii = [], []
    for tier in range(11):
        t = tier / 11
        reach, count = 0.46 * (1.0 - t) + 0.035, 7 if tier < 7 else 5
        for n in range(count):
            k = 20 * tier + n
            s, c = exact.sin_cos_deg(360.0 * n / count + 47.0 * tier + 14.0 * noise(shape, k))
            out = reach * (1.0 + 0.12 * noise(shape, 400 + k))
            centres.append((0.55 * out * c, 0.55 * out * s, 0.3 + 2.1 * t + 0.05 * noise(shape, 800 + k)))
            radii.append((0.3 * out + 0.04, 0.3 * out + 0.04, 0.075))
    centres.append((0.0, 0.0, 2.45))
    radii.append((0.05, 0.05, 0.2))
    return Clumps(np.array(centres), np.array(radii))


def _spruce_wood(shape: int, clumps: Clumps, sides: int) -> Wood:
    heights, radii = (-0.03, 0.03, 0.14, 1.2, 2.5), (1.8, 1.35, 1.0, 0.6, 0.08)
    return _trunk(shape, heights, radii, sides, 0.05)


def _pine_clumps(shape: int) -> Clumps:
    """Flat clouds of needles at the ends of branches, high on a bare trunk."""
    count = 14
    aim = spiral(count, shape + 80, -0.9, 1.0)
    reach = 0.33 + 0.04 * noises(shape, np.arange(count))[:, None]
    centres = aim * reach * np.array([1.0, 1.0, 1.1]) + np.array([0.0, 0.0, 1.75])
    radius = (0.18 + 0.03 * noises(shape, 50 + np.arange(count)))[:, None]
    return Clumps(centres, radius * np.array([1.0, 1.0, 0.55]))


def _pine_wood(shape: int, clumps: Clumps, sides: int) -> Wood:
    heights, radii = (-0.02, 0.02, 0.1, 0.8, 1.4, 1.95), (1.7, 1.3, 1.0, 0.85, 0.65, 0.15)
    return _joined([_trunk(shape, heights, radii, sides, 0.8), *_branches(clumps, sides - 4, 1.15, 1.7, 0.35, 0.3)])


SPECIES = (
    Species(
        1.85, 0.27, _broad_clumps, _broad_wood,
        (Growth(92, 0.098, width=0.64), Growth(34, 0.168, width=0.64), Growth(9, 0.31, 0.6)),
    ),
    Species(
        2.55, 0.08, _spruce_clumps, _spruce_wood,
        (
            Growth(22, 0.16, 0.0, 0.4, 1.0, 0.45, 0.25),
            Growth(9, 0.25, 0.0, 0.45, 1.0, 0.45, 0.25),
            Growth(3, 0.4, 0.0, 0.55, 1.0, 0.4, 0.25),
        ),
    ),
    Species(
        3.35, 0.1, _poplar_clumps, _poplar_wood,
        (
            Growth(100, 0.15, 0.0, 0.5, 0.5, 0.6, -0.7),
            Growth(38, 0.25, 0.0, 0.5, 0.5, 0.6, -0.7),
            Growth(11, 0.42, 0.6, 0.5, 0.5, 0.6, -0.7),
        ),
    ),
    Species(
        2.25, 0.2, _birch_clumps, _birch_wood,
        (
            Growth(80, 0.085, 0.0, 0.55, 0.4, 0.7, 0.6),
            Growth(34, 0.135, 0.0, 0.55, 0.4, 0.7, 0.6),
            Growth(8, 0.28, 0.0, 0.55, 0.4, 0.7, 0.6),
        ),
        _BIRCH_BARK,
    ),
    Species(
        2.1, 0.5, _pine_clumps, _pine_wood,
        (
            Growth(90, 0.1, 0.0, 0.36, 0.8, 0.6, -0.2),
            Growth(40, 0.18, 0.0, 0.35, 0.8, 0.6, -0.2),
            Growth(11, 0.28, 0.55, 0.45, 0.8, 0.6, -0.2),
        ),
    ),
)  # fmt: skip
"""Lime or plane, spruce, poplar, birch, pine."""
