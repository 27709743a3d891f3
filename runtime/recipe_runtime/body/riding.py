"""Poses of two-wheelers and riders, all at once: hands on the grips, feet on the pedals, the pegs or the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.body import exact_arrays
from recipe_runtime.body.exact_arrays import Floats
from recipe_runtime.body.kinematics import (
    IDENTITY,
    PartPose,
    Quaternion,
    Vector,
    axis_rotation,
    compose,
    inverse,
    rotate,
)
from recipe_runtime.body.limbs import two_bone_ik
from recipe_runtime.body.poses import Components3, Components4, Poses, SkeletonGroup, axis_rotations, components4
from recipe_runtime.body.skeleton import Bike

_WALKING = 0.9  # m/s
_DEVELOPMENT = 4.2  # distance per revolution of a bicycle's cranks, metres
_SIDES = np.array([1.0, -1.0]).reshape(2, 1, 1)


def foot_down(speed: float) -> float:
    """Return the weight of the foot-on-ground pose of the left leg: 1 at rest, 0 from walking pace on.

    Args:
        speed: m/s.
    """
    return max(0.0, 1.0 - speed / _WALKING)


def resting_lean(bike: Bike, foot_weight: float) -> float:
    """Return the lean to the left, in degrees, while the foot is on the ground."""
    return foot_weight * (3.0 if bike.motor else 7.0)


def steady_pose(bike: Bike, distance: float) -> list[PartPose]:
    """Return the poses of the base and all joints of a two-wheeler that goes straight on, at the origin.

    Args:
        bike: Its dimensions.
        distance: Distance covered, metres.
    """
    return Riders([bike]).pose([[(0.0, 0.0, 0.0, *IDENTITY, 0.0, distance, 0.0)]]).of_first()


class Riders:
    """Two-wheelers, all with a motor or all without, whose poses are computed together."""

    def __init__(self, bikes: Sequence[Bike]) -> None:
        self._group = SkeletonGroup([bike.joints() for bike in bikes])
        self._motor = bikes[0].motor
        bend = 16.0 if self._motor else 30.0
        self._pelvis, self._torso = axis_rotation("y", 0.35 * bend), axis_rotation("y", 0.65 * bend)
        self._head = axis_rotation("y", 4.0 - bend)
        figures = [bike.figure for bike in bikes]
        self._round = np.array([6.283185307179586 * bike.wheel for bike in bikes])
        self._height = np.array([f.height for f in figures])
        self._ankle, self._upper_arm = np.array([f.ankle for f in figures]), np.array([f.upper_arm for f in figures])
        self._thigh, self._shin = np.array([f.thigh for f in figures]), np.array([f.shin for f in figures])
        self._grips, self._steering = _vectors([b.grips for b in bikes]), _vectors([b.steering for b in bikes])
        chests = [_add(b.hips, rotate(self._pelvis, (0.0, 0.0, b.figure.chest - b.figure.hip))) for b in bikes]
        back = compose(self._pelvis, self._torso)
        self._back = back
        self._shoulders = _both_sides(
            [
                _add(chest, rotate(back, (0.0, side * f.shoulder, f.shoulders - f.chest)))
                for side in (1.0, -1.0)
                for chest, f in zip(chests, figures, strict=True)
            ]
        )
        self._hips = _both_sides(
            [
                _add(b.hips, rotate(self._pelvis, (0.0, side * 0.05 * b.figure.height, 0.0)))
                for side in (1.0, -1.0)
                for b in bikes
            ]
        )
        stops = [stop_position(bike) for bike in bikes]
        self._stop, self._stop_pitch = _vectors([place for place, _ in stops]), np.array([pitch for _, pitch in stops])
        if self._motor:
            self._pedals = _vectors([(0.03 * b.wheelbase, 0.19, b.wheel + 0.03) for b in bikes])
        else:
            self._pedals = _vectors([(b.crank[0], 0.13, b.crank[2]) for b in bikes])
        self._crank_radius = np.array([b.pedals for b in bikes])

    def pose(self, rows: Sequence[Sequence[Sequence[float]]]) -> Poses:
        """Return the poses of all parts, in the order of `Bike.joints` after the base.

        Args:
            rows: For each of some moments, the state of each: position and orientation (x, y, z, w) of the chassis,
                tangent of the steering angle, positive to the left, the distance covered, metres, and the weight of
                the foot-on-ground pose, see `foot_down`.
        """
        data = np.ascontiguousarray(np.moveaxis(np.array(rows), -1, 0))
        x, y, z, qx, qy, qz, qw, steer, distance, foot_weight = data
        spin = axis_rotations("y", _degrees(distance, self._round))
        crank = _degrees(distance, _DEVELOPMENT)
        fork = axis_rotations("z", exact_arrays.atan2_deg(steer, np.ones_like(steer)))
        rotations = [fork, spin, spin]
        if not self._motor:
            rotations.append(axis_rotations("y", crank))
        rotations += [components4(np.array(fixed)) for fixed in (self._pelvis, self._torso, self._head)]
        arms, legs = self._arms(fork), self._legs(crank, foot_weight)
        for limbs in (arms, legs):
            rotations += [(q[0][side], q[1][side], q[2][side], q[3][side]) for side in (0, 1) for q in limbs]
        joints = np.empty((4, len(rotations), *distance.shape))
        for number, turn in enumerate(rotations):
            for axis in range(4):
                joints[axis, number] = turn[axis]
        return self._group.forward_kinematics((x, y, z), (qx, qy, qz, qw), joints)

    def _arms(self, fork: Components4) -> tuple[Components4, ...]:
        """Return the rotations of shoulders and elbows that put the palms on the grips, each component [2, F, N]."""
        x, y, z = self._grips
        px, py, pz = rotate(fork, (x, _SIDES * y, z + 0.02))
        (sx, sy, sz), (ox, oy, oz) = self._steering, self._shoulders
        reach = rotate(_turn(inverse(self._back)), (sx + px - ox, sy + py - oy, sz + pz - oz))
        pole = (np.array(-0.3), 0.7 * _SIDES, np.array(-0.7))
        return two_bone_ik(reach, self._upper_arm, 0.19 * self._height, pole, knee=False)

    def _legs(self, crank: Floats, foot_weight: Floats) -> tuple[Components4, ...]:
        """Return the rotations of hips, knees and ankles that put the balls of the feet on the pedals or the ground."""
        (x, y, z), pitch = self.pedal_positions(crank)
        weight = foot_weight * np.maximum(_SIDES, 0.0)  # of the left foot
        down = self._stop
        x, y, z = x + weight * (down[0] - x), y + weight * (down[1] - y), z + weight * (down[2] - z)
        foot = axis_rotations("y", pitch + weight * (self._stop_pitch - pitch))
        ax, ay, az = rotate(foot, (-0.085 * self._height, np.array(0.0), self._ankle))
        hip = self._hips
        pelvis = _turn(self._pelvis)
        reach = rotate(inverse(pelvis), (x + ax - hip[0], y + ay - hip[1], z + az - hip[2]))
        pole = (np.array(1.0), 0.12 * _SIDES, np.array(0.15))
        thigh, shin = two_bone_ik(reach, self._thigh, self._shin, pole, knee=True)
        return thigh, shin, compose(inverse(compose(compose(pelvis, thigh), shin)), foot)

    def pedal_positions(self, crank: Floats) -> tuple[Components3, Floats]:
        """Return the positions of the soles on their pedals in the chassis' frame, and the feet's pitch.

        Args:
            crank: Angles of the cranks, degrees, [F, N].

        Returns:
            Components [2, F, N], left feet first; the pitch in degrees, toes down.
        """
        x, y, z = self._pedals
        if self._motor:
            still = 0.0 * crank + 0.0 * _SIDES
            return (x + still, _SIDES * y + still, z + still), 6.0 + still
        s, c = exact_arrays.sin_cos_deg(crank + np.array([0.0, 180.0]).reshape(2, 1, 1))
        radius = self._crank_radius
        return (x + radius * s, _SIDES * y + 0.0 * s, z + radius * c + 0.012), 10.0 - 8.0 * c


def stop_position(bike: Bike) -> tuple[Vector, float]:
    """Return the position of the ball of the left foot on the ground in the chassis' frame, and the foot's pitch."""
    y = 0.24
    s, c = exact.sin_cos_deg(resting_lean(bike, 1.0))
    x, _, _ = bike.hips
    pitch = 0.0 if bike.motor else 38.0
    tip = 0.031 * bike.figure.height * exact.sin_deg(pitch)  # the toes are lower than the ball
    return (x + 0.16, y, y * s / c + tip), pitch


def _degrees(distance: Floats, turn: Floats | float) -> Floats:
    turns = distance / turn
    result: Floats = 360.0 * (turns - np.trunc(turns))
    return result


def _turn(rotation: Quaternion) -> Components4:
    return components4(np.array(rotation))


def _vectors(vectors: Sequence[Vector]) -> Components3:
    x, y, z = np.array(vectors).T
    return x, y, z


def _both_sides(vectors: Sequence[Vector]) -> Components3:
    """Return the components [2, 1, N] of vectors, those of the left side first."""
    x, y, z = np.array(vectors).T.reshape(3, 2, 1, -1)
    return x, y, z


def _add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
