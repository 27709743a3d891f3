"""Lane changes on roads with several lanes: MOBIL.

Source: A. Kesting, M. Treiber, D. Helbing, "General lane-changing model MOBIL for car-following models",
Transportation Research Record 1999 (2007). A vehicle changes lanes if no other vehicle has to brake hard for it, and if
its own advantage plus a share of the others' advantage exceeds a threshold. A bias favours the right lane mildly;
passing on the right is permitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from recipe_runtime.simulation.traffic.following import Style, free_acceleration, idm
from recipe_runtime.simulation.traffic.protocols import Body, Vehicle, is_vehicle
from recipe_runtime.simulation.traffic.road_map import Lanes
from recipe_runtime.simulation.traffic.standing_props import StandingProp

POLITENESS, THRESHOLD, KEEP_RIGHT = 0.2, 0.6, 0.65  # the last two in m/s2
SAFE_BRAKING = 3.0  # m/s2, hardest braking because of a lane change
_ABORTED, _NEAR = 4.5, 0.5  # m/s2 and metres: harder braking, or a smaller gap, aborts it
_COMMITTED = 0.15  # widths of a lane after which it goes on in any case
_PAUSE = 8.0  # seconds between two lane changes
_CHECKS = 3  # consecutive decisions in which a lane must be better
_STAY = 30.0  # seconds that a vehicle must be able to stay in a lane to its right at its desired speed
_KEEP_RIGHT_RULE, _STAY_RULE = 1.0, 10.0  # m/s2 and seconds: the same of drivers who keep right by rule
_OVERLAP = 0.2  # metres that a body must be in a lane to count there


@dataclass(frozen=True, slots=True)
class Neighbour:
    """The nearest vehicle ahead or behind in a lane."""

    gap: float  # metres from bumper to bumper; infinity if there is none
    speed: float  # along the road, m/s
    desired: float  # m/s
    style: Style


@dataclass(frozen=True, slots=True)
class Own:
    """The vehicle that considers a lane change."""

    speed: float
    desired: float
    length: float
    style: Style
    keeps_right: bool = False  # by rule


def acceleration(follower: Own | Neighbour, leader: Neighbour | None, gap: float) -> float:
    """Return the acceleration of a vehicle behind a leader `gap` metres ahead, m/s2."""
    free = free_acceleration(follower.speed, follower.desired, follower.style)
    if leader is None or gap == math.inf:
        return free
    style = follower.style
    return min(free, idm(follower.speed, free, gap, leader.speed, style, style.gap))


def is_safe(own: Own, there: tuple[Neighbour | None, Neighbour | None], room: float, braking: float) -> bool:
    """Return whether a vehicle can be in a lane without anybody braking hard.

    Args:
        own: The vehicle.
        there: Leader and follower in the lane.
        room: Gap that it needs to both, metres.
        braking: Hardest braking of the vehicle and of its follower, m/s2.
    """
    leader, follower = there
    if any(neighbour is not None and neighbour.gap < room for neighbour in there):
        return False
    if follower is not None:
        self_as_leader = Neighbour(follower.gap, own.speed, own.desired, own.style)
        if acceleration(follower, self_as_leader, follower.gap) < -braking:
            return False
    return leader is None or acceleration(own, leader, leader.gap) >= -braking


def gain(
    own: Own,
    here: tuple[Neighbour | None, Neighbour | None],
    there: tuple[Neighbour | None, Neighbour | None],
    *,
    left: bool,
) -> float:
    """Return MOBIL's advantage of a lane change in m/s2; minus infinity if it is not safe.

    Args:
        own: The vehicle.
        here: Leader and follower in its lane.
        there: Leader and follower in the other lane.
        left: Whether it is to the left. Only the follower in the left of the two lanes counts, so that slow vehicles do
            not move to the left for those behind them.
    """
    if not is_safe(own, there, 2.0 + 0.2 * own.speed, SAFE_BRAKING):
        return -math.inf
    leader, follower = there
    others = 0.0
    if left and follower is not None:
        self_as_leader = Neighbour(follower.gap, own.speed, own.desired, own.style)
        between = follower.gap + own.length + leader.gap if leader is not None else math.inf
        others += acceleration(follower, self_as_leader, follower.gap) - acceleration(follower, leader, between)
    old_leader, old_follower = here
    if not left and old_follower is not None:
        self_as_leader = Neighbour(old_follower.gap, own.speed, own.desired, own.style)
        between = old_follower.gap + own.length + old_leader.gap if old_leader is not None else math.inf
        others += acceleration(old_follower, old_leader, between)
        others -= acceleration(old_follower, self_as_leader, old_follower.gap)
    after = acceleration(own, leader, leader.gap if leader is not None else math.inf)
    before = acceleration(own, old_leader, old_leader.gap if old_leader is not None else math.inf)
    return after - before + POLITENESS * others


def catches_up(own: Own, leader: Neighbour | None) -> float:
    """Return the seconds until a vehicle at its desired speed has its headway to a leader; infinity if it never has."""
    if leader is None or own.desired <= leader.speed:
        return math.inf
    return (leader.gap - own.style.gap - own.desired * own.style.headway) / (own.desired - leader.speed)


class LaneChanger:
    """The lane of one vehicle on a road with several lanes, counted from its path's lane, positive to the left."""

    def __init__(self) -> None:
        self.lane = self._before = 0  # now or soon, and before the last change
        self._since = -math.inf  # time of the last change, seconds
        self._wanted, self._checks = 0, 0  # the lane that has been better, and in how many consecutive decisions

    def decide(self, vehicle: Vehicle, own: Own, lanes: Lanes, neighbours: Sequence[Body], seconds: float) -> float:
        """Return the desired offset of the vehicle, metres to the left of its path.

        Args:
            vehicle: The vehicle, on a straight road.
            own: Its speed, desired speed and style.
            lanes: The lanes next to the one of its path.
            neighbours: Agents in its neighbourhood, in plan order.
            seconds: Time since frame 0.
        """
        target = self.lane * lanes.width
        if self.lane != self._before and abs(vehicle.offset - self._before * lanes.width) < _COMMITTED * lanes.width:
            there = _by_lane(vehicle, neighbours, lanes.width, [self.lane])[0]
            if not is_safe(own, there, _NEAR, _ABORTED):
                self.lane = self._before
            return self.lane * lanes.width
        if seconds - self._since < _PAUSE or abs(vehicle.offset - target) > 0.4:
            self._checks = 0
            return target
        options = [self.lane + step for step in (-1, 1) if -lanes.right <= self.lane + step <= lanes.left]
        nearest = _by_lane(vehicle, neighbours, lanes.width, [self.lane, *options])
        keep_right, stay = (_KEEP_RIGHT_RULE, _STAY_RULE) if own.keeps_right else (KEEP_RIGHT, _STAY)
        best, wanted = 0.0, self.lane
        for lane, there in zip(options, nearest[1:], strict=True):
            if lane < self.lane and catches_up(own, there[0]) < stay:
                continue
            bias = keep_right if lane < self.lane else -keep_right
            advantage = gain(own, nearest[0], there, left=lane > self.lane) + bias - THRESHOLD
            if advantage > best:
                best, wanted = advantage, lane
        self._checks = self._checks + 1 if wanted == self._wanted else 1
        self._wanted = wanted
        if wanted != self.lane and self._checks >= _CHECKS:
            self._before, self.lane, self._since = self.lane, wanted, seconds
        return self.lane * lanes.width


def _by_lane(
    vehicle: Vehicle, neighbours: Sequence[Body], width: float, lanes: Sequence[int]
) -> list[tuple[Neighbour | None, Neighbour | None]]:
    """Return the nearest vehicle ahead and behind in each lane."""
    tx, ty = vehicle.path.tangent(vehicle.progress)
    found: list[list[Neighbour | None]] = [[None, None] for _ in lanes]
    px, py = vehicle.path.at(vehicle.progress)
    for body in neighbours:
        dx, dy = body.x - px, body.y - py
        aside = dy * tx - dx * ty
        if abs(aside) > 4.0 * width:
            continue
        if body.heading[0] * tx + body.heading[1] * ty < 0.5 and not isinstance(body, StandingProp):
            continue
        along = dx * tx + dy * ty
        gap = abs(along) - body.reach - vehicle.reach
        neighbour = None
        low, high = band(body, aside)
        for n, lane in enumerate(lanes):
            middle = lane * width
            if high < middle - width / 2 + _OVERLAP or low > middle + width / 2 - _OVERLAP:
                continue
            side = 0 if along >= 0.0 else 1
            nearest = found[n][side]
            if nearest is None or gap < nearest.gap:
                neighbour = neighbour or _neighbour(body, gap, tx, ty)
                found[n][side] = neighbour
    return [(ahead, behind) for ahead, behind in found]


def band(body: Body, aside: float) -> tuple[float, float]:
    """Return the right and the left edge of a body and of the lane change that it has begun.

    Args:
        body: The body.
        aside: Metres from the line from which the edges are measured to the body's middle, to the left.
    """
    shift = body.driver.offset - body.offset if is_vehicle(body) else 0.0
    return aside - body.radius + min(shift, 0.0), aside + body.radius + max(shift, 0.0)


def _neighbour(body: Body, gap: float, tx: float, ty: float) -> Neighbour:
    speed = body.velocity[0] * tx + body.velocity[1] * ty
    if is_vehicle(body):
        return Neighbour(gap, speed, body.driver.desired, body.driver.style)
    return Neighbour(gap, speed, speed, Style(1.0, 1.5, 1.0, 2.0))
