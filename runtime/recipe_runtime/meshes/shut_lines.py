"""Where the paint of a vehicle has shut lines, and the uv by which `render/texture/vehicle.py` draws them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.mesh import Mesh, Pattern
from recipe_runtime.meshes.vectors import Array, cross, unit

_MIDDLE = 80.0  # added to the places of lines, so that they differ from lengths
_NONE = 99.0
_CELL = 0.17  # width of a reflector in a lamp, metres
_LAMPS = (Pattern.HEADLIGHT, Pattern.TAILLIGHT, Pattern.LENS, Pattern.BRAKELIGHT, Pattern.INDICATOR,
          Pattern.REVERSELIGHT)  # fmt: skip


@dataclass(frozen=True)
class Edges:
    """What the lines of a shell follow, metres."""

    half: float
    arches: tuple[float, float]  # x of the rear edge of the rear arches and of the front edge of the front ones
    doors: tuple[float, ...]  # x of the edges of doors, ascending
    lids: tuple[float, float]  # x of the foot of the rear screen and of the windscreen
    ends: tuple[float, float]  # x of the tail and the nose
    sill: float  # height of the lower edge of doors
    split: float  # height of the upper edge of bumpers


class ShutLines:
    """The shut lines of a shell: x of an upright one, and z (on flat parts: |y|) of a level one."""

    def __init__(self, edges: Edges) -> None:
        self._of = edges

    def at(self, x: float, z: float, flat: bool) -> tuple[float, float]:
        """Return the lines nearest to a place, `_NONE` if there is none."""
        of = self._of
        if flat:
            return self._lid(x)
        if of.doors and of.doors[0] - 0.1 < x < of.doors[-1] + 0.1:
            line = min(of.doors, key=lambda door: abs(door - x))
            return line, of.sill if of.doors[0] < x < of.doors[-1] else _NONE
        if x > of.arches[1] or x < of.arches[0]:
            return _NONE, of.split
        return _NONE, _NONE

    def _lid(self, x: float) -> tuple[float, float]:
        """Return the edges of bonnet and boot."""
        of = self._of
        for sign, foot, end in ((1.0, of.lids[1], of.ends[1]), (-1.0, of.lids[0], of.ends[0])):
            deep = sign * (end - foot)
            if deep > 0.3 and sign * (x - foot) > -0.02:
                return foot - 0.05 if sign < 0 else _NONE, 0.8 * of.half
        return _NONE, _NONE


def marked(b: Builder, mesh: Mesh, lines: ShutLines, glass: tuple[float, float]) -> None:
    """Add a shell to a builder, with the uv of its paint, its glass (`glass`, for all of it) and its lamps."""
    points = mesh.vertices[mesh.triangles].astype(np.float64)
    normals = mesh.normals[mesh.triangles].astype(np.float64)
    uvs = mesh.uvs[mesh.triangles].astype(np.float64)
    middle = (points[:, 0] + points[:, 1] + points[:, 2]) / 3.0
    face = unit(cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]))
    for number, surface in enumerate(mesh.surfaces):
        mine = np.flatnonzero(mesh.surface == number)
        if surface.pattern == Pattern.CAR_PAINT:
            found = [lines.at(x, z, abs(n) > 0.75) for (x, _, z), n in zip(middle[mine], face[mine, 2], strict=True)]
            uvs[mine] = np.array(found)[:, None, :] + _MIDDLE
        elif surface.pattern == Pattern.CABIN:
            uvs[mine] = np.array(glass)
        elif surface.pattern in _LAMPS:
            uvs[mine] = _lamp_uv(points[mine], face[mine])
        index = np.arange(3 * len(mine), dtype=np.int64).reshape(-1, 3)
        b.add(surface, points[mine].reshape(-1, 3), normals[mine].reshape(-1, 3), uvs[mine].reshape(-1, 2), index)


def _lamp_uv(points: Array, face: Array) -> Array:
    """Return the place in reflectors side by side, over the height of each group of lamps at one end."""
    uv = np.zeros((*points.shape[:2], 2))
    ends = points[:, 0, 0] > 0.0
    for end in (True, False):
        mine = ends == end
        if mine.any():
            low, high = points[mine, :, 2].min(), points[mine, :, 2].max()
            ahead = np.abs(face[mine, 0]) > 0.6
            along = np.where(ahead[:, None], np.abs(points[mine, :, 1]), points[mine, :, 0])
            uv[mine] = np.stack([along / _CELL, 0.02 + 0.96 * (points[mine, :, 2] - low) / (high - low)], axis=-1)
    return uv
