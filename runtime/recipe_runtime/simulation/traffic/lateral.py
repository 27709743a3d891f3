"""Lateral motion of vehicles: smooth changes of the offset from their path.

A change of the offset is a quintic polynomial in time. It begins with the lateral speed and acceleration of the moment
and ends at rest, so a change may be revised at any time. Sources: Q. Wang, Z. Li, L. Li, "Investigation of
Discretionary Lane-Change Characteristics Using Next-Generation Simulation Data Sets", Journal of Intelligent
Transportation Systems 18 (2014): recorded lane changes are approximately quintic; M. Werling et al., "Optimal
Trajectory Generation for Dynamic Street Scenarios in a Frenet Frame", ICRA 2010: quintics minimise the lateral jerk.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from recipe_runtime.body.skeleton import BUS, MOTORCYCLE, SCOOTER, TRUCK

PEAK = 5.7736  # greatest acceleration of a quintic between two states of rest: 10 / sqrt(3), times distance / time^2
_STREET = _REVISED = 1.6  # m/s2, greatest lateral acceleration on streets, and of changes that are revised
_MOTORWAY, _MOTORWAYS = (
    0.95,
    {BUS: 0.6, TRUCK: 0.6, MOTORCYCLE: 1.15, SCOOTER: 1.15},
)  # m/s2, and on roads with several lanes
_CURVATURE = 0.12  # 1/m, of a slow vehicle's path, whose steering angle is the limit
_SAMPLES, _STRETCH, _TRIES = 24, 1.1, 24  # of a change that begins in motion, whose duration is found by trial
_TOLERANCE = 1.05  # its greatest acceleration, relative to `_REVISED`


@dataclass(frozen=True, slots=True)
class Quintic:
    """An offset that changes from some state of motion to rest.

    Attributes:
        coefficients: Of the polynomial in time relative to the duration, metres, constant term first.
        duration: Seconds.
    """

    coefficients: tuple[float, float, float, float, float, float]
    duration: float

    @classmethod
    def to_rest(cls, state: tuple[float, float, float], target: float, duration: float) -> Quintic:
        """Return the change from a state (m, m/s, m/s2) to rest at a target after some seconds."""
        start, speed, half = state[0], state[1] * duration, 0.5 * state[2] * duration * duration
        way = target - start - speed - half
        rate, change = -speed - 2.0 * half, -2.0 * half
        third = 10.0 * way - 4.0 * rate + 0.5 * change
        fourth = -15.0 * way + 7.0 * rate - change
        return cls((start, speed, half, third, fourth, 6.0 * way - 3.0 * rate + 0.5 * change), duration)

    def offset(self, seconds: float) -> float:
        """Return the offset at a time, metres."""
        u, (a, b, c, d, e, f) = min(seconds / self.duration, 1.0), self.coefficients
        return a + u * (b + u * (c + u * (d + u * (e + u * f))))

    def at(self, seconds: float) -> tuple[float, float, float]:
        """Return offset, lateral speed and lateral acceleration at a time: m, m/s, m/s2."""
        u, (_, b, c, d, e, f) = min(seconds / self.duration, 1.0), self.coefficients
        speed = (b + u * (2.0 * c + u * (3.0 * d + u * (4.0 * e + u * 5.0 * f)))) / self.duration
        acceleration = (2.0 * c + u * (6.0 * d + u * (12.0 * e + u * 20.0 * f))) / (self.duration * self.duration)
        return self.offset(seconds), speed, acceleration


class Lateral:
    """The lateral motion of one vehicle. Offsets are metres to the left of its path.

    Attributes:
        target: Desired offset.
        line: Offset that the vehicle should have now.
        slope: Change of `line` in each metre ahead.
    """

    def __init__(self, shape: Mapping[str, float], offset: float, *, street: bool) -> None:
        """Begin at rest.

        Args:
            shape: The vehicle's shape.
            offset: Its offset.
            street: Whether the road has one lane in each direction.
        """
        self._comfort = _STREET if street else _MOTORWAYS.get(int(shape["body"]), _MOTORWAY)
        self._slow = math.sqrt(self._comfort / _CURVATURE)  # m/s below which the steering angle is the limit
        self.stay(offset)

    def stay(self, offset: float) -> None:
        """Be at rest at an offset."""
        self.target = self.line = offset
        self.slope = 0.0
        self._curve: Quintic | None = None
        self._clock = 0.0  # seconds since the beginning of the change; slower than time if the vehicle is slow

    def move_to(self, target: float) -> None:
        """Begin a change towards an offset, or continue it."""
        if target != self.target:
            self._curve, self.target, self._clock = self._towards(target), target, 0.0

    def length(self, metres: float, speed: float) -> float:
        """Return the metres ahead that a change by some metres takes at a speed in m/s."""
        return math.sqrt(PEAK * abs(metres) / self._comfort) * max(speed, self._slow)

    def advance(self, speed: float, seconds: float) -> None:
        """Move on with the change.

        Args:
            speed: The vehicle's, forwards, m/s.
            seconds: Since the last call.
        """
        if self._curve is None:
            return
        self._clock += seconds * min(1.0, max(speed, 0.0) / self._slow)
        if self._clock >= self._curve.duration:
            self.stay(self.target)
            return
        self.line, rate, _ = self._curve.at(self._clock)
        self.slope = rate / max(speed, self._slow)

    def ahead(self, metres: float, speed: float) -> float:
        """Return the offset that the vehicle should have some metres ahead, at its speed in m/s."""
        if self._curve is None:
            return self.line
        return self._curve.offset(self._clock + metres / max(speed, self._slow))

    def plan(self, target: float) -> Lateral:
        """Return this motion as it would be with another target."""
        if target == self.target:
            return self
        other = object.__new__(Lateral)
        other._comfort, other._slow, other.line, other.slope = self._comfort, self._slow, self.line, self.slope
        other.target, other._curve, other._clock = target, self._towards(target), 0.0
        return other

    def _towards(self, target: float) -> Quintic | None:
        """Return the change from now to an offset."""
        way = target - self.line
        if self._curve is None:
            if way == 0.0:
                return None
            return Quintic.to_rest((self.line, 0.0, 0.0), target, math.sqrt(PEAK * abs(way) / self._comfort))
        state = self._curve.at(self._clock)
        duration = max(1.0, math.sqrt(PEAK * abs(way) / _REVISED))
        most = max(_TOLERANCE * _REVISED, 1.01 * abs(state[2]))
        for _ in range(_TRIES):
            curve = Quintic.to_rest(state, target, duration)
            times = (duration * k / _SAMPLES for k in range(_SAMPLES))
            if all(abs(curve.at(t)[2]) <= most for t in times):
                break
            duration *= _STRETCH
        return curve
