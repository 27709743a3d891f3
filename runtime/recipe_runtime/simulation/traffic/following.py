"""Car following: the Intelligent Driver Model, and its extension for cut-ins.

Sources: M. Treiber, A. Hennecke, D. Helbing, "Congested traffic states in empirical observations and microscopic
simulations", Physical Review E 62 (2000); A. Kesting, M. Treiber, D. Helbing, "Enhanced intelligent driver model to
access the impact of driving strategies on traffic capacity", Philosophical Transactions of the Royal Society A 368
(2010), for cut-ins, where the original model brakes harder than needed; W. Schakel, V. Knoop, B. van Arem, "Integrated
lane change model with relaxation and synchronization", Transportation Research Record 2316 (2012), for IDM+: the
minimum of free and following acceleration, with which followers keep the desired time gap at every speed. Two changes:
above the desired speed, braking is proportional to the excess, so that a lower speed limit does not cause hard braking;
and x / (1 + |x|) replaces tanh.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from recipe_compiler.ir.plan import DriverPlan

from recipe_runtime.body.skeleton import BICYCLE, BUS, MOTORCYCLE, SCOOTER, TRUCK

HARDEST_BRAKING = 8.0  # m/s2
COOLNESS = 0.95  # coolness factor c of the extended model
_LAST = 0.3  # metres kept to a place where a vehicle stops, if there is no room for more
_CORRECTION, _MAX_CORRECTION = 1.6, 3.0  # 1/s and m/s2, above the desired speed


@dataclass(frozen=True, slots=True)
class Style:
    """The parameters of the model for one vehicle."""

    acceleration: float  # m/s2, from standstill
    braking: float  # m/s2, comfortable
    headway: float  # desired time gap to the leader, seconds
    gap: float  # metres to the leader at standstill

    @property
    def root(self) -> float:
        """2 sqrt(a b), the denominator of the model's braking term."""
        return 2.0 * math.sqrt(self.acceleration * self.braking)


_CAR = Style(1.8, 2.0, 1.1, 2.0)
_STYLES = {
    BUS: Style(1.1, 1.6, 1.4, 2.2),
    TRUCK: Style(1.1, 1.6, 1.4, 2.2),
    MOTORCYCLE: Style(2.2, 2.2, 1.0, 1.8),
    SCOOTER: Style(2.2, 2.2, 1.0, 1.8),
    BICYCLE: Style(0.9, 1.6, 1.0, 1.4),
}


def style_of(shape: Mapping[str, float], driver: DriverPlan | None = None) -> Style:
    """Return the driving style of a vehicle with a shape, with the headway and the gap of its driver."""
    kind = _STYLES.get(int(shape["body"]), _CAR)
    if driver is None:
        return kind
    headway = kind.headway if driver.headway is None else driver.headway
    return Style(kind.acceleration, kind.braking, headway, kind.gap if driver.gap is None else driver.gap)


def free_acceleration(speed: float, desired: float, style: Style) -> float:
    """Return the acceleration on a free road, m/s2."""
    if desired < 0.05:
        return -_MAX_CORRECTION if speed > 0.0 else 0.0
    if speed <= desired:
        ratio = speed / desired
        ratio *= ratio
        return style.acceleration * (1.0 - ratio * ratio)
    return max(-_MAX_CORRECTION, -_CORRECTION * (speed - desired))


def idm(speed: float, free: float, gap: float, leader_speed: float, style: Style, standstill: float) -> float:
    """Return the model's acceleration behind a leader, m/s2, at least -`HARDEST_BRAKING`.

    Args:
        speed: The vehicle's speed, m/s.
        free: The acceleration on a free road, m/s2.
        gap: Metres from the vehicle's front to the leader.
        leader_speed: The leader's speed along the vehicle's path, m/s; negative if it is oncoming.
        style: The parameters of the model.
        standstill: Metres to keep at standstill.
    """
    if gap <= 0.05:
        return -HARDEST_BRAKING
    wanted = speed * style.headway + speed * (speed - leader_speed) / style.root
    ratio = (standstill + (wanted if wanted > 0.0 else 0.0)) / gap
    return max(-HARDEST_BRAKING, min(free, style.acceleration * (1.0 - ratio * ratio)))


def following_acceleration(
    speed: float, free: float, gap: float, leader_speed: float, style: Style, standstill: float
) -> float:
    """Return the acceleration behind a leader, m/s2: `idm`, limited near the braking that the closing speed requires.

    The arguments are those of `idm`.
    """
    wanted = idm(speed, free, gap, leader_speed, style, standstill)
    closing = speed - leader_speed
    needed = 0.0
    if closing > 0.0:
        needed = -0.5 * closing * closing / max(gap - 0.5 * standstill, 0.05)
    if wanted >= needed:
        return wanted
    excess = (wanted - needed) / style.braking
    calm = needed + style.braking * excess / (1.0 - excess)
    return max(-HARDEST_BRAKING, (1.0 - COOLNESS) * wanted + COOLNESS * calm)


def stopping_acceleration(
    speed: float, free: float, gap: float, leader_speed: float, style: Style, standstill: float
) -> float:
    """Return the acceleration towards a place where a vehicle has to stop, m/s2.

    It is that of `following_acceleration`, but brakes no harder than is comfortable or, if that is not enough, than a
    stop just before the place requires. The arguments are those of `idm`.
    """
    wanted = following_acceleration(speed, free, gap, leader_speed, style, standstill)
    if wanted >= -style.braking:
        return wanted
    closing = max(0.0, speed - leader_speed)
    needed = 0.5 * closing * closing / max(gap - min(_LAST, 0.5 * standstill), 0.05)
    return max(wanted, -max(style.braking, needed))


def stopping_distance(speed: float, braking: float) -> float:
    """Return the metres that a stop takes, with speed in m/s and braking in m/s2."""
    return 0.5 * speed * speed / braking
