"""Chunks: triangles that are culled together. Those of a chunk have one level and one main part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.meshes.mesh import Level, Mesh, Skin
from recipe_runtime.render.device.arrays import set_fields
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.level_range import LevelRange

CHUNK = 64  # triangles of a chunk, at most
_ENDLESS = 1.0e18  # metres: its square is finite in float32


@dataclass(frozen=True)
class Chunks:
    """The chunks of a mesh. Boxes are in the frame of the chunk's part; wherever joints turn, they contain a skin."""

    starts: NDArray[np.int32]  # [C] first triangle
    sizes: NDArray[np.int32]  # [C] triangles
    part: NDArray[np.int32]  # [C] index among the actor's parts; 0 without a skin
    level: NDArray[np.int32]  # [C] index into the mesh's levels, or -1
    low: NDArray[np.float32]  # [C, 3]
    high: NDArray[np.float32]  # [C, 3]


def in_order(mesh: Mesh) -> Mesh:
    """Return the mesh with its triangles ordered by level and part, which otherwise keep their order."""
    if mesh.level is None and mesh.skin is None:
        return mesh
    order = np.lexsort((_main_part(mesh), _level(mesh)))  # stable
    level = None if mesh.level is None else mesh.level[order]
    return replace(mesh, triangles=mesh.triangles[order], surface=mesh.surface[order], level=level)


def chunks_of(mesh: Mesh) -> Chunks:
    """Return the chunks of a mesh whose triangles are `in_order`."""
    count, level, part = len(mesh.triangles), _level(mesh), _main_part(mesh)
    changes = (np.diff(level, prepend=-2) != 0) | (np.diff(part, prepend=-1) != 0)
    runs = np.flatnonzero(changes)
    spans = zip(runs, np.append(runs[1:], count), strict=True)
    starts = np.concatenate([np.arange(a, b, CHUNK, dtype=np.int32) for a, b in spans])
    corners = mesh.vertices.astype(np.float32)[mesh.triangles]
    slack: NDArray[np.float32] = np.zeros((len(starts), 1), np.float32)
    if mesh.skin is not None:
        corners = (corners - mesh.skin.origins[part][:, None]).astype(np.float32)
        slack = np.maximum.reduceat(_slack(mesh, mesh.skin, part), starts)[:, None]
    return Chunks(
        starts,
        np.diff(starts, append=np.int32(count)),
        part[starts],
        level[starts],
        np.minimum.reduceat(np.minimum.reduce([*corners.swapaxes(0, 1)]), starts, axis=0) - slack,
        np.maximum.reduceat(np.maximum.reduce([*corners.swapaxes(0, 1)]), starts, axis=0) + slack,
    )


def level_casts(mesh: Mesh) -> NDArray[np.int32]:
    """Return for each triangle 1 if its level casts a shadow, otherwise 0."""
    casts = np.array([*(level.casts for level in mesh.levels), True], np.int32)
    found: NDArray[np.int32] = casts[_level(mesh)]
    return found


def level_range(level: Level, base: int) -> LevelRange:
    """Return the struct of a level of a body whose base part is `base`: 0 for the world, 1 + p for part p."""
    near, far = level.near, min(level.far, _ENDLESS)
    return set_fields(LevelRange(), part=base, anchor=wp.vec3f(*level.anchor), near=near * near, far=far * far)


def _level(mesh: Mesh) -> NDArray[np.int32]:
    """Return the level of each triangle, -1 for none."""
    return np.full(len(mesh.triangles), -1, np.int32) if mesh.level is None else mesh.level


def _main_part(mesh: Mesh) -> NDArray[np.int32]:
    """Return the part that each triangle follows most, an index among the actor's parts: that of its first corner."""
    if mesh.skin is None:
        return np.zeros(len(mesh.triangles), np.int32)
    found: NDArray[np.int32] = mesh.skin.parts[mesh.triangles[:, 0], 0]
    return found


def _slack(mesh: Mesh, skin: Skin, part: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return how far a triangle's corners may be from where its main part alone would move them, metres [T].

    Two parts that share a joint place a point at most twice its distance from the joint apart, however they turn;
    parts that several joints connect, at most the sum over these joints.
    """
    corners = mesh.triangles.astype(np.int64)  # [T, 3]
    apart = np.stack([_distance(mesh.vertices, joint) for joint in skin.origins]) * 2.0  # [P, V]
    between = _joints_between(skin.parents)  # [P, P, P]
    total = np.zeros(corners.shape)
    for k in range(skin.parts.shape[1]):
        other, share = skin.parts[corners, k], skin.weights[corners, k] / 255.0
        rows = np.nonzero((other != part[:, None]) & (share > 0.0))
        own, follows, vertex = part[rows[0]], other[rows], corners[rows]
        for joint in range(len(skin.parents)):
            total[rows] += between[own, follows, joint] * apart[joint, vertex] * share[rows]
    found: NDArray[np.float32] = total.max(axis=1).astype(np.float32)
    return found


def _distance(vertices: NDArray[np.float32], point: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = (vertices[:, axis] - point[axis] for axis in range(3))
    found: NDArray[np.float64] = np.sqrt(x * x + y * y + z * z)
    return found


def _joints_between(parents: tuple[int, ...]) -> NDArray[np.float64]:
    """Return 1 for each joint on the way from one part to another, [P, P, joint]; joints have the numbers of parts."""
    count = len(parents)
    above = np.zeros((count, count), np.int64)  # [part, joint]: the joints between a part and the base
    for part, parent in enumerate(parents):
        if parent >= 0:
            above[part] = above[parent]
            above[part, part] = 1
    between: NDArray[np.float64] = (above[:, None] != above[None]).astype(np.float64)
    return between
