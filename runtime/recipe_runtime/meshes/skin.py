"""Skins: continuous surfaces whose vertices follow several parts of an actor (linear blend skinning)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.body.skeleton import Joint
from recipe_runtime.meshes.mesh import NO_MESH, Mesh, Skin
from recipe_runtime.meshes.vectors import Array, Index

MAX_INFLUENCES = 4
FULL = 255  # sum of the weights of a vertex


class Influences(NamedTuple):
    """The parts that N points of a skin follow; equal weights follow from any scale."""

    parts: Index  # [N, K], K up to 4: indices of parts in the order of the Trace, 0 for the base part
    weights: Array  # [N, K], at least 0, with a positive sum


def skin_of(influences: Influences, joints: Sequence[Joint]) -> Skin:
    """Return a skin with weights in 255ths, by largest remainders, the strongest influence of a vertex first.

    Args:
        influences: Of all vertices.
        joints: The actor's joints, parents first.
    """
    parts, weights = _padded(influences)
    order = np.argsort(-weights, axis=1, kind="stable")
    parts, weights = np.take_along_axis(parts, order, axis=1), np.take_along_axis(weights, order, axis=1)
    total = ((weights[:, 0] + weights[:, 1]) + weights[:, 2]) + weights[:, 3]
    share = weights * FULL / total[:, None]
    whole = np.floor(share)
    rest = FULL - whole.astype(np.int64).sum(axis=1)
    rank = np.argsort(np.argsort(whole - share, axis=1, kind="stable"), axis=1, kind="stable")
    whole += rank < rest[:, None]
    origins, parents = rest_pose(joints)
    return Skin(parts.astype(np.int32), whole.astype(np.uint8), origins, parents)


def joined(influences: Sequence[Influences | None], counts: Sequence[int]) -> Influences:
    """Return the influences of several sets of points, of `counts` points each; None: the base part."""
    rows = [
        _padded(Influences(np.zeros((n, 1), np.int64), np.ones((n, 1))) if i is None else i)
        for i, n in zip(influences, counts, strict=True)
    ]
    return Influences(np.concatenate([parts for parts, _ in rows]), np.concatenate([weights for _, weights in rows]))


def rest_pose(joints: Sequence[Joint]) -> tuple[Array, tuple[int, ...]]:
    """Return the origins of an actor's parts at rest, [P, 3] in the frame of the base part, and their parents."""
    numbers = {joints[0].parent: 0}
    origins, parents = [(0.0, 0.0, 0.0)], [-1]
    for joint in joints:
        parent = numbers[joint.parent]
        (x, y, z), (dx, dy, dz) = origins[parent], joint.offset
        numbers[joint.part] = len(origins)
        origins.append((x + dx, y + dy, z + dz))
        parents.append(parent)
    return np.array(origins), tuple(parents)


def split_parts(parts: Sequence[tuple[str, Mesh]]) -> tuple[tuple[str, Mesh], ...]:
    """Return the meshes of a body with its skin cut into rigid parts, each triangle in the frame of its main part.

    Without a skin, these are the parts themselves.
    """
    base = parts[0][1]
    if base.skin is None:
        return tuple(parts)
    owner = base.skin.parts[base.triangles[:, 0], 0]
    cut = []
    for number, (name, mesh) in enumerate(parts):
        own = np.flatnonzero(owner == number)
        used, triangles = np.unique(base.triangles[own], return_inverse=True)
        piece = replace(
            base,
            vertices=(base.vertices[used] - base.skin.origins[number]).astype(np.float32),
            normals=base.normals[used],
            uvs=base.uvs[used],
            triangles=triangles.reshape(-1, 3).astype(np.int32),
            surface=base.surface[own],
            level=None if base.level is None else base.level[own],
            lights=(),
            skin=None,
        )
        cut.append((name, piece if mesh is base or not len(mesh.triangles) else _merged(piece, mesh)))
    return tuple(cut)


@dataclass(frozen=True)
class BodyVertices:
    """The distinct vertices of a body: which parts each follows, by which share, and where it is in their frames."""

    owners: NDArray[np.intp]  # [K, V]
    shares: Array  # [K, V], sum 1
    places: Array  # [K, 3, V] metres

    @classmethod
    def of(cls, parts: Sequence[tuple[str, Mesh]]) -> BodyVertices:
        """Return the vertices of a body's parts that near cameras see."""
        count = 1 if parts[0][1].skin is None else MAX_INFLUENCES
        rows = []
        for number, (_, mesh) in enumerate(parts):
            used = mesh.seen_near_by()
            places = np.repeat(mesh.vertices[used].astype(np.float64)[:, None], count, axis=1)
            if mesh.skin is None:
                owners, shares = np.full(places.shape[:2], number), np.zeros(places.shape[:2])
                shares[:, 0] = 1.0
            else:
                skin = mesh.skin
                owners, shares = _padded(Influences(skin.parts[used].astype(np.int64), skin.weights[used] / FULL))
                places = places - skin.origins[owners]
            rows.append(np.concatenate([owners, shares, places.reshape(len(used), 3 * count)], axis=1))
        table = np.unique(np.concatenate(rows), axis=0)
        places = table[:, 2 * count :].reshape(-1, count, 3)
        ordered = np.ascontiguousarray(places.transpose(1, 2, 0))
        return cls(table[:, :count].T.astype(np.intp), np.ascontiguousarray(table[:, count : 2 * count].T), ordered)

    def placed(self, transforms: Array) -> Array:
        """Return the vertices [3, V] after a transform for each part, [P, 3, 4]."""
        rows = transforms.reshape(-1, 12).T
        total = np.zeros((3, self.owners.shape[1]))
        for owners, shares, (x, y, z) in zip(self.owners, self.shares, self.places, strict=True):
            t = np.take(rows, owners, axis=1).reshape(3, 4, -1)
            total += (t[:, 0] * x + t[:, 1] * y + t[:, 2] * z + t[:, 3]) * shares
        return total


def _padded(influences: Influences) -> tuple[NDArray[np.int64], Array]:
    """Return parts and weights with MAX_INFLUENCES columns; the further ones have a weight of 0."""
    parts, weights = influences.parts.astype(np.int64), influences.weights.astype(np.float64)
    missing = MAX_INFLUENCES - parts.shape[1]
    first = np.repeat(parts[:, :1], missing, axis=1)
    return np.concatenate([parts, first], axis=1), np.pad(weights, ((0, 0), (0, missing)))


def _merged(a: Mesh, b: Mesh) -> Mesh:
    """Return the triangles of two meshes in one frame, without their lights and levels."""
    surfaces = tuple(dict.fromkeys([*a.surfaces, *b.surfaces]))
    numbers = [np.array([surfaces.index(s) for s in mesh.surfaces], np.int32)[mesh.surface] for mesh in (a, b)]
    return replace(
        NO_MESH,
        vertices=np.concatenate([a.vertices, b.vertices]),
        normals=np.concatenate([a.normals, b.normals]),
        uvs=np.concatenate([a.uvs, b.uvs]),
        triangles=np.concatenate([a.triangles, b.triangles + np.int32(len(a.vertices))]),
        surface=np.concatenate(numbers),
        surfaces=surfaces,
    )
