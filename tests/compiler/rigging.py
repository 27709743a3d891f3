"""Small glTF files of a person and a vehicle for tests, built from boxes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.compiler.modelling import glb, picture, png

HEIGHT = 1.8  # metres
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip

# In the file's frame, metres: x to the person's left, y up, z forward; each with the end of its box. Arms are level.
BONES: dict[str, tuple[str, tuple[float, float, float], tuple[float, float, float]]] = {
    "Hips": ("", (0, 0.98, 0), (0, 1.08, 0)),
    "Spine": ("Hips", (0, 1.08, 0), (0, 1.5, 0)),
    "Neck": ("Spine", (0, 1.5, 0), (0, 1.8, 0)),
}
for _side, _x in (("Left", 1.0), ("Right", -1.0)):
    BONES |= {
        f"{_side}Arm": ("Spine", (_x * 0.18, 1.44, 0), (_x * 0.47, 1.44, 0)),
        f"{_side}ForeArm": (f"{_side}Arm", (_x * 0.47, 1.44, 0), (_x * 0.72, 1.44, 0)),
        f"{_side}Hand": (f"{_side}ForeArm", (_x * 0.72, 1.44, 0), (_x * 0.9, 1.44, 0)),
        f"{_side}UpLeg": ("Hips", (_x * 0.09, 0.93, 0), (_x * 0.09, 0.5, 0)),
        f"{_side}Leg": (f"{_side}UpLeg", (_x * 0.09, 0.5, 0), (_x * 0.09, 0.08, 0)),
        f"{_side}Foot": (f"{_side}Leg", (_x * 0.09, 0.08, 0), (_x * 0.09, 0.0, 0.18)),
    }
WHEELS = {"wheel_front_left": (0.75, 1.4), "wheel_front_right": (-0.75, 1.4), "wheel_rear_left": (0.75, -1.3),
          "wheel_rear_right": (-0.75, -1.3)}  # fmt: skip
RADIUS = 0.33


def box(low: Any, high: Any) -> NDArray[np.float64]:
    """Return the corners of a box, [8, 3]."""
    low, high = np.minimum(low, high), np.maximum(low, high)
    found: NDArray[np.float64] = low + CORNERS * (high - low)
    return found


class File:
    """A glTF file under construction."""

    def __init__(self) -> None:
        self.body = b""
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def put(self, values: bytes) -> int:
        views = self.document["bufferViews"]
        views.append({"buffer": 0, "byteOffset": len(self.body), "byteLength": len(values)})
        self.body += values + bytes(-len(values) % 4)
        return len(views) - 1

    def column(self, values: NDArray[Any], kind: str, component: int, code: str) -> int:
        view = self.put(values.astype(code).tobytes())
        accessors = self.document["accessors"]
        accessors.append({"bufferView": view, "componentType": component, "count": len(values), "type": kind})
        return len(accessors) - 1

    def content(self) -> bytes:
        self.document["buffers"] = [{"byteLength": len(self.body)}]
        return glb(self.document, self.body)


def person(
    *,
    scale: float = 1.0,
    rename: Mapping[str, str] | None = None,
    places: Mapping[str, tuple[float, float, float]] | None = None,
    prefix: str = "mixamorig:",
    weights: Any = None,
    changes: Mapping[str, Any] | None = None,
    bind_scale: float = 1.0,
) -> bytes:
    """Return a person with level arms: a box along each bone, which its own bone moves, and its parent near its start.

    Args:
        scale: units of the file in a metre.
        rename: other names of bones; an empty one leaves the name out.
        places: other positions of bones, metres.
        prefix: of the names of bones.
        weights: in place of the weights of all vertices, [V, 4].
        changes: other sections of the document.
        bind_scale: units of the mesh in a unit of the bones, as exporters of centimetres write it.
    """
    file, names = File(), list(BONES)
    at = {name: np.array((places or {}).get(name, start)) * scale for name, (_, start, _) in BONES.items()}
    points, joints, shares = [], [], []
    for number, (name, (parent, start, end)) in enumerate(BONES.items()):
        wide = 0.06 if "Arm" in name or "Hand" in name or "Leg" in name or "Foot" in name else 0.12
        along = np.abs(np.array(end) - start) > 1e-9
        out = np.where(along, 0.0, wide)
        corners = box(np.array(start) - out, np.array(end) + out) * scale
        points.append(corners)
        nearer = np.linalg.norm(corners - at[name], axis=1) < np.linalg.norm(corners - np.array(end) * scale, axis=1)
        above = names.index(parent) if parent else number
        joints.append(np.tile([number, above, 0, 0], (8, 1)))
        shares.append(np.where(nearer[:, None], [0.75, 0.25, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]))
        own = (rename or {}).get(name, name)
        offset = at[name] - (at[parent] if parent else 0.0)
        children = [k for k, other in enumerate(names) if BONES[other][0] == name]
        node = {"name": prefix + own if own else "", "translation": offset.tolist()}
        file.document["nodes"].append(node | ({"children": children} if children else {}))
    rows = np.concatenate(points)
    triangles = np.concatenate([SIDES + 8 * k for k in range(len(names))])
    attributes = {
        "POSITION": file.column(rows * bind_scale, "VEC3", 5126, "<f4"),
        "JOINTS_0": file.column(np.concatenate(joints), "VEC4", 5121, "<u1"),
        "WEIGHTS_0": file.column(np.concatenate(shares) if weights is None else weights, "VEC4", 5126, "<f4"),
        "TEXCOORD_0": file.column(np.abs(rows[:, :2]) / scale, "VEC2", 5126, "<f4"),
    }
    indices = file.column(triangles.reshape(-1), "SCALAR", 5125, "<u4")
    inverse = np.tile(np.diag([1 / bind_scale] * 3 + [1.0]), (len(names), 1, 1))
    inverse[:, 3, :3] = [-at[name] for name in names]
    file.document["meshes"] = [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}]
    bind = file.column(inverse.reshape(-1, 16), "MAT4", 5126, "<f4")
    file.document["skins"] = [{"joints": list(range(len(names))), "inverseBindMatrices": bind}]
    file.document["nodes"].append({"name": "body", "mesh": 0, "skin": 0})
    file.document["scenes"] = [{"nodes": [0, len(names)]}]
    file.document["images"] = [{"bufferView": file.put(png(picture())), "mimeType": "image/png"}]
    file.document["textures"] = [{"source": 0}]
    file.document["materials"] = [{"name": "cloth", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    file.document |= dict(changes or {})
    return file.content()


def vehicle(
    *, scale: float = 1.0, rename: Mapping[str, str] | None = None, backwards: bool = False, radius: float = RADIUS
) -> bytes:
    """Return a vehicle 4.5 m long whose wheels are nodes, with a hub in a node below each.

    Args:
        scale: units of the file in a metre.
        rename: other names of the nodes of wheels.
        backwards: whether it looks along -z.
        radius: of the rear wheels, metres.
    """
    file, turn = File(), -1.0 if backwards else 1.0

    def node(name: str, low: Any, high: Any, at: Any = (0, 0, 0), children: tuple[int, ...] = ()) -> int:
        corners = box(low, high) * scale
        attributes = {"POSITION": file.column(corners, "VEC3", 5126, "<f4")}
        indices = file.column(SIDES.reshape(-1), "SCALAR", 5125, "<u4")
        meshes, nodes = file.document["meshes"], file.document["nodes"]
        meshes.append({"primitives": [{"attributes": attributes, "indices": indices, "material": len(children) % 2}]})
        placed = {"name": name, "mesh": len(meshes) - 1, "translation": (np.array(at) * scale).tolist()}
        nodes.append(placed | ({"children": list(children)} if children else {}))
        return len(nodes) - 1

    roots = [node("shell", (-0.9, 0.25, -2.25 * turn), (0.9, 1.45, 2.25 * turn))]
    for name, (x, z) in WHEELS.items():
        hub = node("hub", (-0.12, -0.05, -0.05), (0.12, 0.05, 0.05))
        r = RADIUS if "front" in name else radius
        own = (rename or {}).get(name, name)
        roots.append(node(own, (-0.1, -r, -r), (0.1, r, r), (x * turn, RADIUS, z * turn), (hub,)))
    file.document["scenes"] = [{"nodes": roots}]
    red, black = [0.6, 0.02, 0.02, 1.0], [0.01, 0.01, 0.01, 1.0]
    file.document["materials"] = [
        {"name": name, "pbrMetallicRoughness": {"baseColorFactor": colour}}
        for name, colour in (("body paint", red), ("tyre", black))
    ]
    return file.content()
