"""Poses of people who stand, walk and run, all at once.

The feet are where `body.footsteps` puts them. While a foot is on the ground it rolls about the heel, then about the
ball; the legs follow by inverse kinematics, and the pelvis sinks so that they reach the ground. Arms swing against
the legs, and are bent in running. Proportions and angles of walking are from D. A. Winter, Biomechanics and Motor
Control of Human Movement; those of running from T. F. Novacheck, The biomechanics of running, Gait and Posture 7, 1998.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.body import exact_arrays
from recipe_runtime.body.exact_arrays import Floats
from recipe_runtime.body.footsteps import Footsteps, Ground, Planar
from recipe_runtime.body.gait import Gait
from recipe_runtime.body.kinematics import PartPose, compose
from recipe_runtime.body.poses import Components4, Poses, SkeletonGroup, about, about_by_angle
from recipe_runtime.body.skeleton import Figure

HEAD_TURN = 70.0  # degrees to either side
_HEAD_RATE = 150.0  # degrees/s
_HEEL, _BALL = 0.036, 0.117  # where the sole rolls, metres behind and ahead of the ankle for a height of 1 m
_LAND, _LIFT = -16.0, 44.0  # pitch of the foot where it is put down and lifted, degrees, toes down

_SEAT, _SEATED = 0.45, 0.062  # height of a seat, metres; of the hips above it, for a height of 1 m
_SHIFT = 0.022  # how far a standing person moves the hips over one leg, for a height of 1 m

Row = tuple[float, ...]


def row(footsteps: Footsteps, place: Planar, heading: Planar, head_yaw: float = 0.0) -> Row:
    """Return the state of a person as `Walkers.pose` takes it.

    Args:
        footsteps: The feet.
        place: Position of the body, metres.
        heading: Unit vector of its direction.
        head_yaw: Degrees by which the head is turned to the left.
    """
    s = footsteps
    left, right = s.feet
    opposite = s.phase + 0.5 if s.phase < 0.5 else s.phase - 0.5
    return (
        *(*place, *heading, s.height, s.phase, s.stride.speed, s.stride.duty, s.stride.running, head_yaw),
        *(s.phase, float(left.planted), left.progress(s.phase), left.x, left.y, left.z, left.hx, left.hy),
        *(left.ax, left.ay, left.az, left.ahx, left.ahy),
        *(opposite, float(right.planted), right.progress(opposite), right.x, right.y, right.z, right.hx, right.hy),
        *(right.ax, right.ay, right.az, right.ahx, right.ahy),
    )


def steady_pose(figure: Figure, phase: float, speed: float) -> list[PartPose]:
    """Return the poses of the base and all joints of a person at the origin, on the level.

    Args:
        figure: Proportions of the person.
        phase: Number of strides since the left foot was put down.
        speed: m/s; 0 if the person stands.
    """
    place, heading = (0.0, 0.0), (1.0, 0.0)
    feet = Footsteps.steady(Gait(figure), phase, speed, place, heading, _level_ground)
    return Walkers([figure]).pose([row(feet, place, heading)], _level_ground).of_first()


def _level_ground(_x: float, _y: float) -> float:
    return 0.0


def turn_head(yaw: float, wanted: float, seconds: float) -> float:
    """Return the yaw of a head, degrees to the left, after it has turned towards a wanted one for some seconds."""
    most = _HEAD_RATE * seconds
    wanted = max(-HEAD_TURN, min(HEAD_TURN, wanted))
    return yaw + max(-most, min(most, wanted - yaw))


_BODY, _FOOT = 10, 13  # numbers of a row for the body and for each foot


@dataclass(frozen=True)
class _Body:
    """State of the bodies of N people; each array [..., N]."""

    x: Floats
    y: Floats
    hx: Floats
    hy: Floats
    height: Floats
    phase: Floats
    pace: Floats  # the speed at which an adult with this gait would walk, m/s
    duty: Floats
    running: Floats
    head_yaw: Floats
    walking: Floats  # 0 when standing, 1 from 0.5 m/s on


@dataclass(frozen=True)
class _Feet:
    """State of the feet of N people, left and right; each array [2, ..., N]."""

    phase: Floats
    planted: NDArray[np.bool_]
    progress: Floats
    place: Floats  # [5, 2, ..., N]: x, y, z and direction
    aim: Floats


@dataclass(frozen=True)
class _Ankles:
    """Positions of the ankles in the world frame, and how the feet are turned; each array [2, ..., N]."""

    x: Floats
    y: Floats
    z: Floats
    hx: Floats
    hy: Floats
    sine: Floats  # of half the pitch
    cosine: Floats


class Walkers:
    """People whose poses are computed together."""

    def __init__(self, figures: Sequence[Figure]) -> None:
        self._group = SkeletonGroup([figure.joints for figure in figures])
        self._height = np.array([figure.height for figure in figures])
        self._hip = np.array([figure.hip for figure in figures])
        self._ankle = np.array([figure.ankle for figure in figures])
        self._thigh = np.array([figure.thigh for figure in figures])
        self._shin = np.array([figure.shin for figure in figures])
        self._out = np.array([4.0 + 22.0 * max(0.0, figure.girth - 1.0) for figure in figures])
        self._stoop = np.array([figure.stoop for figure in figures])
        self._phone = np.array([figure.phone for figure in figures])
        self._sits = np.array([float(figure.sits) for figure in figures])
        self._talks = np.array([float(figure.talks) for figure in figures])
        self._scale = np.array([3.0 / Gait(figure).unit_speed for figure in figures])

    def pose(self, rows: Sequence[Sequence[float]] | Sequence[Sequence[Sequence[float]]], ground: Ground) -> Poses:
        """Return the poses of all parts, in the order of `Figure.joints` after the base.

        Args:
            rows: The state of each person, or, for each of some moments, the state of each person.
            ground: Height of the ground.
        """
        data = np.ascontiguousarray(np.moveaxis(np.array(rows), -1, 0))
        pace = data[6] * self._scale
        x, y, hx, hy, height, phase, _, duty, running, head_yaw = data[:_BODY]
        walking = np.minimum(1.0, pace / 0.5)
        body = _Body(x, y, hx, hy, height, phase, pace, duty, running, head_yaw, walking)
        foot = data[_BODY:].reshape(2, _FOOT, *x.shape).swapaxes(0, 1)
        feet = _Feet(foot[0], foot[1] > 0.0, foot[2], foot[3:8], foot[8:13])
        ankles = self._ankles(body, feet)
        _lift_over_kerbs(ankles, feet, self._height, self._ankle, ground)
        ahead = self._sits * 0.96 * self._thigh  # the feet of a person who sits, before the hips
        ankles = replace(ankles, x=ankles.x + ahead * hx, y=ankles.y + ahead * hy)
        shift = (
            _SHIFT
            * self._height
            * (1.0 - self._sits)
            * (1.0 - body.walking)
            * exact_arrays.sin_cos_deg(360.0 * phase)[1]
        )
        x, y = x - shift * hy, y + shift * hx
        body = replace(body, x=x, y=y)
        aside_x, aside_y = -body.hy * (0.05 * self._height), body.hx * (0.05 * self._height)
        hip_x, hip_y = np.stack([x + aside_x, x - aside_x]), np.stack([y + aside_y, y - aside_y])
        base = self._base_height(body, feet, ankles, hip_x, hip_y)
        base = base + self._sits * (height + _SEAT + _SEATED * self._height - self._hip - base)
        joints = np.empty((4, 12, *x.shape))
        self._upper_body(body, joints)
        self._legs(body, ankles, (hip_x, hip_y, base + self._hip), joints)
        yaw = about_by_angle("z", body.hy, body.hx)
        return self._group.forward_kinematics((body.x, body.y, base), yaw, joints)

    def _ankles(self, body: _Body, feet: _Feet) -> _Ankles:
        """Place the ankles: over the rolling foot on the ground, or on the way to the next foothold."""
        weight = body.walking
        land = weight * (_LAND + 10.0 * body.running)
        lift = weight * (_LIFT + 22.0 * np.maximum(0.0, np.minimum(1.0, body.pace / 0.7 - 2.0)))
        x, y, level, hx, hy = feet.place
        ax, ay, aim, ahx, ahy = feet.aim
        behind = ((body.x - x) * hx + (body.y - y) * hy) / self._hip
        stretched = 50.0 * np.minimum(1.0, np.maximum(0.0, (behind - 0.27) / 0.53))  # at any speed
        t = np.minimum(1.0, feet.phase / body.duty)
        rise = np.maximum(0.0, (t - 0.42) / 0.58)
        stance = np.where(t < 0.14, land * (1.0 - _smooth(t / 0.14)), lift * rise * rise * (1.6 - 0.6 * rise))
        stance = np.maximum(stance, np.where(stretched > 0.0, stretched, stance))
        u = feet.progress
        bump = u * (1.0 - u)
        lift = np.maximum(lift, stretched * (1.0 - u))
        swing = (
            lift + (land - lift) * _smooth(u * (1.25 - 0.15 * body.running)) + 170.0 * body.running * bump * (1.0 - u)
        )
        pitch = np.where(feet.planted, stance, swing)
        s, c = exact_arrays.sin_cos_deg(np.stack([pitch, lift, land + 0.0 * u]) / 2.0)
        sine, cosine = 2.0 * s * c, c * c - s * s
        heel, ball = _HEEL * self._height, -_BALL * self._height
        pivot = np.where(stance < 0.0, heel, ball)
        ahead, up = _rolled(pivot, self._ankle, sine[0], cosine[0])
        x0, z0 = _rolled(ball, self._ankle, sine[1], cosine[1])
        x1, z1 = _rolled(heel, self._ankle, sine[2], cosine[2])
        part = u * u * (3.0 - 2.0 * u)
        swing_x, swing_y = x + x0 * hx, y + x0 * hy
        swing_x = swing_x + (ax + x1 * ahx - swing_x) * part
        swing_y = swing_y + (ay + x1 * ahy - swing_y) * part
        high = (1.0 - u) * (0.05 + body.running * (0.25 + 0.22 * body.pace)) + 0.07 * (1.0 - weight) + 0.05 * u
        hump = self._height * bump * high
        early = np.where(aim > level, _smooth(2.2 * u), _smooth(1.8 * u - 0.8))
        swing_z = z0 + (z1 - z0) * _smooth(u * 1.15) + hump + level + (aim - level) * early
        dx, dy = hx + (ahx - hx) * part, hy + (ahy - hy) * part
        size = np.maximum(1e-9, np.sqrt(dx * dx + dy * dy))  # a foot that turns right round has no direction halfway
        on = feet.planted
        return _Ankles(
            x=np.where(on, x + ahead * hx, swing_x),
            y=np.where(on, y + ahead * hy, swing_y),
            z=np.where(on, level + up, swing_z),
            hx=np.where(on, hx, dx / size),
            hy=np.where(on, hy, dy / size),
            sine=s[0],
            cosine=c[0],
        )

    def _base_height(self, body: _Body, feet: _Feet, ankles: _Ankles, hip_x: Floats, hip_y: Floats) -> Floats:
        """Return the height of the base: lowest when the legs are spread or, in running, when one bears the body.

        The legs reach every foot on the ground, and feet in the air the less, the longer they will be there.
        """
        run = body.running
        lowest = np.stack([body.phase - 0.05, body.phase - body.duty / 2.0])
        walk, bounce = 0.5 * (1.0 + exact_arrays.sin_cos_deg(720.0 * lowest)[1])
        spread = 0.003 * self._height + walk * np.minimum(0.045 * body.pace, 0.029 * self._height)
        sunk = self._height * (0.014 + 0.036 * bounce)
        wanted = body.height - body.walking * (spread + run * (sunk - spread))
        dx, dy = ankles.x - hip_x, ankles.y - hip_y
        longest = 0.999 * (self._thigh + self._shin)
        tall = np.sqrt(np.maximum(longest * longest - dx * dx - dy * dy, 0.16 * longest * longest))
        u = feet.progress
        slack = np.where(feet.planted, 0.0, self._height * np.minimum(u, 1.0 - u))
        reach = ankles.z + tall + slack - self._hip
        base: Floats = np.minimum(wanted, np.minimum(reach[0], reach[1]))
        return base

    def _upper_body(self, body: _Body, joints: Floats) -> None:
        """Set the rotations of torso, head and arms."""
        run, swing = body.running, np.minimum(1.25, body.pace / 1.4)
        cosine = exact_arrays.sin_cos_deg(360.0 * body.phase)[1]
        turn = (5.0 + 4.0 * run) * swing * cosine
        lean = np.minimum(5.0, 1.6 * body.pace) + 5.0 * run + self._stoop
        still = (
            (1.0 - self._sits) * (1.0 - body.walking) * cosine
        )  # weight on one leg: hips aside, the trunk upright over them
        phone, other = self._phone + 0.0 * turn, 1.0 - self._phone
        backward = cosine * swing
        forward = -swing - 0.8 * lean
        bent = 9.0 + 10.0 * swing + 66.0 * run
        amplitude, fold = 24.0 + 10.0 * run, 9.0 + 3.0 * run
        sits, talks = self._sits, self._talks * (1.0 - body.walking)  # hands on the knees; a gesture
        angles = np.stack(
            [
                turn,
                lean,
                -0.8 * lean,
                body.head_yaw - turn,
                self._out + 0.0 * turn,
                amplitude * backward + forward + 12.0 * run - 14.0 * sits - 8.0 * talks,
                other * (-amplitude * backward + forward + 12.0 * run - 14.0 * sits - 24.0 * talks) - 70.0 * phone,
                -0.5 * self._out + 0.0 * turn,
                fold * backward - bent - 36.0 * sits - 45.0 * talks,
                other * (-fold * backward - bent - 36.0 * sits - 78.0 * talks) - 145.0 * phone,
                10.0 * run,
                other * self._out + 50.0 * phone,
                -0.5 * other * self._out + 0.0 * turn,
                other * 10.0 * run - 40.0 * phone,
                2.5 * still,
            ]
        )
        s, c = exact_arrays.sin_cos_deg(angles / 2.0)

        def both(first: str, a: int, second: str, b: int, sign: float = 1.0) -> Components4:
            return compose(about(first, sign * s[a], c[a]), about(second, s[b], c[b]))

        inward = about("z", -s[10], c[10])  # of the forearm of a runner
        rotations = (
            compose(both("z", 0, "y", 1), about("x", s[14], c[14])),
            compose(both("y", 2, "z", 3), about("x", -s[14], c[14])),
            both("x", 4, "y", 5),
            compose(inward, both("x", 7, "y", 8)),
            both("x", 11, "y", 6, -1.0),
            compose(about("z", s[13], c[13]), both("x", 12, "y", 9, -1.0)),
        )
        for joint, rotation in enumerate(rotations):
            for axis in range(4):
                joints[axis, joint] = rotation[axis]

    def _legs(self, body: _Body, ankles: _Ankles, hip: tuple[Floats, Floats, Floats], joints: Floats) -> None:
        """Set the rotations of hips, knees and ankles so that the ankles are where they should be."""
        dx, dy, tz = ankles.x - hip[0], ankles.y - hip[1], ankles.z - hip[2]
        tx, ty = dx * ankles.hx + dy * ankles.hy, dy * ankles.hx - dx * ankles.hy
        down = np.sqrt(ty * ty + tz * tz)
        aside = about_by_angle("x", ty / down, -tz / down)
        away = np.sqrt(tx * tx + down * down)
        thigh, shin = self._thigh, self._shin
        reach = np.minimum(away, 0.999 * (thigh + shin))
        at_knee = (thigh * thigh + shin * shin - reach * reach) / (2.0 * thigh * shin)
        at_hip = (thigh * thigh + reach * reach - shin * shin) / (2.0 * thigh * reach)
        at_knee, at_hip = np.maximum(-1.0, np.minimum(1.0, at_knee)), np.maximum(-1.0, np.minimum(1.0, at_hip))
        knee_sine, hip_sine = np.sqrt(1.0 - at_knee * at_knee), np.sqrt(1.0 - at_hip * at_hip)
        c, s = down / away, tx / away
        flexion = about_by_angle("y", -(s * at_hip + c * hip_sine), c * at_hip - s * hip_sine)
        knee = about_by_angle("y", knee_sine, -at_knee)
        turned = about_by_angle(
            "z", ankles.hy * body.hx - ankles.hx * body.hy, ankles.hx * body.hx + ankles.hy * body.hy
        )
        leg = compose(turned, compose(aside, flexion))
        bent = compose(flexion, knee)
        straight = (-bent[0], -bent[1], -bent[2], bent[3])
        level = compose((-aside[0], aside[1], aside[2], aside[3]), about("y", ankles.sine, ankles.cosine))
        foot = compose(straight, level)
        for axis in range(4):
            joints[axis, 6::3] = leg[axis]
            joints[axis, 7::3] = knee[axis]
            joints[axis, 8::3] = foot[axis]


def _rolled(pivot: Floats, ankle: Floats, sine: Floats, cosine: Floats) -> tuple[Floats, Floats]:
    """Return how far the ankle is ahead of its place over the flat foot, and its height, when the foot has rolled.

    Args:
        pivot: The ankle's distance ahead of the point of the sole about which the foot rolls.
        ankle: Height of the ankle above the sole.
        sine: Of the pitch, toes down.
        cosine: Of the pitch.
    """
    return pivot * cosine + ankle * sine - pivot, ankle * cosine - pivot * sine


def _smooth(u: Floats) -> Floats:
    u = np.maximum(0.0, np.minimum(1.0, u))
    result: Floats = u * u * (3.0 - 2.0 * u)
    return result


def _lift_over_kerbs(ankles: _Ankles, feet: _Feet, height: Floats, ankle: Floats, ground: Ground) -> None:
    """Raise feet on their way between two levels so that no sole is inside the ground, in place."""
    for foot in map(tuple, np.argwhere((feet.place[2] != feet.aim[2]) & ~feet.planted).tolist()):
        x, y, hx, hy = (float(a[foot]) for a in (ankles.x, ankles.y, ankles.hx, ankles.hy))
        s, c = float(ankles.sine[foot]), float(ankles.cosine[foot])
        s, c = 2.0 * s * c, c * c - s * s
        size, up = float(height[foot[-1]]), float(ankle[foot[-1]])
        for at, low in ((-1.3 * _HEEL, up), (0.5 * _BALL, up), (1.1 * _BALL, up), (1.1 * _BALL, 0.3 * up)):
            ahead, sole = at * size * c - low * s, -at * size * s - low * c
            level = ground(x + ahead * hx, y + ahead * hy)
            ankles.z[foot] = max(float(ankles.z[foot]), level - sole + 0.01)
