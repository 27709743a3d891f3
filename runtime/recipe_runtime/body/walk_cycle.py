"""The walk cycle of a pedestrian: joint rotations as a function of phase and speed.

The phase counts strides: the left heel strikes at 0, the right heel at 0.5. It advances with the distance covered, so
that a foot on the ground does not slide. The feet are placed first, and the legs follow by inverse kinematics; the
pelvis drops when the legs are spread. Proportions are from D. A. Winter, Biomechanics and Motor Control of Human
Movement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact

from recipe_runtime.body.kinematics import IDENTITY, Quaternion, axis_rotation, compose, forward_kinematics, rotate
from recipe_runtime.body.skeleton import Figure

_DUTY = 0.61  # duty factor: the fraction of a stride during which a foot is on the ground


def stride_length(figure: Figure, speed: float) -> float:
    """Return the length of a stride (two steps) in metres at a speed in m/s.

    Gaits are similar at equal Froude numbers, so shorter legs have a higher cadence (R. McN. Alexander, 1976).
    """
    pace = speed / math.sqrt(9.81 * figure.hip)
    return figure.hip * min(0.75 + 1.85 * pace, 2.3)


def pelvis_drop(figure: Figure, phase: float, speed: float) -> float:
    """Return how far the pelvis is below its standing height, in metres; it is lowest when the legs are spread."""
    _, twice = exact.sin_cos_deg(720.0 * (phase - 0.05))
    deepest = min(0.029 * stride_length(figure, speed), 0.029 * figure.height)
    return _walk_weight(speed) * (0.003 * figure.height + deepest * 0.5 * (1.0 + twice))


def pose(figure: Figure, phase: float, speed: float) -> tuple[Quaternion, ...]:
    """Return the rotations of `Figure.joints`, in their order; at speed 0 the pose is standing.

    Args:
        figure: Proportions of the pedestrian.
        phase: Number of strides since a left heel strike.
        speed: m/s.
    """
    swing = min(1.25, speed / 1.4)
    _, cosine = exact.sin_cos_deg(360.0 * phase)
    turn, lean = 5.0 * swing * cosine, min(5.0, 1.6 * speed)
    rotations = [
        compose(axis_rotation("z", turn), axis_rotation("y", lean)),
        compose(axis_rotation("y", -0.8 * lean), axis_rotation("z", -turn)),
    ]
    out = 4.0 + 22.0 * max(0.0, figure.girth - 1.0)
    for side in (1.0, -1.0):
        backward = side * cosine * swing
        rotations.append(
            compose(axis_rotation("x", side * out), axis_rotation("y", 24.0 * backward - swing - 0.8 * lean))
        )
        rotations.append(
            compose(axis_rotation("x", -0.5 * side * out), axis_rotation("y", -(9.0 + 10.0 * swing - 9.0 * backward)))
        )
    low, length = pelvis_drop(figure, phase, speed), stride_length(figure, speed)
    for k in range(2):
        rotations += [
            axis_rotation("y", angle) for angle in _leg(figure, phase + 0.5 * k, length, low, _walk_weight(speed))
        ]
    return tuple(rotations)


def lowest_sole(figure: Figure, rotations: Sequence[Quaternion]) -> float:
    """Return the height in metres of the lowest point of both soles above the base's origin."""
    heel, toes = (-0.036 * figure.height, 0.0, -figure.ankle), (0.115 * figure.height, 0.0, -figure.ankle)
    parts = forward_kinematics(((0.0, 0.0, 0.0), IDENTITY), figure.joints, rotations)
    feet = [placed for joint, placed in zip(figure.joints, parts[1:], strict=True) if joint.part.startswith("foot")]
    return min(origin[2] + rotate(turn, point)[2] for origin, turn in feet for point in (heel, toes))


def _walk_weight(speed: float) -> float:
    """Return the weight of the walking pose: 0 when standing, 1 from 0.5 m/s on."""
    return min(1.0, speed / 0.5)


def _smoothstep(u: float) -> float:
    u = max(0.0, min(1.0, u))
    return u * u * (3.0 - 2.0 * u)


def _leg(f: Figure, phase: float, length: float, pelvis_drop: float, walking: float) -> list[float]:
    """Return the angles of hip, knee and ankle, in degrees."""
    x, z, pitch = _ankle(f, phase - math.floor(phase), length)
    x, z, pitch = walking * x, f.ankle + walking * (z - f.ankle), walking * pitch
    dx, dz = x, z - (f.hip - pelvis_drop)
    longest = 0.999 * (f.thigh + f.shin)
    reach = math.sqrt(dx * dx + dz * dz)
    if reach > longest:
        dx, dz, reach = dx * longest / reach, dz * longest / reach, longest
    at_knee = (f.thigh * f.thigh + f.shin * f.shin - reach * reach) / (2.0 * f.thigh * f.shin)
    at_hip = (f.thigh * f.thigh + reach * reach - f.shin * f.shin) / (2.0 * f.thigh * reach)
    hip = -(exact.atan2_deg(dx, -dz) + _acos(at_hip))
    knee = 180.0 - _acos(at_knee)
    return [hip, knee, pitch - hip - knee]


def _acos(c: float) -> float:
    c = max(-1.0, min(1.0, c))
    return exact.atan2_deg(math.sqrt(1.0 - c * c), c)


def _about(x: float, dx: float, dz: float, pitch: float) -> tuple[float, float]:
    """Return the ankle's position when the foot is rotated by `pitch` (toes down) about a ground point at x."""
    s, c = exact.sin_cos_deg(pitch)
    return x + dx * c + dz * s, -dx * s + dz * c


def _ankle(f: Figure, p: float, length: float) -> tuple[float, float, float]:
    """Return the ankle's position ahead of the hip and above the ground, and the foot's pitch, at the leg's phase.

    The pitch is in degrees, toes down.
    """
    ball, heel = 0.112 * f.height, 0.036 * f.height
    strike = 0.205 * length
    lift, land = 44.0, -16.0
    if p < _DUTY:
        t = p / _DUTY
        x = strike - p * length
        if t < 0.14:
            pitch = land * (1.0 - _smoothstep(t / 0.14))
            return (*_about(x - heel, heel, f.ankle, pitch), pitch)
        rise = max(0.0, (t - 0.42) / 0.58)
        pitch = lift * rise * rise * (1.6 - 0.6 * rise)
        return (*_about(x + ball, -ball, f.ankle, pitch), pitch)
    u = (p - _DUTY) / (1.0 - _DUTY)
    x0, z0 = _about(strike - _DUTY * length + ball, -ball, f.ankle, lift)
    x1, z1 = _about(strike - heel, heel, f.ankle, land)
    slope = -0.5 * (1.0 - _DUTY) * length
    a, b = u * u * (3.0 - 2.0 * u), u * (1.0 - u)
    x = x0 + (x1 - x0) * a + slope * b * (1.0 - 2.0 * u)
    z = z0 + (z1 - z0) * _smoothstep(u * 1.15) + 0.05 * f.height * b * (1.0 - u)
    return x, z, lift + (land - lift) * _smoothstep(u * 1.25)
