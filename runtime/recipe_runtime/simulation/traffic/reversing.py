"""Reversing of stationary vehicles that cannot go on otherwise.

A vehicle reverses slowly, by a few metres, as far as the space behind it is free: away from an obstacle after a
collision; off a place that other vehicles need to pass; and behind a stationary obstacle, until there is room to pull
out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from recipe_runtime.simulation.traffic.corridor import Obstacle
from recipe_runtime.simulation.traffic.junctions import JunctionControl
from recipe_runtime.simulation.traffic.protocols import Body, Vehicle
from recipe_runtime.simulation.traffic.road_map import RoadMap

REVERSE_SPEED = 0.8  # m/s, backwards
_AFTER_CONTACT, _LEAST, _MOST = 3.0, 0.4, 10.0  # metres to reverse: after a collision, at least, at most
_PUSHES, _OBSTRUCTS, _TOO_NEAR, _MEETS = 2.5, 3.0, 5.0, 10.0  # seconds of standing before it reverses, by reason
_RUN_UP = 2.5  # metres to keep behind an obstacle that it will pass, in addition to the distance to pull out
_PAUSE = 6.0  # seconds between two attempts
_TRIES, _PROGRESS = 3, 10.0  # maximum attempts, and metres of progress after which they are counted anew
_LIMIT = 15.0  # seconds after which an attempt is given up
_FREE, _SIDE, _FORESIGHT = 1.0, 0.5, 2.0  # metres kept behind and to the sides; seconds for which motion is predicted
_AT_LINE = 0.5  # metres to the waiting position
_STANDS = 0.1  # m/s, below which a vehicle counts as stationary
_TICK = 0.1  # seconds between decisions


@dataclass(slots=True)
class Situation:
    """The state of a stationary vehicle, from which the reason of standing follows."""

    wish: float  # acceleration that its driver requests, m/s2
    nearest: Obstacle | None  # nearest obstacle in its corridor
    overtakes: bool = False  # whether it is about to pass that obstacle


class Reversing:
    """The decisions of one vehicle to reverse."""

    def __init__(self, roads: RoadMap, junctions: JunctionControl) -> None:
        self._roads, self._junctions = roads, junctions
        self._left = 0.0  # metres still to reverse
        self._seconds = 0.0  # duration of reversing, or of having a reason to reverse
        self._now = self._again = -math.inf  # time of the last decision, and earliest time of the next attempt
        self._tries, self._from = 0, -math.inf  # number of attempts, and the arc length of the first one

    def decide(self, vehicle: Vehicle, neighbours: Sequence[Body], situation: Situation, seconds: float) -> bool:
        """Return whether the vehicle reverses now. Called while it is stationary or reverses.

        Args:
            vehicle: The vehicle.
            neighbours: Agents in its neighbourhood, in plan order.
            situation: Its state.
            seconds: Time since frame 0.
        """
        if seconds > self._now + 1.5 * _TICK:  # it has been moving
            self._seconds = self._left = 0.0
        self._now = seconds
        if self._left > 0.0:
            self._left -= _TICK * max(0.0, -vehicle.speed)
            self._seconds += _TICK
            goes_on = self._left > 0.0 and self._seconds < _LIMIT and not vehicle.halted
            if goes_on and self._room(vehicle, neighbours, self._left) > 0.0:
                return True
            self._left, self._seconds, self._again = 0.0, 0.0, seconds + _PAUSE
            return False
        if abs(vehicle.speed) > _STANDS or vehicle.halted or seconds < self._again:
            self._seconds = 0.0
            return False
        metres, patience = self._wanted(vehicle, situation)
        self._seconds = self._seconds + _TICK if metres > 0.0 else 0.0
        if self._seconds < patience:
            return False
        if abs(vehicle.progress - self._from) > _PROGRESS:
            self._tries, self._from = 0, vehicle.progress
        self._seconds = 0.0
        room = self._room(vehicle, neighbours, metres) if self._tries < _TRIES else 0.0
        if room < _LEAST:
            return False
        self._tries, self._left = self._tries + 1, room
        return True

    def _wanted(self, vehicle: Vehicle, situation: Situation) -> tuple[float, float]:
        """Return the metres by which the vehicle should reverse, 0 for not, and the seconds to wait before."""
        nearest, passage = situation.nearest, vehicle.driver.passage
        if situation.wish > 0.2:
            return _AFTER_CONTACT, _PUSHES
        if passage.obstructs and passage.next is not None:
            hold = passage.next.entry - self._junctions.setback(passage.next) - vehicle.progress - vehicle.reach
            return max(0.0, _AT_LINE - hold), _OBSTRUCTS
        if nearest is None or nearest.person or abs(nearest.speed) > _STANDS:
            return 0.0, math.inf
        if situation.overtakes:
            lateral = vehicle.driver.lateral
            needed = _RUN_UP + lateral.length(lateral.target - vehicle.offset, 0.0)
            return min(needed - nearest.gap, _MOST), _TOO_NEAR
        if nearest.gap < 1.0 and nearest.along < 0.3:
            return _AFTER_CONTACT, _MEETS
        return 0.0, math.inf

    def _room(self, vehicle: Vehicle, neighbours: Sequence[Body], most: float) -> float:
        """Return the metres by which the vehicle can reverse, at most `most`."""
        return min(most, self._before_junction(vehicle), self._on_road(vehicle, most), _free(vehicle, neighbours))

    def _before_junction(self, vehicle: Vehicle) -> float:
        """Return the metres back to a stop line that its front has passed, or to a junction that it has left."""
        passage = vehicle.driver.passage
        if passage.inside:
            return vehicle.progress + vehicle.reach - passage.crossings[passage.entered - 1].entry - _AT_LINE
        if passage.left:
            return vehicle.progress - vehicle.reach - passage.crossings[passage.left - 1].leave
        return math.inf

    def _on_road(self, vehicle: Vehicle, most: float) -> float:
        """Return `most`, or 0 if the vehicle would leave the road."""
        (hx, hy), back = vehicle.heading, vehicle.reach + most
        x, y = vehicle.x - back * hx, vehicle.y - back * hy
        corners = [(x - side * hy, y + side * hx) for side in (-vehicle.radius, vehicle.radius)]
        if self._roads.paved(vehicle.x, vehicle.y) and not all(self._roads.paved(*corner) for corner in corners):
            return 0.0
        return most


def _free(vehicle: Vehicle, neighbours: Sequence[Body]) -> float:
    """Return the metres behind a vehicle that are free of other agents, now and within `_FORESIGHT` seconds."""
    (hx, hy), room = vehicle.heading, math.inf
    for body in neighbours:
        dx, dy = body.x - vehicle.x, body.y - vehicle.y
        behind = -(dx * hx + dy * hy)
        if behind <= 0.0 or not body.present:
            continue
        (bx, by), (vx, vy) = body.heading, body.velocity
        cosine, sine = abs(hx * bx + hy * by), abs(hx * by - hy * bx)
        gap = behind - cosine * body.reach - sine * body.radius - vehicle.reach
        aside = abs(dy * hx - dx * hy) - sine * body.reach - cosine * body.radius - vehicle.radius
        kept = _SIDE + _FORESIGHT * abs(vy * hx - vx * hy) if gap > 0.0 else 0.1
        if aside < kept:
            room = min(room, gap - _FREE - _FORESIGHT * max(0.0, vx * hx + vy * hy))
    return max(0.0, room)
