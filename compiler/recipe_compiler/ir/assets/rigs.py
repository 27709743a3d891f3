"""What the nodes of an actor's file stand for: bones of a person, by Mixamo's names, or wheels of a vehicle.

Positions are in metres with x forward, y left and z up, and 0 is the ground.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recipe_compiler.ir.assets.bodies import BodyData, Node
from recipe_compiler.ir.assets.geometry import AssetError, Floats

Place = tuple[float, float, float]

_SIDED = {
    "Shoulder": "torso",
    "Arm": "upper_arm",
    "ForeArm": "forearm",
    "Hand": "forearm",
    "UpLeg": "thigh",
    "Leg": "shin",
    "Foot": "foot",
    "ToeBase": "foot",
}
BONES: Mapping[str, str] = {
    "Hips": "pelvis",
    "Spine": "torso",
    "Spine1": "torso",
    "Spine2": "torso",
    "Neck": "head",
    "Head": "head",
    **{
        f"{side}{bone}": part if part == "torso" else f"{part}_{side.lower()}"
        for side in ("Left", "Right")
        for bone, part in _SIDED.items()
    },
}
"""The part of a person that each bone of Mixamo's skeleton moves; other bones move that of their nearest ancestor."""

NEEDED = (
    "Hips",
    "Spine",
    "Neck",
    *(f"{s}{b}" for s in ("Left", "Right") for b in _SIDED if b not in ("Shoulder", "ToeBase")),
)
WHEELS = tuple(f"wheel_{end}_{side}" for end in ("front", "rear") for side in ("left", "right"))
_MAX_WHEEL_DIFFERENCE = 0.06  # metres between the radii of a vehicle's wheels
_ARMS = ("upper_arm_left", "upper_arm_right", "forearm_left", "forearm_right")


@dataclass(frozen=True)
class Person:
    """A person's file, measured. The hips are above the origin."""

    parts: Mapping[int, str]  # the part that each node moves
    joints: Mapping[str, Place]  # the position of each bone of NEEDED
    origin: Place  # of this frame, in that of the file, metres
    height: float
    low: Place  # of the box of the body with its arms hanging
    high: Place


@dataclass(frozen=True)
class Vehicle:
    """A vehicle's file, measured. The middle of the wheelbase is above the origin."""

    wheels: Mapping[int, str]  # the wheel that a node belongs to, for the nodes of wheels
    centres: Mapping[str, Place]  # of each wheel
    radius: float  # of the front wheels
    clearance: float  # height of the lowest point but for the wheels
    origin: Place  # of this frame, in that of the file, metres
    low: Place
    high: Place


def person(body: BodyData, scale: float) -> Person:
    """Measure a person.

    Args:
        body: the content of the file.
        scale: metres of one unit of the file.

    Raises:
        AssetError: it lacks bones, or does not stand upright and look along +Z.
    """
    found: dict[str, Place] = {}
    names = {name.lower(): name for name in BONES}
    bones: dict[int, str] = {}
    for number, node in body.nodes.items():
        bone = names.get(re.sub(r"^mixamorig\d*_?", "", node.name.rpartition(":")[2], flags=re.IGNORECASE).lower())
        if bone is not None and bone not in found:
            bones[number], found[bone] = bone, _scaled(node.position, scale)
    missing = [bone for bone in NEEDED if bone not in found]
    if missing:
        others = ", ".join(sorted(node.name for node in body.nodes.values() if node.name)[:5]) or "none"
        raise AssetError(
            f"has no bone {' and no bone '.join(missing[:3])} (its nodes are {others}, ...); "
            "name the bones of its skeleton as Mixamo does, such as mixamorig:LeftArm"
        )
    if not found["LeftFoot"][2] < found["LeftLeg"][2] < found["LeftUpLeg"][2] < found["Neck"][2]:
        raise AssetError("does not stand upright; export it standing, with +Y up")
    if found["LeftUpLeg"][1] <= found["RightUpLeg"][1]:
        raise AssetError("looks backwards, or its left and right are exchanged; export it looking along +Z")
    parts = {number: BONES[_ancestor(number, body.nodes, bones, "Hips")] for number in body.nodes}
    vertices = np.concatenate([part.vertices for part in body.mesh.parts]) * scale
    main = np.concatenate([part.follows[:, 0] for part in body.mesh.parts if part.follows is not None])
    middle = [(found["LeftUpLeg"][axis] + found["RightUpLeg"][axis]) / 2.0 for axis in (0, 1)]
    origin = middle[0], middle[1], float(vertices[:, 2].min())
    joints = {bone: _minus(place, origin) for bone, place in found.items()}
    low, high = _standing_box(vertices - np.array(origin), main, parts, joints)
    return Person(parts, joints, origin, float(high[2]), low, high)


def _standing_box(
    vertices: Floats, main: Floats, parts: Mapping[int, str], joints: Mapping[str, Place]
) -> tuple[Place, Place]:
    """Return the box of a person whose arms hang; they are as thick as they are about their bones."""
    arms = followers(main, [node for node, part in parts.items() if part in _ARMS])
    rest = vertices[~arms] if not arms.all() else vertices
    low, high = rest.min(axis=0), rest.max(axis=0)
    thick = 0.0
    for side in ("left", "right"):
        name = side.capitalize()
        bone = [joints[f"{name}Arm"], joints[f"{name}ForeArm"]]
        mine = vertices[followers(main, [node for node, part in parts.items() if part == f"upper_arm_{side}"])]
        thick = max(thick, _radius(mine, *bone))
    reach = max(abs(joints["LeftArm"][1]), abs(joints["RightArm"][1])) + thick
    return _place(low * (1, 0, 0) - (0, max(reach, -low[1]), 0)), _place(high * (1, 0, 1) + (0, max(reach, high[1]), 0))


def _radius(points: Floats, start: Place, end: Place) -> float:
    """Return the median distance of points from the line through a bone, metres; 0 without points."""
    if not len(points):
        return 0.0
    axis = np.array(end) - np.array(start)
    size = max(float(np.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])), 1e-6)
    x, y, z = (axis / size).tolist()
    p = points - np.array(start)
    along = p[:, 0] * x + p[:, 1] * y + p[:, 2] * z
    square = p[:, 0] * p[:, 0] + p[:, 1] * p[:, 1] + p[:, 2] * p[:, 2] - along * along
    return float(np.sort(np.sqrt(np.maximum(square, 0.0)))[len(points) // 2])


def vehicle(body: BodyData, scale: float) -> Vehicle:
    """Measure a vehicle.

    Args:
        body: the content of the file.
        scale: metres of one unit of the file.

    Raises:
        AssetError: it lacks wheels, or does not look along +Z.
    """
    names = {_plain(wheel): wheel for wheel in WHEELS}
    own = {number: names[plain] for number, node in body.nodes.items() if (plain := _plain(node.name)) in names}
    missing = [wheel for wheel in WHEELS if wheel not in own.values()]
    if missing:
        others = ", ".join(sorted(node.name for node in body.nodes.values() if node.name)[:5]) or "none"
        raise AssetError(
            f"has no node {' and no node '.join(missing[:2])} (its nodes are {others}, ...); "
            f"name the nodes of its wheels {', '.join(WHEELS)}"
        )
    wheels = {n: wheel for n in body.nodes if (wheel := _ancestor(n, body.nodes, own, "")) != ""}
    vertices = np.concatenate([part.vertices for part in body.mesh.parts]) * scale
    main = np.concatenate([part.follows[:, 0] for part in body.mesh.parts if part.follows is not None])
    boxes: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
    for wheel in WHEELS:
        mine = vertices[followers(main, [node for node, name in wheels.items() if name == wheel])]
        if not len(mine):
            raise AssetError(f"its node {wheel} has no triangles; put the mesh of the wheel into it")
        boxes[wheel] = mine.min(axis=0), mine.max(axis=0)
    body_of = ~followers(main, list(wheels))
    if not body_of.any():
        raise AssetError("has nothing but wheels; put the body of the vehicle into other nodes")
    centres = {wheel: (low + high) / 2.0 for wheel, (low, high) in boxes.items()}
    radii = [float(high[2] - low[2]) / 2.0 for low, high in boxes.values()]
    if max(radii) - min(radii) > _MAX_WHEEL_DIFFERENCE:
        raise AssetError(f"its wheels have radii from {min(radii):.2f} to {max(radii):.2f} m; make them alike")
    if centres[WHEELS[0]][0] <= centres[WHEELS[2]][0] or centres[WHEELS[0]][1] <= centres[WHEELS[1]][1]:
        raise AssetError("its front wheels are not ahead, or left and right are exchanged; export it looking along +Z")
    middle = (((centres[WHEELS[0]] + centres[WHEELS[1]]) + centres[WHEELS[2]]) + centres[WHEELS[3]]) / 4.0
    ground = min(float(low[2]) for low, _ in boxes.values())
    origin = float(middle[0]), float(middle[1]), ground
    low, high = vertices.min(axis=0) - origin, vertices.max(axis=0) - origin
    clearance = float(vertices[body_of][:, 2].min()) - ground
    placed = {wheel: _minus(_place(centre), origin) for wheel, centre in centres.items()}
    return Vehicle(wheels, placed, (radii[0] + radii[1]) / 2.0, clearance, origin, _place(low), _place(high))


def followers(main: Floats, nodes: Sequence[int]) -> NDArray[np.bool_]:
    """Return which vertices follow one of some nodes most; `main` is the first column of `follows`."""
    found: NDArray[np.bool_] = np.isin(main, np.array(nodes, np.float64))
    return found


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())


def _ancestor(number: int, nodes: Mapping[int, Node], named: Mapping[int, str], otherwise: str) -> str:
    """Return the name of a node or of its nearest ancestor that has one."""
    while number >= 0:
        if number in named:
            return named[number]
        number = nodes[number].parent
    return otherwise


def _scaled(place: Place, scale: float) -> Place:
    return place[0] * scale, place[1] * scale, place[2] * scale


def _minus(a: Place, b: Place) -> Place:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _place(row: Sequence[float] | NDArray[np.float64]) -> Place:
    x, y, z = (float(v) for v in row)
    return x, y, z
