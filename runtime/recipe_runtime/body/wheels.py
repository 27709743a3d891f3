"""Rotations of the wheels of cars, all at once: rolling and, in front, steering with Ackermann geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from recipe_runtime.body import exact_arrays
from recipe_runtime.body.kinematics import compose
from recipe_runtime.body.poses import Poses, SkeletonGroup, axis_rotations
from recipe_runtime.body.skeleton import wheel_joints


class Cars:
    """Vehicles with four wheels whose poses are computed together."""

    def __init__(self, shapes: Sequence[Mapping[str, float]]) -> None:
        self._group = SkeletonGroup([wheel_joints(shape) for shape in shapes])
        self._round = np.array([2.0 * math.pi * shape["wheel"] for shape in shapes])
        self._base = np.array([shape["wheelbase"] for shape in shapes])
        self._half = np.array([shape["width"] / 2 - 0.13 for shape in shapes])

    def pose(self, rows: Sequence[Sequence[Sequence[float]]]) -> Poses:
        """Return the poses of all parts, in the order of `wheel_joints` after the base.

        Args:
            rows: For each of some moments, the state of each vehicle: position and orientation (x, y, z, w) of the
                chassis, metres that the wheels have rolled, and the curvature of the way that they point to, 1/m,
                positive to the left.
        """
        x, y, z, qx, qy, qz, qw, distance, curvature = np.ascontiguousarray(np.moveaxis(np.array(rows), -1, 0))
        rolled = distance / self._round
        spin = axis_rotations("y", 360.0 * (rolled - np.floor(rolled)))
        joints = np.empty((4, 4, *distance.shape))
        for wheel, side in enumerate((1.0, -1.0)):
            angle = exact_arrays.atan2_deg(self._base * curvature, 1.0 - side * self._half * curvature)
            steered = compose(axis_rotations("z", angle), spin)
            for axis in range(4):
                joints[axis, wheel], joints[axis, 2 + wheel] = steered[axis], spin[axis]
        return self._group.forward_kinematics((x, y, z), (qx, qy, qz, qw), joints)
