"""Pose of a two-wheeler and its rider: hands on the grips, feet on the pedals, the pegs or the ground."""

from __future__ import annotations

from recipe_compiler.ir import exact

from recipe_runtime.body.kinematics import Quaternion, Vector, axis_rotation, compose, inverse, rotate, two_bone_ik
from recipe_runtime.body.skeleton import SIDES, Bike

_WALKING = 0.9  # m/s
_DEVELOPMENT = 4.2  # distance per revolution of a bicycle's cranks, metres


def foot_down(speed: float) -> float:
    """Return the weight of the foot-on-ground pose of the left leg: 1 at rest, 0 from walking pace on.

    Args:
        speed: m/s.
    """
    return max(0.0, 1.0 - speed / _WALKING)


def resting_lean(bike: Bike, foot_weight: float) -> float:
    """Return the lean to the left, in degrees, while the foot is on the ground."""
    return foot_weight * (3.0 if bike.motor else 7.0)


def pose(bike: Bike, *, steer: float, distance: float, foot_weight: float = 0.0) -> tuple[Quaternion, ...]:
    """Return the rotations of `Bike.joints`, in their order.

    Args:
        bike: Dimensions of the two-wheeler.
        steer: Steering angle, degrees to the left.
        distance: Distance covered, metres.
        foot_weight: Weight of the foot-on-ground pose, see `foot_down`.
    """
    spin = axis_rotation("y", _degrees(distance, 6.283185307179586 * bike.wheel))
    crank = _degrees(distance, _DEVELOPMENT)
    fork = axis_rotation("z", steer)
    rotations = [fork, spin, spin]
    if not bike.motor:
        rotations.append(axis_rotation("y", crank))
    bend = 16.0 if bike.motor else 30.0
    pelvis, torso = axis_rotation("y", 0.35 * bend), axis_rotation("y", 0.65 * bend)
    rotations += [pelvis, torso, axis_rotation("y", 4.0 - bend)]
    for _, side in SIDES:
        rotations += _arm(bike, side, fork, compose(pelvis, torso), pelvis)
    for _, side in SIDES:
        rotations += _leg(bike, side, crank, pelvis, foot_weight if side > 0 else 0.0)
    return tuple(rotations)


def _degrees(distance: float, turn: float) -> float:
    turns = distance / turn
    return 360.0 * (turns - int(turns))


def _arm(bike: Bike, side: float, fork: Quaternion, torso: Quaternion, pelvis: Quaternion) -> list[Quaternion]:
    """Return the rotations of shoulder and elbow that put the palm on the grip."""
    f = bike.figure
    chest = _add(bike.hips, rotate(pelvis, (0.0, 0.0, f.chest - f.hip)))
    shoulder = _add(chest, rotate(torso, (0.0, side * f.shoulder, f.shoulders - f.chest)))
    x, y, z = bike.grips
    palm = _add(bike.steering, rotate(fork, (x, side * y, z + 0.02)))
    reach = rotate(inverse(torso), _subtract(palm, shoulder))
    return list(two_bone_ik(reach, f.upper_arm, 0.19 * f.height, (-0.3, 0.7 * side, -0.7), knee=False))


def _leg(bike: Bike, side: float, crank: float, pelvis: Quaternion, foot_weight: float) -> list[Quaternion]:
    """Return the rotations of hip, knee and ankle that put the ball of the foot on the pedal or on the ground."""
    f = bike.figure
    hip = _add(bike.hips, rotate(pelvis, (0.0, side * 0.05 * f.height, 0.0)))
    sole, pitch = pedal_position(bike, side, crank)
    if foot_weight > 0.0:
        ground, down = stop_position(bike)
        dx, dy, dz = _subtract(ground, sole)
        sole = _add(sole, (foot_weight * dx, foot_weight * dy, foot_weight * dz))
        pitch += foot_weight * (down - pitch)
    foot = axis_rotation("y", pitch)
    ankle = _add(sole, rotate(foot, (-0.085 * f.height, 0.0, f.ankle)))
    reach = rotate(inverse(pelvis), _subtract(ankle, hip))
    thigh, shin = two_bone_ik(reach, f.thigh, f.shin, (1.0, 0.12 * side, 0.15), knee=True)
    return [thigh, shin, compose(inverse(compose(compose(pelvis, thigh), shin)), foot)]


def stop_position(bike: Bike) -> tuple[Vector, float]:
    """Return the position of the ball of the left foot on the ground in the chassis' frame, and the foot's pitch."""
    y = 0.24
    s, c = exact.sin_cos_deg(resting_lean(bike, 1.0))
    x, _, _ = bike.hips
    pitch = 0.0 if bike.motor else 38.0
    tip = 0.031 * bike.figure.height * exact.sin_deg(pitch)  # the toes are lower than the ball
    return (x + 0.16, y, y * s / c + tip), pitch


def pedal_position(bike: Bike, side: float, crank: float) -> tuple[Vector, float]:
    """Return the position of the sole on its pedal in the chassis' frame, and the foot's pitch (toes down, degrees).

    Args:
        bike: Dimensions of the two-wheeler.
        side: 1 for the left foot, -1 for the right.
        crank: Angle of the cranks, degrees.
    """
    if bike.motor:
        return (0.03 * bike.wheelbase, side * 0.19, bike.wheel + 0.03), 6.0
    s, c = exact.sin_cos_deg(crank + (0.0 if side > 0 else 180.0))
    x, _, z = bike.crank
    return (x + bike.pedals * s, side * 0.13, z + bike.pedals * c + 0.012), 10.0 - 8.0 * c


def _add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _subtract(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
