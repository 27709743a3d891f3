"""Surfaces of whole people at a level of detail, for pedestrians and riders."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from recipe_runtime.body.skeleton import Bike, Figure, Joint
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.mesh import NO_MESH, Mesh
from recipe_runtime.meshes.person.arms import add_arm, shoulder_ring, sleeve_columns
from recipe_runtime.meshes.person.carried import add_bag, add_telephone
from recipe_runtime.meshes.person.hair import FULL as FULL_FACE
from recipe_runtime.meshes.person.hair import add_hair
from recipe_runtime.meshes.person.head import add_head
from recipe_runtime.meshes.person.hull import Hull
from recipe_runtime.meshes.person.legs import add_legs
from recipe_runtime.meshes.person.outfit import SKIRT, Outfit
from recipe_runtime.meshes.person.trunk import Build, add_hips, add_skirt, add_top
from recipe_runtime.meshes.skin import FULL

_NEAR, _FAR = 9.0, 26.0  # metres up to which the near version is shown, and from which the far one is


def pedestrian_parts(shape: Mapping[str, float], tag: int) -> tuple[tuple[str, Mesh], ...]:
    """Return the base part `pelvis` with the skin, then the parts of `Figure.joints`, which have no mesh."""
    joints = Figure.of(shape).joints
    b = Builder()
    _add(b, shape, tag, _numbers(joints), (0.0, 0.0, 0.0))
    return (("pelvis", b.mesh(joints=joints)), *((joint.part, NO_MESH) for joint in joints))


def with_rider(chassis: Mesh, shape: Mapping[str, float], tag: int) -> Mesh:
    """Return the mesh of a two-wheeler's chassis, joined by the skin of its rider.

    Args:
        chassis: The base part.
        shape: The blueprint's shape.
        tag: The rider's semantic tag.
    """
    bike = Bike.of(shape)
    joints, (x, y, z) = bike.joints(), bike.hips
    b = Builder()
    _add(b, shape, tag, _numbers(joints), (x, y, z - bike.figure.hip))
    return joined_meshes(chassis, b.mesh(joints=joints))


def joined_meshes(rigid: Mesh, skin: Mesh) -> Mesh:
    """Return a mesh of the base part and a skin as one."""
    assert skin.skin is not None
    surfaces = tuple(dict.fromkeys([*rigid.surfaces, *skin.surfaces]))
    ids = [np.array([surfaces.index(s) for s in m.surfaces], np.int32)[m.surface] for m in (rigid, skin)]
    own = [np.full(len(m.triangles), -1, np.int32) if m.level is None else m.level for m in (rigid, skin)]
    weights = np.zeros((len(rigid.vertices), skin.skin.weights.shape[1]), np.uint8)
    weights[:, 0] = FULL
    follow = replace(
        skin.skin,
        parts=np.concatenate([np.zeros(weights.shape, np.int32), skin.skin.parts]),
        weights=np.concatenate([weights, skin.skin.weights]),
    )
    return Mesh(
        vertices=np.concatenate([rigid.vertices, skin.vertices]),
        normals=np.concatenate([rigid.normals, skin.normals]),
        uvs=np.concatenate([rigid.uvs, skin.uvs]),
        triangles=np.concatenate([rigid.triangles, skin.triangles + np.int32(len(rigid.vertices))]),
        surface=np.concatenate(ids),
        surfaces=surfaces,
        lights=rigid.lights,
        levels=(*rigid.levels, *skin.levels),
        level=np.concatenate([own[0], own[1] + len(rigid.levels) * (own[1] >= 0)]).astype(np.int32),
        skin=follow,
    )


def _numbers(joints: Sequence[Joint]) -> dict[str, int]:
    return {name: n for n, name in enumerate([joints[0].parent, *(joint.part for joint in joints)])}


def _add(
    b: Builder, shape: Mapping[str, float], tag: int, parts: Mapping[str, int], shift: tuple[float, float, float]
) -> None:
    """Add the versions of a person for all distances."""
    x, y, z = shift
    anchor = (x, y, z + 0.55 * Figure.of(shape).height)
    for detail, near, far in ((2, 0.0, _NEAR), (1, _NEAR, _FAR), (0, _FAR, math.inf)):
        with b.level(near, far, anchor=anchor, casts=detail == 1):
            person_hull(shape, tag, parts, detail).finish(b, shift)


def person_hull(shape: Mapping[str, float], tag: int, parts: Mapping[str, int], detail: int) -> Hull:
    """Return the surface of a person who stands upright on the ground, arms and legs straight down.

    Args:
        shape: The shape of the blueprint.
        tag: CARLA's semantic tag.
        parts: The number of each part of the actor.
        detail: 0 far, 1, 2 near.
    """
    hull = Hull(parts)
    build, outfit = Build(Figure.of(shape), shape["female"], detail), Outfit.of(shape, tag)
    edge, low = add_hips(hull, build, outfit)
    add_legs(hull, build, outfit, edge, low)
    armhole = shoulder_ring(build, outfit, 0.0, sleeve_columns(build))
    for side, s, rim in zip(("left", "right"), (1.0, -1.0), add_top(hull, build, outfit, armhole), strict=True):
        add_arm(hull, build, outfit, side, s, rim)
    if outfit.legs == SKIRT or outfit.coat > 0.0:
        add_skirt(hull, build, outfit)
    add_head(
        hull, build, outfit, beard=shape["beard"], glasses=0.0 if int(shape["hair"]) == FULL_FACE else shape["glasses"]
    )
    add_hair(hull, build, outfit, int(shape["hair"]))
    add_bag(hull, build, outfit, int(shape["bag"]))
    if build.figure.phone:
        add_telephone(hull, build, outfit)
    return hull
