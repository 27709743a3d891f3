"""Bodies of actors from the recipe's files: vehicles in rigid parts, people as a skin in the rest pose.

A person's file stands in any pose. Its parts are turned and stretched along their bones until its skeleton is that of
`Figure` at rest; vertices between parts are blended by their weights. Wheels and the rest of a vehicle only move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.assets import BodyData, rigs
from recipe_compiler.ir.assets.rigs import Place
from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.body.skeleton import Figure, Joint, axle_shift, is_person, joints_of, part_names, wheel_joints
from recipe_runtime.core.transforms import Array
from recipe_runtime.meshes.mesh import NO_MESH, Mesh, Pattern, Surface
from recipe_runtime.meshes.skin import Influences, rest_pose, skin_of
from recipe_runtime.meshes.vectors import unit

_BONES = {  # by part: the bone that starts it, and the bone that it points to
    "upper_arm": ("Arm", "ForeArm"),
    "forearm": ("ForeArm", "Hand"),
    "thigh": ("UpLeg", "Leg"),
    "shin": ("Leg", "Foot"),
}
_MAX_STRETCH = 2.0  # of a bone


def own_parts(actor: ActorPlan, body: BodyData) -> tuple[tuple[str, Mesh], ...]:
    """Return the parts of an actor whose body is from a file, in the order of the Trace.

    Raises:
        AssetError: the file is not that of the actor's category.
    """
    assert actor.mesh is not None
    if is_person(actor.shape):
        return _person(actor, body, actor.mesh.scale)
    return _vehicle(actor, body, actor.mesh.scale)


def _vehicle(actor: ActorPlan, body: BodyData, scale: float) -> tuple[tuple[str, Mesh], ...]:
    rig = rigs.vehicle(body, scale)
    joints = {joint.part: joint.offset for joint in wheel_joints(actor.shape)}
    vertices = _vertices(body, scale, rig.origin)
    main = _follows(body)[:, 0]
    shift = axle_shift(actor.shape)
    found = []
    for name in part_names(actor.shape):
        x, y, z = -shift, 0.0, 0.0
        mine = ~rigs.followers(main, list(rig.wheels))
        if name in joints:  # a wheel turns about its own axle; across the vehicle it is where the file has it
            (x, _, z), y = rig.centres[name], joints[name][1]
            mine = rigs.followers(main, [node for node, wheel in rig.wheels.items() if wheel == name])
        found.append((name, _mesh(actor, body, vertices - np.array((x, y, z)), _normals(body), mine)))
    return tuple(found)


def _person(actor: ActorPlan, body: BodyData, scale: float) -> tuple[tuple[str, Mesh], ...]:
    rig, joints = rigs.person(body, scale), joints_of(actor.shape)
    names, (origins, _) = part_names(actor.shape), rest_pose(joints)
    moves = _moves(rig, Figure.of(actor.shape), joints, dict(zip(names, origins, strict=True)))
    given, normals, follows = _vertices(body, scale, rig.origin), _normals(body), _follows(body)
    number = np.zeros(max(rig.parts) + 1, np.int64)
    number[list(rig.parts)] = [names.index(part) for part in rig.parts.values()]
    parts = number[follows[:, :4].astype(np.int64)]
    placed, turned = np.zeros_like(given), np.zeros_like(given)
    for part, name in enumerate(names):
        weights = [np.where(parts[:, k] == part, follows[:, 4 + k], 0.0) for k in range(4)]
        weight = ((weights[0] + weights[1]) + weights[2]) + weights[3]
        rows = np.flatnonzero(weight > 0.0)
        matrix, start, end = moves[name]
        placed[rows] += (_applied(matrix, given[rows] - start) + end) * weight[rows, None]
        turned[rows] += _applied(matrix, normals[rows]) * weight[rows, None]
    mesh = _mesh(actor, body, placed, unit(turned), np.ones(len(given), np.bool_))
    whole = replace(mesh, skin=skin_of(Influences(parts, follows[:, 4:]), joints))
    return ((names[0], whole), *((name, NO_MESH) for name in names[1:]))


def _moves(
    rig: rigs.Person, figure: Figure, joints: Sequence[Joint], origins: Mapping[str, Array]
) -> dict[str, tuple[Array, Array, Array]]:
    """Return for each part a matrix [3, 3], the point in the file about which it turns, and where that goes [3].

    A part without a bone of its own moves as its parent does.
    """
    places = {bone: np.array(place) for bone, place in rig.joints.items()}
    hips = np.array((0.0, 0.0, (places["LeftUpLeg"][2] + places["RightUpLeg"][2]) / 2.0))
    chest, back = origins["head"][2] - origins["torso"][2], places["Neck"][2] - places["Spine"][2]
    found = {
        "pelvis": (_upright(1.0), hips, np.array((0.0, 0.0, figure.hip))),
        "torso": (_upright(_ratio(chest, back)), places["Spine"], origins["torso"]),
        "head": (_upright(1.0), places["Neck"], origins["head"]),
    }
    for side in ("left", "right"):
        bone = side.capitalize()
        for part, (start, end) in _BONES.items():
            name = f"{part}_{side}"
            a, b = places[bone + start], places[bone + end]
            found[name] = (_hanging(b - a, _length(name, joints)), a, origins[name])
        ankle = places[f"{bone}Foot"]
        found[f"foot_{side}"] = (_upright(_ratio(figure.ankle, ankle[2])), ankle, origins[f"foot_{side}"])
    for joint in joints:
        if joint.part not in found:
            found[joint.part] = found[joint.parent]
    return found


def _length(part: str, joints: Sequence[Joint]) -> float | None:
    """Return the length of a limb's part to its next joint, metres; None for the last."""
    return next((-joint.offset[2] for joint in joints if joint.parent == part), None)


def _upright(stretch: float) -> Array:
    return np.diag((1.0, 1.0, stretch))


def _hanging(bone: Array, length: float | None) -> Array:
    """Return the matrix that turns a bone by the shortest way to hang down, stretched to a length, metres."""
    size = float(np.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2]))
    x, y, z = (bone / max(size, 1e-6)).tolist()
    stretch = 1.0 if length is None else _ratio(length, size)
    k = 1.0 / max(1.0 - z, 1e-3)  # of Rodrigues' formula; a bone that points up has no shortest way
    turn = np.array([[1.0 - k * x * x, -k * x * y, x], [-k * x * y, 1.0 - k * y * y, y], [-x, -y, -z]])
    axis = np.array((x, y, z))
    along = _upright(1.0) + (stretch - 1.0) * (axis[:, None] * axis[None])
    return np.stack([_applied(turn, column) for column in along.T], axis=1)


def _ratio(a: float, b: float) -> float:
    """Return a stretch, within bounds."""
    return min(max(a / max(b, 1e-6), 1.0 / _MAX_STRETCH), _MAX_STRETCH)


def _applied(matrix: Array, points: Array) -> Array:
    """Return points [..., 3] transformed by a matrix [3, 3]."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix], axis=-1)


def _vertices(body: BodyData, scale: float, origin: Place) -> Array:
    """Return the vertices of all parts of a file about an origin, metres [V, 3]."""
    found: Array = np.concatenate([part.vertices for part in body.mesh.parts]) * scale - np.array(origin)
    return found


def _normals(body: BodyData) -> Array:
    return np.concatenate([part.normals for part in body.mesh.parts])


def _follows(body: BodyData) -> Array:
    return np.concatenate([part.follows for part in body.mesh.parts if part.follows is not None])


def _mesh(actor: ActorPlan, body: BodyData, vertices: Array, normals: Array, mine: NDArray[np.bool_]) -> Mesh:
    """Return the triangles whose first corner is `mine`, and their vertices; all of them if all are."""
    parts = body.mesh.parts
    slots = list(dict.fromkeys(part.slot for part in parts))
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    triangles = np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=False)])
    numbers = np.concatenate([np.full(len(part.triangles), slots.index(part.slot)) for part in parts])
    own = mine[triangles[:, 0]]
    used, kept = np.arange(len(vertices)), triangles
    if not mine.all():
        used, kept = np.unique(triangles[own], return_inverse=True)
    return Mesh(
        vertices=vertices[used].astype(np.float32),
        normals=normals[used].astype(np.float32),
        uvs=np.concatenate([part.uvs for part in parts])[used].astype(np.float32),
        triangles=kept.reshape(-1, 3).astype(np.int32),
        surface=numbers[own].astype(np.int32),
        surfaces=tuple(Surface(slot, Pattern.IMAGE, actor.tag) for slot in slots),
    )
