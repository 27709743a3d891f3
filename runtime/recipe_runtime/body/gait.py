"""Gait parameters by speed: stride length, duty factor, and the change from walking to running.

Gaits are similar at equal Froude numbers (R. McN. Alexander, Estimates of speeds of dinosaurs, Nature 261, 1976), so
all parameters are functions of the dimensionless speed v / sqrt(g h), where h is the height of the hips: shorter legs
have a higher cadence and run at lower speeds. Sources of the parameters:

- stride length and duty factor of walking: D. W. Grieve and R. J. Gear, The relationships between length of stride,
  step frequency, time of swing and speed of walking for children and adults, Ergonomics 9, 1966;
- change to running near a Froude number of 0.6: A. Thorstensson and H. Roberthson, Adaptations to changing speed in
  human locomotion: speed of transition between walking and running, Acta Physiologica Scandinavica 131, 1987;
- stride frequency of running, which grows little with speed: P. R. Cavanagh and R. Kram, Stride length in distance
  running, Medicine and Science in Sports and Exercise 21, 1989;
- duty factor of running: T. F. Novacheck, The biomechanics of running, Gait and Posture 7, 1998.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from recipe_runtime.body.skeleton import Figure

_WALK, _RUN = 0.745, 0.80  # dimensionless speeds up to which people walk, and from which they run


@dataclass(frozen=True, slots=True)
class Stride:
    """The stride at a speed.

    Attributes:
        speed: m/s.
        length: Way of a stride (two steps), metres.
        duty: Fraction of a stride during which a foot is on the ground. If it is over 0.5, both feet are on the ground
            at times; if it is less, both are off it at times.
        running: Weight of running: 0 in walking.
    """

    speed: float
    length: float
    duty: float
    running: float


class Gait:
    """The gait of a person.

    Attributes:
        figure: Proportions.
        unit_speed: The speed whose dimensionless value is 1, m/s.
        unit_time: Time in which a leg's length is covered at that speed, seconds.
    """

    def __init__(self, figure: Figure) -> None:
        self.figure = figure
        self.unit_speed = math.sqrt(9.81 * figure.hip)
        self.unit_time = figure.hip / self.unit_speed

    def stride(self, speed: float) -> Stride:
        """Return the stride at a speed in m/s."""
        v = speed / self.unit_speed
        length, duty = 0.48 + (2.83 - 1.05 * min(v, 1.0)) * v, 0.64 - 0.05 * v
        weight = self._running(v)
        if weight > 0.0:
            length += weight * (v / (0.367 + 0.056 * v) - length)
            duty += weight * (max(0.25, 0.44 - 0.09 * v) - duty)
        return Stride(speed, self.figure.hip * length, duty, weight)

    def _running(self, v: float) -> float:
        """Return the weight of running, between 0 (walking) and 1, at a dimensionless speed."""
        u = (v - _WALK) / (_RUN - _WALK)
        if u <= 0.0:
            return 0.0
        return 1.0 if u >= 1.0 else u * u * (3.0 - 2.0 * u)
