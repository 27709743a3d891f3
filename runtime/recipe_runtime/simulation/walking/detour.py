"""Planned detours around obstacles, for pedestrians that local avoidance does not free.

Avoidance considers only a few metres ahead and turns by at most 135 degrees, so a pedestrian can get stuck in a corner
between two obstacles. A planned path around all nearby obstacles leads out of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from recipe_compiler.ir.ground.obstacles import Obstacle, ObstacleMap
from recipe_compiler.ir.ground.path_planner import Planner, TooManyObstaclesError

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.walking.surroundings import Surroundings

_AROUND = 15.0  # metres within which obstacles are considered
_WORK = 20_000  # line segments that a search may test
_REACHED = 0.3  # metres to a waypoint at which it is reached
_CLEAR = 0.1  # metres of clearance that make a straight path free
_LASTS = 15.0  # seconds for which a path is followed

Vector2 = tuple[float, float]


class Detour:
    """A planned path around nearby obstacles, while it is followed."""

    def __init__(self, surroundings: Surroundings) -> None:
        self._surroundings = surroundings
        self._waypoints: Sequence[Vector2] = ()
        self._until = -math.inf

    @property
    def active(self) -> bool:
        """Whether there is a path to follow."""
        return bool(self._waypoints)

    def plan(self, own: Agent, goals: Iterable[Vector2], others: Sequence[Agent], seconds: float) -> bool:
        """Plan a path to the first goal that can be reached.

        Args:
            own: The pedestrian.
            goals: Positions within 15 m of it, metres.
            others: Agents in sight; the path leads around stationary vehicles.
            seconds: Time since frame 0.

        Returns:
            Whether there is a path that is not straight.
        """
        here = own.x, own.y
        solid = self._surroundings.obstacles.around(*here, _AROUND)
        planner = Planner(ObstacleMap([*solid, *_standing(others)]), _WORK)
        for goal in goals:
            if planner.inside(*goal, body=own.radius):
                continue
            try:
                path = planner.shortest_path(here, goal)
            except TooManyObstaclesError:
                break
            if path is not None:
                self._waypoints, self._until = path if len(path) > 1 else (), seconds + _LASTS
                return len(path) > 1
        self._waypoints = ()
        return False

    def direction(self, own: Agent, leader: Agent | None, seconds: float) -> Vector2 | None:
        """Return the direction along the path, a unit vector; None without a path and at its end.

        Args:
            own: The pedestrian.
            leader: The companion that it follows; the path ends when the straight line to the companion is free.
            seconds: Time since frame 0.
        """
        if self._waypoints and leader is not None:
            straight = own.x, own.y, leader.x, leader.y
            if not self._surroundings.obstacles.across(straight, own.radius + _CLEAR):
                self._waypoints = ()
        while self._waypoints and seconds < self._until:
            dx, dy = self._waypoints[0][0] - own.x, self._waypoints[0][1] - own.y
            distance = math.sqrt(dx * dx + dy * dy)
            if distance > _REACHED:
                return dx / distance, dy / distance
            self._waypoints = self._waypoints[1:]
        self._waypoints = ()
        return None


def _standing(others: Iterable[Agent]) -> list[Obstacle]:
    """Return the stationary vehicles as obstacles."""
    return [
        Obstacle(o.actor.name, "vehicle", o.x, o.y, *o.heading, o.reach, o.radius)
        for o in others
        if o.reach != o.radius and not o.moving and abs(o.speed) < 0.1
    ]
