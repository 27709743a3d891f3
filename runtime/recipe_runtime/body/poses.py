"""Poses of many actors at once: rotations and forward kinematics over arrays, elementwise.

Components come first: vectors are [3, ...], quaternions [4, ...] (x, y, z, w), each component an array of one shape.
Actors come last, and any number of moments before them, so that many frames of few actors are also computed at once.
The functions of `kinematics` that take tuples of numbers take tuples of such components.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recipe_runtime.body import exact_arrays
from recipe_runtime.body.exact_arrays import Floats
from recipe_runtime.body.kinematics import PartPose, compose, rotate
from recipe_runtime.body.skeleton import Joint

Components3 = tuple[Floats, Floats, Floats]
Components4 = tuple[Floats, Floats, Floats, Floats]


@dataclass(frozen=True)
class Poses:
    """Position [3, P, ..., N] and orientation [4, P, ..., N] of P parts of N actors, in the world frame."""

    positions: Floats
    rotations: Floats

    def of_first(self) -> list[PartPose]:
        """Return the poses of the parts of the first actor at the first moment."""
        shape = self.positions.shape[1], -1
        positions, rotations = (
            self.positions.reshape(3, *shape)[:, :, 0].T,
            self.rotations.reshape(4, *shape)[:, :, 0].T,
        )
        return [
            ((x, y, z), (a, b, c, w))
            for (x, y, z), (a, b, c, w) in zip(positions.tolist(), rotations.tolist(), strict=True)
        ]


@dataclass(frozen=True)
class _Level:
    """Joints whose parents are in the levels before."""

    joints: Sequence[int]
    parents: Sequence[int]  # parts


class SkeletonGroup:
    """Actors whose joints have the same names and parents."""

    def __init__(self, skeletons: Sequence[Sequence[Joint]]) -> None:
        """Collect actors.

        Args:
            skeletons: The joints of each actor, parents first.
        """
        joints = skeletons[0]
        parts = [joints[0].parent, *(joint.part for joint in joints)] if joints else [""]
        depth = {parts[0]: 0}
        for joint in joints:
            depth[joint.part] = depth[joint.parent] + 1
        self._levels = []
        for level in range(1, max(depth.values()) + 1):
            rows = [k for k, joint in enumerate(joints) if depth[joint.part] == level]
            self._levels.append(_Level(rows, [parts.index(joints[k].parent) for k in rows]))
        offsets = np.array([[joint.offset for joint in actor] for actor in skeletons])
        self._offsets = np.ascontiguousarray(offsets.reshape(len(skeletons), len(joints), 3).transpose(2, 1, 0))
        self._parts = len(parts)

    def forward_kinematics(self, base: Components3, rotation: Components4, joints: Floats) -> Poses:
        """Return the poses of all parts, with the bits of `kinematics.forward_kinematics`.

        Args:
            base: Positions of the base parts, each component [..., N].
            rotation: Their orientations.
            joints: Rotations of the joints relative to their parents, [4, J, ..., N].
        """
        shape = base[0].shape
        positions, rotations = np.empty((3, self._parts, *shape)), np.empty((4, self._parts, *shape))
        for axis in range(3):
            positions[axis, 0] = base[axis]
        for axis in range(4):
            rotations[axis, 0] = rotation[axis]
        for level in self._levels:
            parts = [k + 1 for k in level.joints]
            parent = components4(rotations[:, level.parents])
            offset = self._offsets[:, level.joints]
            offset = offset.reshape(*offset.shape[:2], *(1,) * (len(shape) - 1), -1)
            moved = rotate(parent, (offset[0], offset[1], offset[2]))
            turned = compose(parent, components4(joints[:, level.joints]))
            for axis in range(3):
                positions[axis, parts] = positions[axis, level.parents] + moved[axis]
            for axis in range(4):
                rotations[axis, parts] = turned[axis]
        return Poses(positions, rotations)


def components4(array: Floats) -> Components4:
    """Return the components of quaternions [4, ...]."""
    return array[0], array[1], array[2], array[3]


def axis_rotations(axis: str, degrees: Floats) -> Components4:
    """Return the rotations by angles about the axis "x", "y" or "z"."""
    s, c = exact_arrays.sin_cos_deg(degrees / 2.0)
    return about(axis, s, c)


def about(axis: str, sine: Floats, cosine: Floats) -> Components4:
    """Return rotations about an axis by the sine and cosine of half their angles."""
    zero = np.zeros_like(sine)
    return (
        sine if axis == "x" else zero,
        sine if axis == "y" else zero,
        sine if axis == "z" else zero,
        cosine,
    )


def about_by_angle(axis: str, sine: Floats, cosine: Floats) -> Components4:
    """Return rotations about an axis by the sine and cosine of their angles."""
    acute = cosine >= 0.0
    half_sine, half_cosine = np.where(acute, sine, 1.0 - cosine), np.where(acute, 1.0 + cosine, sine)
    size = np.sqrt(half_sine * half_sine + half_cosine * half_cosine)
    return about(axis, half_sine / size, half_cosine / size)
