"""How a pedestrian's joints move as it walks: a pose as a function of phase and speed.

The phase counts strides: at 0 the left heel strikes, at 0.5 the right. It advances with the distance covered, so a
foot on the ground stays where it is. Feet are placed first and legs follow by inverse kinematics; the pelvis sinks
when the legs are spread, as it must. Proportions after D. A. Winter, Biomechanics and Motor Control of Human Movement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact

from recipe_runtime.body.kinematics import STILL, Quaternion, about, place, then, turned
from recipe_runtime.body.skeleton import Figure

_DUTY = 0.61  # part of a stride during which a foot is on the ground


def stride(figure: Figure, speed: float) -> float:
    """Length of a stride (two steps) in metres at a speed in m/s.

    People of all sizes walk alike at one Froude number, so short legs step quicker (R. McN. Alexander, 1976).
    """
    pace = speed / math.sqrt(9.81 * figure.hip)
    return figure.hip * min(0.75 + 1.85 * pace, 2.3)


def sink(figure: Figure, phase: float, speed: float) -> float:
    """How far the pelvis sinks, in metres: most when the legs are spread."""
    _, twice = exact.sin_cos_deg(720.0 * (phase - 0.05))
    deepest = min(0.029 * stride(figure, speed), 0.029 * figure.height)
    return _walking(speed) * (0.003 * figure.height + deepest * 0.5 * (1.0 + twice))


def pose(figure: Figure, phase: float, speed: float) -> tuple[Quaternion, ...]:
    """The turns of `Figure.joints`, in their order, at a phase; at speed 0 it stands."""
    swing = min(1.25, speed / 1.4)
    _, cosine = exact.sin_cos_deg(360.0 * phase)
    turn, lean = 5.0 * swing * cosine, min(5.0, 1.6 * speed)
    turns = [then(about("z", turn), about("y", lean)), then(about("y", -0.8 * lean), about("z", -turn))]
    out = 4.0 + 22.0 * max(0.0, figure.girth - 1.0)
    for side in (1.0, -1.0):
        back = side * cosine * swing
        turns.append(then(about("x", side * out), about("y", 24.0 * back - swing - 0.8 * lean)))
        turns.append(then(about("x", -0.5 * side * out), about("y", -(9.0 + 10.0 * swing - 9.0 * back))))
    low, length = sink(figure, phase, speed), stride(figure, speed)
    for k in range(2):
        turns += [about("y", angle) for angle in _leg(figure, phase + 0.5 * k, length, low, _walking(speed))]
    return tuple(turns)


def tread(figure: Figure, turns: Sequence[Quaternion]) -> float:
    """Height of the lowest point of both soles above the base's origin, in a pose."""
    heel, toes = (-0.036 * figure.height, 0.0, -figure.ankle), (0.115 * figure.height, 0.0, -figure.ankle)
    parts = place(((0.0, 0.0, 0.0), STILL), figure.joints, turns)
    feet = [placed for joint, placed in zip(figure.joints, parts[1:], strict=True) if joint.part.startswith("foot")]
    return min(origin[2] + turned(turn, point)[2] for origin, turn in feet for point in (heel, toes))


def _walking(speed: float) -> float:
    """0 for who stands, 1 from half a metre a second on."""
    return min(1.0, speed / 0.5)


def _smooth(u: float) -> float:
    u = max(0.0, min(1.0, u))
    return u * u * (3.0 - 2.0 * u)


def _leg(f: Figure, phase: float, length: float, sink: float, walking: float) -> list[float]:
    """Angles of hip, knee and ankle, in degrees."""
    x, z, pitch = _ankle(f, phase - math.floor(phase), length)
    x, z, pitch = walking * x, f.ankle + walking * (z - f.ankle), walking * pitch
    dx, dz = x, z - (f.hip - sink)
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
    """Where the ankle is when the foot turns by `pitch` (toes down) about a point of the ground at x."""
    s, c = exact.sin_cos_deg(pitch)
    return x + dx * c + dz * s, -dx * s + dz * c


def _ankle(f: Figure, p: float, length: float) -> tuple[float, float, float]:
    """Ankle before the hip and above the ground, and the foot's pitch (toes down, degrees), at a leg's own phase."""
    ball, heel = 0.112 * f.height, 0.036 * f.height
    strike = 0.205 * length
    lift, land = 44.0, -16.0
    if p < _DUTY:
        t = p / _DUTY
        x = strike - p * length
        if t < 0.14:
            pitch = land * (1.0 - _smooth(t / 0.14))
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
    z = z0 + (z1 - z0) * _smooth(u * 1.15) + 0.05 * f.height * b * (1.0 - u)
    return x, z, lift + (land - lift) * _smooth(u * 1.25)
