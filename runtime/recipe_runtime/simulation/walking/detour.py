"""Ways round solid things that pedestrians plan when what they do otherwise has not helped.

Avoidance looks a few metres ahead and turns by at most 135 degrees, so a corner between two obstacles can hold a
pedestrian. A way round all that stands near leads out of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from recipe_compiler.ir.ground.obstacles import Obstacle, ObstacleMap
from recipe_compiler.ir.ground.path_planner import Planner, TooManyObstaclesError

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.walking.surroundings import Surroundings

_AROUND = 15.0  # metres within which obstacles count
_WORK = 20_000  # straight ways that one search may test
_REACHED = 0.3  # metres to a waypoint from which the next one counts
_CLEAR = 0.1  # metres beside a straight way that is free
_LASTS = 15.0  # seconds for which a way is followed

Vector2 = tuple[float, float]


class Detour:
    """A planned way round what stands near, as long as it is followed."""

    def __init__(self, surroundings: Surroundings) -> None:
        self._surroundings = surroundings
        self._way: Sequence[Vector2] = ()
        self._until = -math.inf

    @property
    def active(self) -> bool:
        """Whether there is a way to follow."""
        return bool(self._way)

    def plan(self, own: Agent, goals: Iterable[Vector2], others: Sequence[Agent], seconds: float) -> bool:
        """Plan the way to the first of some places that can be reached.

        Args:
            own: The pedestrian.
            goals: Places within 15 m of it, metres.
            others: Those in sight; vehicles that stand are gone round.
            seconds: Time since frame 0.

        Returns:
            Whether there is a way that is not straight.
        """
        here = own.x, own.y
        solid = self._surroundings.obstacles.around(*here, _AROUND)
        planner = Planner(ObstacleMap([*solid, *_standing(others)]), _WORK)
        for goal in goals:
            if planner.inside(*goal, body=own.radius):
                continue
            try:
                way = planner.shortest_path(here, goal)
            except TooManyObstaclesError:
                break
            if way is not None:
                self._way, self._until = way if len(way) > 1 else (), seconds + _LASTS
                return len(way) > 1
        self._way = ()
        return False

    def direction(self, own: Agent, leader: Agent | None, seconds: float) -> Vector2 | None:
        """Return the direction along the way, a unit vector; None without one, and at its end.

        Args:
            own: The pedestrian.
            leader: Whom it walks beside; once the straight way there is free, the planned one ends.
            seconds: Time since frame 0.
        """
        if self._way and leader is not None:
            straight = own.x, own.y, leader.x, leader.y
            if not self._surroundings.obstacles.across(straight, own.radius + _CLEAR):
                self._way = ()
        while self._way and seconds < self._until:
            dx, dy = self._way[0][0] - own.x, self._way[0][1] - own.y
            distance = math.sqrt(dx * dx + dy * dy)
            if distance > _REACHED:
                return dx / distance, dy / distance
            self._way = self._way[1:]
        self._way = ()
        return None


def _standing(others: Iterable[Agent]) -> list[Obstacle]:
    """Return the vehicles that stand."""
    return [
        Obstacle(o.actor.name, "vehicle", o.x, o.y, *o.heading, o.reach, o.radius)
        for o in others
        if o.reach != o.radius and not o.moving and abs(o.speed) < 0.1
    ]
