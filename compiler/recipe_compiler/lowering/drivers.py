"""Drivers of vehicles: the keys of `driver`, and the desired speeds and time gaps of traffic, which are drawn.

Sources of the distributions:

- Speeds: Department for Transport, "Vehicle speed compliance statistics for Great Britain: 2022". Shares of vehicles in
  free flow over the limit: on roads with a limit of 30 mph, cars 50 %, motorcycles 56 %, rigid trucks 42 %, buses 29
  to 32 %, and 5 % of cars over it by more than 10 mph; on motorways, cars 45 %, and 8 % by more than 10 mph,
  motorcycles 55 %. Trucks on motorways: 53 mph on average, 2 % over 60 mph. A normal distribution follows from two
  shares.
- Time gaps: J. Al-Obaedi, "Close following behavior: estimation of desired gap headway using loop detector data",
  International Journal of Engineering 32 (2019): mean 1.1 s, standard deviation 0.42 s, over 250,000 pairs on two
  motorways; here as a lognormal distribution. Trucks and buses keep 1.5 times as much: A. Houchin, J. Dong, N. Hawkins,
  S. Knickerbocker, "Measurement and analysis of heterogenous vehicle following behavior on urban freeways" (2015).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import DriverPlan
from recipe_compiler.ir.semantic_tags import Tag
from recipe_compiler.ir.streams import Stream, normal_quantile
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.schema import scene

_TAIL = 0.02  # of each distribution, which is cut off at both ends
_MOTORWAY = 80.0 / 3.6  # limit from which a road counts as a motorway, m/s
_MPH = 0.44704  # m/s
_GAP = (1.028, 0.369)  # time gap of cars: median in seconds, standard deviation of the logarithm
_HEAVY_GAP = 1.5  # time gaps of trucks and buses relative to cars


@dataclass(frozen=True)
class _Speeds:
    """Mean and standard deviation of the desired speed of a kind of vehicle."""

    street: tuple[float, float]  # relative to the limit
    motorway: tuple[float, float]  # relative to the limit
    limiter: float | None = None  # m/s; then `motorway` is relative to it


_SPEEDS = {
    Tag.CAR: _Speeds((1.0, 0.2), (0.986, 0.112)),
    Tag.MOTORCYCLE: _Speeds((1.03, 0.2), (1.014, 0.112)),
    Tag.TRUCK: _Speeds((0.96, 0.2), (0.883, 0.057), 60 * _MPH),
    Tag.BUS: _Speeds((0.9, 0.2), (0.883, 0.057), 60 * _MPH),
}
_BICYCLE = 0.15  # speeds relative to the blueprint's are uniform between 1 minus and 1 plus this


def drawn(blueprint: Blueprint, limit: float, stream: Callable[[str], Stream]) -> tuple[float, DriverPlan]:
    """Draw the desired speed (m/s, where no limit is lower) and the driver of a vehicle of the traffic.

    Args:
        blueprint: Its blueprint.
        limit: The highest speed limit of the town, m/s.
        stream: Returns its stream for a purpose.
    """
    speed = _speed(blueprint, limit, stream("speed"))
    median, deviation = _GAP
    headway = median * exact.exp(deviation * _normal(stream("headway")))
    headway *= _HEAVY_GAP if blueprint.tag in (Tag.TRUCK, Tag.BUS) else 1.0
    factor = 1.0 if blueprint.tag == Tag.BICYCLE else speed / limit
    return speed, DriverPlan(limit_factor=factor, headway=headway)


def _normal(stream: Stream) -> float:
    """Draw from a standard normal distribution without its tails."""
    return normal_quantile(stream.uniform(_TAIL, 1.0 - _TAIL))


def _speed(blueprint: Blueprint, limit: float, stream: Stream) -> float:
    """Draw the desired speed of a vehicle, m/s."""
    if blueprint.tag == Tag.BICYCLE:
        return blueprint.default_speed * stream.uniform(1.0 - _BICYCLE, 1.0 + _BICYCLE)
    kind = _SPEEDS[Tag(blueprint.tag)]
    motorway = limit >= _MOTORWAY
    mean, deviation = kind.motorway if motorway else kind.street
    fastest = min(limit, kind.limiter) if motorway and kind.limiter is not None else limit
    return fastest * (mean + deviation * _normal(stream))


def given(keys: scene.Driver, driver: DriverPlan, stream: Callable[[str], Stream]) -> DriverPlan:
    """Return a driver with the values that a recipe gives.

    Args:
        keys: The recipe's `driver`.
        driver: The driver without them.
        stream: Returns the vehicle's stream for a purpose; percentages are drawn from it.
    """

    def is_drawn(purpose: str, percentage: float) -> bool:
        return happens(stream(purpose), percentage)

    factor, headway, gap = limit_factor(keys), keys.headway, keys.distance_to_leading_vehicle
    return DriverPlan(
        limit_factor=driver.limit_factor if factor is None else factor,
        headway=driver.headway if headway is None else headway,
        gap=driver.gap if gap is None else gap,
        obeys_signs=not is_drawn("signs", keys.ignore_signs_percentage),
        sees_vehicles=not is_drawn("vehicles", keys.ignore_vehicles_percentage),
        sees_walkers=not is_drawn("walkers", keys.ignore_walkers_percentage),
        keeps_right=is_drawn("right", keys.keep_right_rule_percentage),
        changes_lanes=keys.auto_lane_change,
    )


def limit_factor(keys: scene.Driver | None) -> float | None:
    """Return the desired speed relative to the limit that a recipe gives; None if it gives none."""
    if keys is None or keys.percentage_speed_difference is None:
        return None
    return 1.0 - keys.percentage_speed_difference / 100.0


def given_speed(keys: scene.Driver, blueprint: Blueprint, limit: float, speed: float) -> float:
    """Return the speed of a vehicle where no limit is lower, m/s: `speed`, unless a recipe gives it by the limit.

    Bicycles keep their own speed.
    """
    factor = limit_factor(keys)
    return speed if factor is None or blueprint.tag == Tag.BICYCLE else factor * limit


def happens(stream: Stream, percentage: float) -> bool:
    """Draw whether something happens that has a probability in percent."""
    return stream.uniform(0.0, 100.0) < percentage
