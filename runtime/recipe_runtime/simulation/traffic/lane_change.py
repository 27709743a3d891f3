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

POLITENESS, THRESHOLD, KEEP_RIGHT = 0.2, 0.15, 0.2  # the last two in m/s2
KEEP_RIGHT_RULE = 1.0  # m/s2, the bias of drivers who keep right by rule
SAFE_BRAKING = 3.0  # m/s2 that a follower may have to brake at most
_PAUSE = 4.0  # seconds between two lane changes
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
    keep_right: float = KEEP_RIGHT  # m/s2, the bias to the right


def acceleration(follower: Own | Neighbour, leader: Neighbour | None, gap: float) -> float:
    """Return the acceleration of a vehicle behind a leader `gap` metres ahead, m/s2."""
    free = free_acceleration(follower.speed, follower.desired, follower.style)
    if leader is None or gap == math.inf:
        return free
    style = follower.style
    return min(free, idm(follower.speed, free, gap, leader.speed, style, style.gap))


def gain(
    own: Own,
    here: tuple[Neighbour | None, Neighbour | None],
    there: tuple[Neighbour | None, Neighbour | None],
) -> float:
    """Return MOBIL's advantage of a lane change in m/s2; minus infinity if it is not safe.

    Args:
        own: The vehicle.
        here: Leader and follower in its lane.
        there: Leader and follower in the other lane.
    """
    leader, follower = there
    for neighbour in there:
        if neighbour is not None and neighbour.gap < 2.0 + 0.2 * own.speed:
            return -math.inf
    others = 0.0
    if follower is not None:
        self_as_leader = Neighbour(follower.gap, own.speed, own.desired, own.style)
        after = acceleration(follower, self_as_leader, follower.gap)
        if after < -SAFE_BRAKING:
            return -math.inf
        between = follower.gap + own.length + leader.gap if leader is not None else math.inf
        others += after - acceleration(follower, leader, between)
    old_leader, old_follower = here
    if old_follower is not None:
        self_as_leader = Neighbour(old_follower.gap, own.speed, own.desired, own.style)
        between = old_follower.gap + own.length + old_leader.gap if old_leader is not None else math.inf
        others += acceleration(old_follower, old_leader, between)
        others -= acceleration(old_follower, self_as_leader, old_follower.gap)
    after = acceleration(own, leader, leader.gap if leader is not None else math.inf)
    if after < -SAFE_BRAKING:
        return -math.inf
    before = acceleration(own, old_leader, old_leader.gap if old_leader is not None else math.inf)
    return after - before + POLITENESS * others


class LaneChanger:
    """The lane of one vehicle on a road with several lanes, counted from its path's lane, positive to the left."""

    def __init__(self) -> None:
        self.lane = 0
        self._since = -math.inf  # time of the last change, seconds

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
        if seconds - self._since < _PAUSE or abs(vehicle.offset - target) > 0.4:
            return target
        options = [self.lane + step for step in (-1, 1) if -lanes.right <= self.lane + step <= lanes.left]
        nearest = _by_lane(vehicle, neighbours, lanes.width, [self.lane, *options])
        best, wanted = 0.0, self.lane
        for lane, there in zip(options, nearest[1:], strict=True):
            bias = own.keep_right if lane < self.lane else -own.keep_right
            advantage = gain(own, nearest[0], there) + bias - THRESHOLD
            if advantage > best:
                best, wanted = advantage, lane
        if wanted != self.lane:
            self.lane, self._since = wanted, seconds
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
        low, high = _band(body, aside)
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


def _band(body: Body, aside: float) -> tuple[float, float]:
    """Return the edges of a body, metres to the left of the path, including a lane change that it has begun."""
    shift = body.driver.offset - body.offset if is_vehicle(body) else 0.0
    return aside - body.radius + min(shift, 0.0), aside + body.radius + max(shift, 0.0)


def _neighbour(body: Body, gap: float, tx: float, ty: float) -> Neighbour:
    speed = body.velocity[0] * tx + body.velocity[1] * ty
    if is_vehicle(body):
        return Neighbour(gap, speed, body.driver.desired, body.driver.style)
    return Neighbour(gap, speed, speed, Style(1.0, 1.5, 1.0, 2.0))
