"""A facade: a vertical plane with its own coordinates, and the quadrilaterals of openings and mouldings.

Seen from the front of the facade, u points to the right, d towards the viewer and z up; all in metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Vec
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.vectors import Array

Quad = tuple[Vec, ...]


def surface(slot: str, pattern: Pattern) -> Surface:
    """Return a surface of a building."""
    return Surface(slot, pattern, Tag.BUILDINGS)


@dataclass(frozen=True)
class Facade:
    """A vertical plane: the position of u = 0, and the directions of u and d on the ground plan."""

    origin: tuple[float, float]
    right: tuple[int, int]
    out: tuple[int, int]
    width: float
    key: int  # makes the window numbers of different facades different

    def at(self, u: float, d: float, z: float) -> tuple[float, float, float]:
        """Convert facade coordinates to a point in the body's frame."""
        return (
            self.origin[0] + u * self.right[0] + d * self.out[0],
            self.origin[1] + u * self.right[1] + d * self.out[1],
            z,
        )

    def face(self, u0: float, u1: float, z0: float, z1: float, d: float = 0.0) -> Quad:
        """Return a rectangle that faces outwards."""
        return self.at(u0, d, z0), self.at(u1, d, z0), self.at(u1, d, z1), self.at(u0, d, z1)

    def top(self, u: Vec, d: Vec, z: float) -> Quad:
        """Return a horizontal rectangle that faces up."""
        (u0, u1), (d0, d1) = u, d
        return self.at(u0, d1, z), self.at(u1, d1, z), self.at(u1, d0, z), self.at(u0, d0, z)

    def side(self, u: float, d: Vec, z: Vec, sign: int) -> Quad:
        """Return a vertical rectangle perpendicular to the facade that faces along +u (sign 1) or -u (sign -1)."""
        (d0, d1), (z0, z1) = d, z
        quad = (self.at(u, d0, z0), self.at(u, d1, z0), self.at(u, d1, z1), self.at(u, d0, z1))
        return quad if sign < 0 else quad[::-1]

    def block(self, u: Vec, d: Vec, z: Vec, sides: bool = True, top: bool = True) -> list[Quad]:
        """Return a projecting box: front, underside and, optionally, top and both sides; no back."""
        (u0, u1), (_, d1), (z0, z1) = u, d, z
        quads = [self.face(u0, u1, z0, z1, d1), self.top(u, d, z0)[::-1]]
        if top:
            quads.append(self.top(u, d, z1))
        if sides:
            quads += [self.side(u0, d, z, -1), self.side(u1, d, z, 1)]
        return quads

    def recess(self, u: Vec, z: Vec, depth: float, floor: bool = True) -> list[Quad]:
        """Return the reveals of an opening: both sides, the top and, optionally, the floor."""
        (u0, u1), (z0, z1), d = u, z, (-depth, 0.0)
        quads = [self.side(u0, d, z, 1), self.side(u1, d, z, -1), self.top(u, d, z1)[::-1]]
        if floor:
            quads.append(self.top(u, d, z0))
        return quads


def around(depth: float, width: float, key: int) -> tuple[Facade, Facade, Facade, Facade]:
    """Return front, left, right and back of a block from x = 0 back to -depth, left and right seen from inside."""
    half = width / 2
    return (
        Facade((0.0, -half), (0, 1), (1, 0), width, key),
        Facade((0.0, half), (-1, 0), (0, 1), depth, key + 5),
        Facade((-depth, -half), (1, 0), (0, -1), depth, key + 9),
        Facade((-depth, half), (0, -1), (-1, 0), width, key),
    )


def pane_uv(names: list[tuple[int, int]]) -> Array:
    """Return the uv of window panes: the integer part is the window's number, the fraction the position in the pane."""
    corner = np.array([(0.001, 0.001), (0.999, 0.001), (0.999, 0.999), (0.001, 0.999)])
    names_and_corners: Array = np.array(names, np.float64)[:, None, :] + corner[None]
    return names_and_corners


@dataclass(frozen=True)
class Hole:
    """An opening in a facade."""

    u0: float
    u1: float
    z0: float
    z1: float


def pierced(f: Facade, low: float, high: float, holes: Sequence[Hole]) -> list[Quad]:
    """Return the wall of one floor around its openings.

    Args:
        f: The facade.
        low: Lower edge of the wall, metres.
        high: Upper edge of the wall, metres.
        holes: Openings from left to right. Neighbours with the same sill and lintel share the strips below and above.
    """
    edge, quads = 0.0, []
    even = len({(h.z0, h.z1) for h in holes}) == 1
    bottom, top = (holes[0].z0, holes[0].z1) if even else (low, high)
    if even and bottom > low:
        quads.append(f.face(0.0, f.width, low, bottom))
    if even and top < high:
        quads.append(f.face(0.0, f.width, top, high))
    for h in holes:
        if h.u0 > edge:
            quads.append(f.face(edge, h.u0, bottom, top))
        if h.z0 > bottom:
            quads.append(f.face(h.u0, h.u1, bottom, h.z0))
        if h.z1 < top:
            quads.append(f.face(h.u0, h.u1, h.z1, top))
        edge = h.u1
    if edge < f.width:
        quads.append(f.face(edge, f.width, bottom, top))
    return quads


_SIDE, _ABOVE, _BELOW = (1.0, 0.0, 0.0, 1.0), (1.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 1.0)


def niches(f: Facade, holes: Iterable[Hole], depth: float, floor: bool = True) -> tuple[Array, Array]:
    """Return the reveals of openings and their uv for `Pattern.NICHE`; without `floor`, a sill replaces the floor."""
    quads, deep = [], []
    for h in holes:
        quads += f.recess((h.u0, h.u1), (h.z0, h.z1), depth, floor=floor)
        deep += [_SIDE, _SIDE, _ABOVE] + [_BELOW] * floor
    v = np.array(deep).reshape(-1, 4)
    return np.array(quads).reshape(-1, 4, 3), np.stack([np.zeros_like(v), v], axis=-1)
