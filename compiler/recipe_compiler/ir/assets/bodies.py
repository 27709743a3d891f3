"""Bodies of actors in glTF files: triangles whose vertices follow nodes, rigidly or by the weights of a skin.

Vertices are where the nodes of the file place them, which for a skin is its bind pose or any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recipe_compiler.ir.assets import gltf
from recipe_compiler.ir.assets.geometry import AssetError, Floats, MeshData, Raw, check_count, finish
from recipe_compiler.ir.assets.matrices import IDENTITY, Matrix, composed, moved, turned

MAX_BONES = 512
_NAME_LENGTH = 100  # characters that count
_MAX_SCALE = 1e6


@dataclass(frozen=True)
class Node:
    """A node of a file: its name, its parent (-1: none), and its position with x forward, y left, z up."""

    name: str
    parent: int
    position: tuple[float, float, float]


@dataclass(frozen=True)
class BodyData:
    """A body in the file's own unit; the parts of the mesh have `follows`, which names nodes by number."""

    mesh: MeshData
    nodes: Mapping[int, Node]


def read(content: bytes) -> BodyData:
    """Return the body in a glTF file.

    Raises:
        AssetError: the file is invalid.
        LookupError: and similar errors, for absent entries of the file.
    """
    document, nodes = gltf.opened(content), gltf.Nodes()
    placed = list(document.placed(nodes))
    gltf.check_counts(document, [mesh for mesh, _, _ in placed])
    raws: list[Raw] = []
    for mesh, matrix, number in placed:
        skin = document.item("nodes", number).get("skin")
        if skin is None:
            raws += [_rigid(raw, number) for raw in document.parts(mesh, matrix)]
        else:
            raws += _skinned(document, mesh, skin, nodes)
    gltf.check_images(document, raws, len(content))
    return BodyData(finish(raws, "y"), {number: _node(document, number, nodes) for number in nodes})


def _node(document: gltf.Document, number: int, nodes: gltf.Nodes) -> Node:
    parent, matrix = nodes[number]
    x, y, z = (row[3] for row in matrix)
    return Node(str(document.item("nodes", number).get("name", ""))[:_NAME_LENGTH], parent, (z, x, y))


def _rigid(raw: Raw, number: int) -> Raw:
    follows = np.zeros((len(raw.vertices), 8))
    follows[:, :4], follows[:, 4] = number, 1.0
    return _with(raw, raw.vertices, raw.normals, follows)


def _skinned(document: gltf.Document, mesh: int, skin: object, nodes: gltf.Nodes) -> list[Raw]:
    """Return the parts of a mesh with a skin, placed by its bones."""
    bones, matrices = _bones(document, skin, nodes)
    found = []
    for raw, attributes in zip(document.parts(mesh, IDENTITY), document.attributes(mesh), strict=True):
        if "JOINTS_1" in attributes:
            raise AssetError("has vertices that follow more than four bones; export it with at most four")
        if "JOINTS_0" not in attributes or "WEIGHTS_0" not in attributes:
            raise AssetError("has a skin without bones and weights for all its vertices; export it again")
        joints = document.array(attributes["JOINTS_0"])
        weights = document.floats(attributes["WEIGHTS_0"], 4)
        follows = _follows(len(raw.vertices), joints, weights, bones)
        vertices, normals = np.zeros_like(raw.vertices), None if raw.normals is None else np.zeros_like(raw.normals)
        for place, bone in enumerate(bones):
            matrix = matrices[place]
            for k in range(4):
                rows = np.flatnonzero((follows[:, k] == bone) & (follows[:, 4 + k] > 0.0))
                if not len(rows):
                    continue
                share = follows[rows, 4 + k, None]
                vertices[rows] += moved(raw.vertices[rows], matrix) * share
                if normals is not None and raw.normals is not None:
                    normals[rows] += turned(raw.normals[rows], matrix) * share
        found.append(_with(raw, vertices, normals, follows))
    return found


def _bones(document: gltf.Document, skin: object, nodes: gltf.Nodes) -> tuple[Sequence[int], Sequence[Matrix]]:
    """Return the bones of a skin, and the transform of each from the mesh's space to the scene's."""
    entry = document.item("skins", skin)
    bones = entry.get("joints")
    if not isinstance(bones, list) or not bones or any(type(bone) is not int or bone not in nodes for bone in bones):
        raise AssetError("has a skin whose bones are not in its scene; export it again")
    check_count(len(bones), "bones", MAX_BONES)
    if len(set(bones)) != len(bones):
        raise AssetError("has a skin that lists a bone twice; export it again")
    inverse = [IDENTITY] * len(bones)
    if "inverseBindMatrices" in entry:
        rows = document.floats(entry["inverseBindMatrices"], 16)
        if len(rows) < len(bones) or not (np.abs(rows) <= _MAX_SCALE).all():
            raise AssetError("has a skin without a valid bind matrix for each bone; export it again")
        inverse = [gltf.matrix_of(row.tolist()) for row in rows[: len(bones)]]
    return bones, [composed(nodes[bone][1], own) for bone, own in zip(bones, inverse, strict=True)]


def _follows(count: int, joints: NDArray[np.generic], weights: Floats, bones: Sequence[int]) -> Floats:
    """Return the nodes and weights of vertices, [V, 8]."""
    if joints.shape != (count, 4) or weights.shape != (count, 4) or joints.dtype.kind != "u":
        raise AssetError("has a skin whose bones or weights do not fit its vertices; export it again")
    if not (np.isfinite(weights).all() and (weights >= 0.0).all() and (weights <= 1e6).all()):
        raise AssetError("has a skin with invalid weights; export it again")
    total = ((weights[:, 0] + weights[:, 1]) + weights[:, 2]) + weights[:, 3]
    if not (total > 1e-6).all():
        raise AssetError("has vertices that follow no bone; give each a weight, then export it again")
    places = np.where(weights > 0.0, joints.astype(np.int64), 0)
    if int(places.max()) >= len(bones):
        raise AssetError("names a bone that its skin does not have; export it again")
    return np.concatenate([np.array(bones, np.float64)[places], weights / total[:, None]], axis=1)


def _with(raw: Raw, vertices: Floats, normals: Floats | None, follows: Floats) -> Raw:
    rest = raw.colour, raw.picture, raw.repeat, raw.both_sides
    return Raw(raw.slot, vertices, raw.triangles, normals, raw.uvs, *rest, follows)
