"""How a two-wheeler's rider sits: hands on the grips, feet on pedals that turn or on pegs, eyes on the road."""

from __future__ import annotations

from recipe_compiler.ir import exact

from recipe_runtime.body.kinematics import Quaternion, Vector, about, back, limb, then, turned
from recipe_runtime.body.skeleton import SIDES, Bike

_WALKING = 0.9  # m/s
_DEVELOPMENT = 4.2  # metres that a bicycle goes in one turn of its cranks


def halting(speed: float) -> float:
    """How much of a rider's left foot is on the ground: all of it at rest, nothing from walking pace on."""
    return max(0.0, 1.0 - speed / _WALKING)


def resting_lean(bike: Bike, halt: float) -> float:
    """Degrees that the machine leans to the left while the foot is down."""
    return halt * (3.0 if bike.motor else 7.0)


def pose(bike: Bike, *, steer: float, gone: float, halt: float = 0.0) -> tuple[Quaternion, ...]:
    """The turns of `Bike.joints`, in their order; the steering in degrees to the left, metres gone, and `halting`."""
    spin = about("y", _degrees(gone, 6.283185307179586 * bike.wheel))
    crank = _degrees(gone, _DEVELOPMENT)
    fork = about("z", steer)
    turns = [fork, spin, spin]
    if not bike.motor:
        turns.append(about("y", crank))
    bend = 16.0 if bike.motor else 30.0
    pelvis, torso = about("y", 0.35 * bend), about("y", 0.65 * bend)
    turns += [pelvis, torso, about("y", 4.0 - bend)]
    for _, side in SIDES:
        turns += _arm(bike, side, fork, then(pelvis, torso), pelvis)
    for _, side in SIDES:
        turns += _leg(bike, side, crank, pelvis, halt if side > 0 else 0.0)
    return tuple(turns)


def _degrees(gone: float, turn: float) -> float:
    turns = gone / turn
    return 360.0 * (turns - int(turns))


def _arm(bike: Bike, side: float, fork: Quaternion, torso: Quaternion, pelvis: Quaternion) -> list[Quaternion]:
    """Shoulder and elbow, so that the palm is on the grip."""
    f = bike.figure
    chest = _plus(bike.hips, turned(pelvis, (0.0, 0.0, f.chest - f.hip)))
    shoulder = _plus(chest, turned(torso, (0.0, side * f.shoulder, f.shoulders - f.chest)))
    x, y, z = bike.grips
    palm = _plus(bike.steering, turned(fork, (x, side * y, z + 0.02)))
    reach = turned(back(torso), _minus(palm, shoulder))
    return list(limb(reach, f.upper_arm, 0.19 * f.height, (-0.3, 0.7 * side, -0.7), knee=False))


def _leg(bike: Bike, side: float, crank: float, pelvis: Quaternion, halt: float) -> list[Quaternion]:
    """Hip, knee and ankle, so that the ball of the foot is on the pedal, or on the ground."""
    f = bike.figure
    hip = _plus(bike.hips, turned(pelvis, (0.0, side * 0.05 * f.height, 0.0)))
    sole, pitch = pedal_of(bike, side, crank)
    if halt > 0.0:
        ground, down = stop_of(bike)
        dx, dy, dz = _minus(ground, sole)
        sole = _plus(sole, (halt * dx, halt * dy, halt * dz))
        pitch += halt * (down - pitch)
    foot = about("y", pitch)
    ankle = _plus(sole, turned(foot, (-0.085 * f.height, 0.0, f.ankle)))
    reach = turned(back(pelvis), _minus(ankle, hip))
    thigh, shin = limb(reach, f.thigh, f.shin, (1.0, 0.12 * side, 0.15), knee=True)
    return [thigh, shin, then(back(then(then(pelvis, thigh), shin)), foot)]


def stop_of(bike: Bike) -> tuple[Vector, float]:
    """Where the ball of the left foot rests on the ground beside a leaning machine, and the foot's pitch."""
    y = 0.24
    s, c = exact.sin_cos_deg(resting_lean(bike, 1.0))
    x, _, _ = bike.hips
    pitch = 0.0 if bike.motor else 38.0
    tip = 0.031 * bike.figure.height * exact.sin_deg(pitch)  # the toes are lower than the ball
    return (x + 0.16, y, y * s / c + tip), pitch


def pedal_of(bike: Bike, side: float, crank: float) -> tuple[Vector, float]:
    """Where the sole of a foot rests, in the chassis' frame, and the foot's pitch (toes down, degrees)."""
    if bike.motor:
        return (0.03 * bike.wheelbase, side * 0.19, bike.wheel + 0.03), 6.0
    s, c = exact.sin_cos_deg(crank + (0.0 if side > 0 else 180.0))
    x, _, z = bike.crank
    return (x + bike.pedals * s, side * 0.13, z + bike.pedals * c + 0.012), 10.0 - 8.0 * c


def _plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
