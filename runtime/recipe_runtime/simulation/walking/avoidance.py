"""Avoidance of people, vehicles and obstacles: the direction and the speed of a pedestrian.

After M. Moussaid, D. Helbing and G. Theraulaz, How simple rules determine pedestrian behavior and crowd disasters
(PNAS, 2011): among several directions, a pedestrian chooses the one that brings it nearest to its destination before it
is blocked, and it keeps a time of half a second to what is ahead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.ground.obstacles import Obstacle

LOOK = 6.0  # metres ahead that are considered
_REACTION = 0.5  # seconds kept to obstacles ahead
_ANGLES = (-12, 12, -25, 25, -40, 40, -55, 55, -75, 75)  # candidate directions, degrees to the left, right ones first
_ROUND = (-75, 75, -105, 105, -135, 135)  # additional directions for a blocked pedestrian
_TURNS = tuple((*exact.sin_cos_deg(float(angle)), angle > 0) for angle in _ANGLES)
_WIDE = (*_TURNS, *((*exact.sin_cos_deg(float(angle)), angle > 0) for angle in _ROUND))
_OTHER_SIDE = 2.0  # m2, cost of changing to the other side
_KERB, _KERBS = 0.35, 5  # metres between positions ahead that are tested for the road, and their number
_TOUCHING = 0.1  # m/s, permitted closing speed within the comfortable distance

Vector2 = tuple[float, float]
Disc = tuple[float, float, float, float, float]  # x, y from here, velocity x, y, distance^2 - comfortable distance^2


@dataclass(slots=True)
class Scene:
    """The obstacles near a pedestrian."""

    x: float
    y: float
    discs: Sequence[Disc]
    boxes: Sequence[tuple[Obstacle, float, float, float, float]]  # box, its margin, its velocity x, y, seconds ahead
    walls: Sequence[tuple[Obstacle, float]]  # with their margins
    reach: float  # metres within which walls are considered
    on_road: Callable[[float, float], bool] | None = None  # where not to step aside; None: on the road already

    def free(self, ux: float, uy: float, speed: float, most: float) -> float:
        """Return the free distance in a direction, metres, at most `most`."""
        sx, sy, free = speed * ux, speed * uy, most
        for dx, dy, vx, vy, room in self.discs:
            wx, wy = sx - vx, sy - vy
            closing = dx * wx + dy * wy
            if closing <= 0.0:
                continue
            if room <= 0.0:
                if closing * closing > _TOUCHING * _TOUCHING * (dx * dx + dy * dy):
                    return 0.0
                continue
            square = wx * wx + wy * wy
            rest = closing * closing - square * room
            if rest > 0.0:
                free = min(free, (closing - math.sqrt(rest)) / square * speed)
        for box, margin, vx, vy, seconds in self.boxes:
            end = (self.x + (sx - vx) * seconds, self.y + (sy - vy) * seconds)
            free = min(free, box.entry((self.x, self.y, *end), margin) * seconds * speed)
        for wall, margin in self.walls:
            end = (self.x + ux * self.reach, self.y + uy * self.reach)
            free = min(free, wall.entry((self.x, self.y, *end), margin) * self.reach)
        return free

    def free_aside(self, ux: float, uy: float, speed: float, most: float) -> float:
        """Return the free distance in a direction that is not that of the route: as `free`, and before the road."""
        free = self.free(ux, uy, speed, most)
        if self.on_road is not None:
            for n in range(1, _KERBS + 1):
                ahead = n * _KERB
                if ahead - _KERB >= free:
                    break
                if self.on_road(self.x + ahead * ux, self.y + ahead * uy):
                    return ahead - _KERB
        return free


@dataclass(frozen=True, slots=True)
class Choice:
    """A direction, a speed in m/s, and the side to which the direction deviates from the desired one."""

    ux: float
    uy: float
    speed: float
    side: int  # 1: left, -1: right, 0: straight on


def choose(scene: Scene, ahead: Vector2, speed: float, distance: float, side: int, blocked: bool) -> Choice:
    """Choose a direction and a speed.

    Args:
        scene: The obstacles.
        ahead: The desired direction, a unit vector.
        speed: The desired speed, m/s.
        distance: Metres to the next stop.
        side: The side of the last choice.
        blocked: Whether the pedestrian has been blocked for some time, so that it takes wide turns.
    """
    most = max(0.6, min(LOOK, distance))
    ux, uy = ahead
    free = scene.free(ux, uy, speed, most)
    if free >= most:
        return Choice(ux, uy, speed, 0)
    best, found = (
        (free if blocked else (most - free) * (most - free)),
        Choice(ux, uy, min(speed, free / _REACTION), side),
    )
    best = -best if blocked else best
    for sine, cosine, left in _WIDE if blocked else _TURNS:
        wx, wy = cosine * ux - sine * uy, cosine * uy + sine * ux
        free = scene.free_aside(wx, wy, speed, most)
        turn = 1 if left else -1
        if blocked:
            cost = -0.5 * free * (1.0 + cosine) if turn * side >= 0 else 0.0
        else:
            cost = most * most + free * free - 2.0 * most * free * cosine
            cost += _OTHER_SIDE if turn * side < 0 else 0.0
        if cost < best:
            best, found = cost, Choice(wx, wy, min(speed, free / _REACTION), turn)
    return found
