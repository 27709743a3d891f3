"""Boxes of actors, in the frame of the base part: x forward, y left, z up, metres.

The *body box* has one size for a blueprint, as in CARLA: it bounds the meshes of the neutral pose, which is standing
for people, riding with the left crank up for riders, and wheels straight ahead for cars. Of an object with levels of
detail, the nearest version counts. Wheels that turn do not change
it. Its bottom is on the ground: in the base part's ground plane for vehicles, at the lower sole for people, whose base
part sinks while they walk.

The *tight box* bounds all vertices of the pose in a frame. It has the axes of the body box and another size in every
frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from recipe_compiler.ir.plan import ActorMesh, ActorPlan

from recipe_runtime.body import riding, walk_cycle
from recipe_runtime.body.kinematics import IDENTITY, PartPose
from recipe_runtime.body.skeleton import Bike, Figure, axle_shift, has_rider, is_person
from recipe_runtime.body.wheels import Cars
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array, compose, invert, rigid_transform
from recipe_runtime.meshes.actors import SHAPES_CACHE_SIZE, shape_parts
from recipe_runtime.meshes.mesh import Body, Mesh
from recipe_runtime.meshes.skin import BodyVertices, split_parts

_SOLES = ("foot_left", "foot_right")

Extent = tuple[Array, Array]  # lowest and highest corner, [3] each


@dataclass(frozen=True)
class BodyBox:
    """The body box of a blueprint, before it is put on the ground.

    Attributes:
        low: Lowest corner [3]; its z is 0.
        high: Highest corner [3].
        soles: For each part on which a person stands its name and its vertices [V, 3]; nothing for vehicles.
    """

    low: Array
    high: Array
    soles: tuple[tuple[str, Array], ...] = ()


def body_box(actor: ActorPlan) -> BodyBox:
    """Return the body box of an actor, which depends on its blueprint alone."""
    if actor.mesh is not None:
        return _given_box(actor, actor.mesh)
    return _shape_box(tuple(sorted(actor.shape.items())), actor.tag)


class GroundedBoxes:
    """The body boxes of the actors of a Trace, on the ground."""

    def __init__(self, actors: Sequence[ActorPlan], trace: Trace) -> None:
        self._boxes = {actor.name: body_box(actor) for actor in actors}
        self._soles: dict[str, list[tuple[int, Array]]] = {}
        for name, box in self._boxes.items():
            rows = {trace.parts[row].rpartition("/")[2]: row for row in trace.actor_parts(name)}
            self._soles[name] = [(rows[part], vertices) for part, vertices in box.soles if part in rows]

    def extent(self, actor: str, parts: Array, base: int) -> Extent:
        """Return the corners of an actor's body box in the frame of its base part.

        Args:
            actor: Name of the actor.
            parts: World-from-part transforms of the Trace at a frame, or at several, [..., P, 3, 4].
            base: Index of the actor's base part.

        Returns:
            Lowest and highest corner, [..., 3] each.
        """
        box = self._boxes[actor]
        rise = np.zeros(parts.shape[:-3])
        if self._soles[actor]:
            up = invert(parts[..., base, :, :])
            lows = [_lowest(compose(up, parts[..., row, :, :]), vertices) for row, vertices in self._soles[actor]]
            rise = np.minimum.reduce(lows)
        lift = np.zeros((*rise.shape, 3))
        lift[..., 2] = rise
        return box.low + lift, box.high + lift


class TightBoxes:
    """The tight boxes of bodies."""

    def __init__(self, trace: Trace, bodies: Sequence[Body]) -> None:
        self._trace = trace
        self._bodies = {body.name: body for body in bodies}
        self._vertices: dict[int, BodyVertices] = {}  # by the parts that bodies of a shape share

    def extent(self, actor: str, parts: Array) -> Extent:
        """Return the lowest and highest corner of an actor's tight box in the frame of its base part.

        Args:
            actor: Name of the actor.
            parts: World-from-part transforms of the Trace at a frame, [P, 3, 4].
        """
        shape = self._bodies[actor].parts
        if id(shape) not in self._vertices:
            self._vertices[id(shape)] = BodyVertices.of(shape)
        rows = self._trace.actor_parts(actor)
        moved = self._vertices[id(shape)].placed(compose(invert(parts[rows[0]]), parts[rows]))
        return moved.min(axis=1), moved.max(axis=1)


def _given_box(actor: ActorPlan, mesh: ActorMesh) -> BodyBox:
    """Return the box that the plan gives for a body from a file; the soles are about those of people of the library."""
    low, high = np.array(mesh.low), np.array(mesh.high)
    if not is_person(actor.shape):
        shift = np.array((axle_shift(actor.shape), 0.0, 0.0))
        return BodyBox(np.array((*(low + shift)[:2], 0.0)), high + shift)
    figure = Figure.of(actor.shape)
    heel, toe, wide = -0.045 * figure.height, 0.11 * figure.height, 0.03 * figure.height
    sole = np.array([(x, y, -figure.ankle) for x in (heel, toe) for y in (-wide, wide)])
    return BodyBox(np.array((low[0], low[1], 0.0)), high, tuple((name, sole) for name in _SOLES))


@lru_cache(maxsize=SHAPES_CACHE_SIZE)
def _shape_box(sorted_shape: tuple[tuple[str, float], ...], tag: int) -> BodyBox:
    shape = dict(sorted_shape)
    parts, poses = shape_parts(shape, tag), [rigid_transform(*pose) for pose in _neutral_pose(shape)]
    placed = BodyVertices.of(parts).placed(np.stack(poses))
    low, high, soles = placed.min(axis=1), placed.max(axis=1), []
    if is_person(shape):
        soles = [(name, _distinct(mesh)) for name, mesh in split_parts(parts) if name in _SOLES]
        high[2] -= low[2]
    low[2] = 0.0
    return BodyBox(low, high, tuple(soles))


def _neutral_pose(shape: Mapping[str, float]) -> list[PartPose]:
    """Return the poses of an actor's parts at the origin, in the order of the Trace."""
    if is_person(shape):
        return walk_cycle.steady_pose(Figure.of(shape), 0.0, 0.0)
    if has_rider(shape):
        return riding.steady_pose(Bike.of(shape), 0.0)
    return Cars([shape]).pose([[(0.0, 0.0, 0.0, *IDENTITY, 0.0, 0.0)]]).of_first()


def _distinct(mesh: Mesh) -> Array:
    vertices: Array = np.unique(mesh.vertices[mesh.seen_near_by()].astype(np.float64).reshape(-1, 3), axis=0)
    return vertices


def _lowest(transform: Array, vertices: Array) -> Array:
    """Return the lowest z of vertices [V, 3] after transforms [..., 3, 4]."""
    x, y, z = vertices.T
    r = transform[..., 2, :, None]
    lowest: Array = (r[..., 0, :] * x + r[..., 1, :] * y + r[..., 2, :] * z + r[..., 3, :]).min(axis=-1)
    return lowest
