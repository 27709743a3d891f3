"""Footsteps: positions of the feet on the ground of a person who stands, walks, runs, turns or stops.

A foot is put down at a place in the world and stays there until it is lifted, whatever the body does in the meantime.
The phase of the stride decides when: the left foot is put down at 0 and the right one at 0.5, each for the duty factor
of the gait (`body.gait`). While a foot is in the air, the place where it will come down is predicted from the motion
of the body. At a kerb it is put down on
the level of its middle or ball, whichever is higher.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from recipe_runtime.body.gait import Gait, Stride
from recipe_runtime.body.skeleton import SIDES

Ground = Callable[[float, float], float]  # height of the ground at x, y, metres in the world frame
Planar = tuple[float, float]

_HEEL, _MIDDLE, _BALL, _TOES = -0.045, 0.02, 0.07, 0.125  # metres ahead of the ankle for a height of 1 m
_STRIKE = 0.335  # of the way while a foot is on the ground: how much is before it is under the hips
_LONGEST = 0.82  # of the height of the hips: the largest distance between them and a foot on the ground
_TOE_OUT = (0.99619, 0.08716)  # cosine and sine of 5 degrees
_TURN = 0.35  # metres of way that a radian of turning on the spot is worth
_SLOW, _SLOW_TURN = 0.06, 0.15  # m/s and rad/s below which a person stands
_SLOWEST = 0.27  # strides per unit of time in which a foot that is in the air comes down
_CLIMB = 1.5  # m/s at which the height of a foothold follows a change of mind
_RESPONSE = 6.0  # m/s2 at which the gait follows the speed
_AWRY, _AWRY_COSINE = 0.045, 0.94  # a standing foot farther off than this (times the height) takes another step


class Foot:
    """A foot: immutable.

    Attributes:
        planted: Whether it is on the ground.
        lift: Phase of the leg at which it left the ground.
        x, y, z: Point of the ground under the ankle where it is, or was until it left the ground.
        hx, hy: Its direction there.
        ax, ay, az, ahx, ahy: The same where it comes down next; equal to those while it is on the ground.
    """

    __slots__ = ("ahx", "ahy", "ax", "ay", "az", "hx", "hy", "lift", "planted", "x", "y", "z")

    def __init__(
        self,
        *,
        planted: bool,
        lift: float,
        place: tuple[float, float, float, float, float],
        aim: tuple[float, float, float, float, float],
    ) -> None:
        self.planted, self.lift = planted, lift
        self.x, self.y, self.z, self.hx, self.hy = place
        self.ax, self.ay, self.az, self.ahx, self.ahy = aim

    @property
    def place(self) -> tuple[float, float, float, float, float]:
        """Where it is, or was until it left the ground."""
        return self.x, self.y, self.z, self.hx, self.hy

    def progress(self, phase: float) -> float:
        """Return the part of the swing that is over, at the phase of the leg; 0 on the ground."""
        if self.planted or phase <= self.lift:
            return 0.0
        return (phase - self.lift) / (1.0 - self.lift)


class Footsteps:
    """The gait of a person at a moment: immutable.

    Attributes:
        gait: Of the person.
        phase: Phase of the left leg, 0 to 1.
        stride: Stride at the speed that the gait is for.
        feet: Left and right.
        height: Height of the ground that bears the body, metres.
    """

    __slots__ = ("_settled", "feet", "gait", "height", "phase", "stride")

    def __init__(
        self, gait: Gait, phase: float, stride: Stride, feet: tuple[Foot, Foot], *, settled: bool = False
    ) -> None:
        self.gait, self.phase, self.stride, self.feet, self._settled = gait, phase, stride, feet, settled
        self.height = min(_level(feet[0], phase), _level(feet[1], _opposite(phase)))

    @classmethod
    def steady(
        cls, gait: Gait, phase: float, speed: float, place: Planar, heading: Planar, ground: Ground
    ) -> Footsteps:
        """The feet of a person who stands, or who has long walked at a speed.

        Args:
            gait: Of the person.
            phase: Phase of the left leg.
            speed: m/s; 0 if the person stands.
            place: Position of the body, metres.
            heading: Unit vector of its direction.
            ground: Height of the ground.
        """
        stride = gait.stride(speed)
        duty = stride.duty
        phase -= math.floor(phase)
        if speed < _SLOW:
            phase = duty - (0.02 if phase < 0.5 else 0.52)
        motion = _Motion(
            gait, place, heading, (speed * heading[0], speed * heading[1]), 0.0, stride, speed / stride.length
        )
        feet = []
        for (_, side), p in zip(SIDES, (phase, _opposite(phase)), strict=True):
            planted = p < duty or speed < _SLOW
            was = 0.0 if speed < _SLOW else -p * stride.length
            put = _foothold(motion.aim(side, 0.0, was), gait, ground)
            aim = put if planted else _foothold(motion.aim(side, 1.0 - p), gait, ground)
            feet.append(Foot(planted=planted, lift=duty, place=put, aim=aim))
        return cls(gait, phase, stride, (feet[0], feet[1]), settled=speed < _SLOW)

    def moved(
        self, place: Planar, heading: Planar, velocity: Planar, yaw_rate: float, seconds: float, ground: Ground
    ) -> Footsteps:
        """Return the feet some seconds later.

        Args:
            place: Position of the body then, metres.
            heading: Unit vector of its direction.
            velocity: m/s in the world frame.
            yaw_rate: rad/s.
            seconds: Time since this moment.
            ground: Height of the ground.
        """
        speed = math.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1])
        standing = speed < _SLOW and abs(yaw_rate) < _SLOW_TURN
        if standing and self._settled and self.stride.speed == speed:
            return self
        most = _RESPONSE * seconds
        pace = _towards(self.stride.speed, speed, most)
        stride = self.stride if pace == self.stride.speed else self.gait.stride(pace)
        gait, phase = self.gait, self.phase
        if standing and self.feet[0].planted and self.feet[1].planted:
            still = _Motion(gait, place, heading, velocity, 0.0, stride, 0.0)
            awry = self._awry(still)
            if awry is None:
                return self._at_rest(stride)
            phase = stride.duty if awry == 0 else stride.duty + 0.5
            phase -= math.floor(phase)
            rate = _SLOWEST / gait.unit_time
        else:
            rate = (speed + _TURN * abs(yaw_rate)) / stride.length
            if not (self.feet[0].planted and self.feet[1].planted):
                rate = max(rate, _SLOWEST / gait.unit_time)
        after = phase + rate * seconds
        motion = _Motion(gait, place, heading, velocity, yaw_rate, stride, rate)
        feet = (
            self._step(self.feet[0], 1.0, (phase, after), motion, seconds, ground),
            self._step(
                self.feet[1], -1.0, (_opposite(phase), _opposite(phase) + after - phase), motion, seconds, ground
            ),
        )
        return Footsteps(gait, after - math.floor(after), stride, feet)

    def _awry(self, motion: _Motion) -> int | None:
        """Return which foot of a standing person is farther from its place, if it is far."""
        worst, which = 1.0, None
        for k, foot in enumerate(self.feet):
            x, y, hx, hy = motion.aim(SIDES[k][1], 0.0, 0.0)
            dx, dy = (foot.x - x) / self.gait.figure.height, (foot.y - y) / self.gait.figure.height
            off = (dx * dx + dy * dy) / (_AWRY * _AWRY)
            if foot.hx * hx + foot.hy * hy < _AWRY_COSINE:
                off += 1.0
            if off > worst:
                worst, which = off, k
        return which

    def _at_rest(self, stride: Stride) -> Footsteps:
        """The standing person, ready to lift the foot whose turn it is."""
        phase = stride.duty - (0.02 if self.phase > 0.3 else 0.52)
        return Footsteps(self.gait, phase, stride, self.feet, settled=stride.speed < _SLOW)

    def _step(self, foot: Foot, side: float, phases: Planar, motion: _Motion, seconds: float, ground: Ground) -> Foot:
        """Return a foot after the phase of its leg has gone from one value to another."""
        before, after = phases
        if foot.planted:
            if after < motion.duty and not motion.overreached(foot):
                if foot.z == foot.az:
                    return foot
                x, y, z, hx, hy = foot.place
                place = (x, y, _towards(z, foot.az, _CLIMB * seconds), hx, hy)
                return Foot(planted=True, lift=foot.lift, place=place, aim=(x, y, foot.az, hx, hy))
            if after < 1.0:
                aim = _foothold(motion.aim(side, 1.0 - after), motion.gait, ground)
                return Foot(planted=False, lift=before, place=foot.place, aim=aim)
        elif after < 1.0:
            x, y, level, hx, hy = _foothold(motion.aim(side, 1.0 - after), motion.gait, ground)
            z = _towards(foot.az, level, _CLIMB * seconds)
            return Foot(planted=False, lift=foot.lift, place=foot.place, aim=(x, y, z, hx, hy))
        x, y, level, hx, hy = _foothold(motion.aim(side, 1.0 - after), motion.gait, ground)
        z = foot.az if not foot.planted else level
        return Foot(planted=True, lift=motion.duty, place=(x, y, z, hx, hy), aim=(x, y, level, hx, hy))


class _Motion:
    """The motion of the body at a moment, from which footholds are predicted."""

    __slots__ = ("_ahead", "_heading", "_out", "_place", "_rate", "_strike", "_travel", "_yaw_rate", "duty", "gait")

    def __init__(
        self, gait: Gait, place: Planar, heading: Planar, velocity: Planar, yaw_rate: float, stride: Stride, rate: float
    ) -> None:
        self.gait, self._place, self._heading = gait, place, heading
        self._yaw_rate, self._rate = yaw_rate, rate
        speed = math.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1])
        self._ahead = (velocity[0] / speed, velocity[1] / speed) if speed > _SLOW else heading
        self._travel = speed / rate if rate > 0.0 else 0.0  # metres a stride
        self.duty = stride.duty
        self._strike = _STRIKE * stride.duty * stride.length * min(1.0, stride.speed / 0.4)
        narrow = min(1.0, 2.0 * stride.speed / gait.unit_speed) + stride.running
        self._out = gait.figure.height * (0.055 - 0.02 * narrow)

    def aim(self, side: float, strides: float, offset: float = 0.0) -> tuple[float, float, float, float]:
        """Return the place and the direction of a foot that is put down in a number of strides.

        Args:
            side: 1 for the left foot, -1 for the right.
            strides: Time until then.
            offset: Metres by which the body is farther ahead.
        """
        hx, hy = self._heading
        half = 0.0 if self._rate <= 0.0 else 0.5 * self._yaw_rate * strides / self._rate
        half = max(-0.4, min(0.4, half))
        size = 1.0 + half * half
        c, s = (1.0 - half * half) / size, 2.0 * half / size
        hx, hy = c * hx - s * hy, s * hx + c * hy
        ahead = self._travel * strides + self._strike + offset
        x = self._place[0] + ahead * self._ahead[0] - side * self._out * hy
        y = self._place[1] + ahead * self._ahead[1] + side * self._out * hx
        c, s = _TOE_OUT[0], side * _TOE_OUT[1]
        return x, y, c * hx - s * hy, s * hx + c * hy

    def overreached(self, foot: Foot) -> bool:
        """Return whether a foot on the ground is so far from the body that it must be lifted."""
        dx, dy = foot.x - self._place[0], foot.y - self._place[1]
        longest = _LONGEST * self.gait.figure.hip
        return dx * dx + dy * dy > longest * longest


def _foothold(
    aim: tuple[float, float, float, float], gait: Gait, ground: Ground
) -> tuple[float, float, float, float, float]:
    """Return place and direction of a foot on the ground, so far from the edge of a kerb that it is not inside."""
    x, y, hx, hy = aim
    size = gait.figure.height
    heel, toes = (ground(x + at * size * hx, y + at * size * hy) for at in (_HEEL, _TOES))
    if heel == toes:
        return x, y, heel, hx, hy
    ankle, ball = (ground(x + at * size * hx, y + at * size * hy) for at in (_MIDDLE, _BALL))
    level = max(ankle, ball)
    shift = 0.0
    if heel > level:
        shift = (_MIDDLE - _HEEL) * size
    elif toes > level:
        shift = (_BALL - _TOES) * size
    return x + shift * hx, y + shift * hy, level, hx, hy


def _level(foot: Foot, phase: float) -> float:
    """Return the height of the ground that a foot is on or over, on its way from one foothold to the next."""
    if foot.z == foot.az:
        return foot.z
    u = foot.progress(phase)
    if foot.az < foot.z:  # the other leg bears the body until this one is nearly down
        u = max(0.0, 1.6 * u - 0.6)
    return foot.z + (foot.az - foot.z) * u * u * (3.0 - 2.0 * u)


def _opposite(phase: float) -> float:
    return phase + 0.5 if phase < 0.5 else phase - 0.5


def _towards(value: float, target: float, most: float) -> float:
    return value + max(-most, min(most, target - value))
