"""Chunks: triangles that are culled together. Those of a chunk belong to one level of an object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.meshes.mesh import Level, Mesh
from recipe_runtime.render.device.arrays import set_fields
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.level_range import LevelRange

CHUNK = 64  # triangles of a chunk, at most
_ENDLESS = 1.0e18  # metres: its square is finite in float32


def by_level(mesh: Mesh) -> Mesh:
    """Return the mesh with its triangles ordered by level, which otherwise keep their order."""
    if mesh.level is None:
        return mesh
    order = np.argsort(mesh.level, kind="stable")
    return replace(mesh, triangles=mesh.triangles[order], surface=mesh.surface[order], level=mesh.level[order])


def chunk_starts(mesh: Mesh) -> NDArray[np.int32]:
    """Return the first triangle of each chunk of a mesh, whose triangles are ordered by level."""
    count = len(mesh.triangles)
    runs = np.zeros(1, np.int64) if mesh.level is None else np.flatnonzero(np.diff(mesh.level, prepend=-2))
    ends = np.append(runs[1:], count)
    return np.concatenate([np.arange(a, b, CHUNK, dtype=np.int32) for a, b in zip(runs, ends, strict=True)])


def level_casts(mesh: Mesh) -> NDArray[np.int32]:
    """Return for each triangle 1 if its level casts a shadow, otherwise 0."""
    if mesh.level is None:
        return np.ones(len(mesh.triangles), np.int32)
    casts = np.array([*(level.casts for level in mesh.levels), True], np.int32)
    found: NDArray[np.int32] = casts[mesh.level]
    return found


def level_range(level: Level, base: int) -> LevelRange:
    """Return the struct of a level of a body whose base part is `base`: 0 for the world, 1 + p for part p."""
    near, far = level.near, min(level.far, _ENDLESS)
    return set_fields(LevelRange(), part=base, anchor=wp.vec3f(*level.anchor), near=near * near, far=far * far)
