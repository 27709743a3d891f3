"""The route of a pedestrian: its progress, the direction to walk, and pauses."""

from __future__ import annotations

import math
from itertools import pairwise

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.simulation.path import Path

_LEAST_LOOK, _LOOK_SECONDS = 0.7, 0.45  # look-ahead distance: minimum in metres, and in seconds of walking
_PASSING_LOOK = 3.0  # metres, minimum look-ahead distance while passing another agent
_NEAR = 0.25  # metres; a nearer look-ahead point gives no direction
_BRAKING = 1.5  # m/s2 before a stop
_BESIDE = 1.2  # metres before the end of the path from which the straight distance to the goal counts
_THERE, _REACHED = 0.15, 0.3  # metres at which the position of a pause, or a waypoint, is reached

Vector2 = tuple[float, float]


class Route:
    """A pedestrian's progress on its route."""

    def __init__(self, actor: ActorPlan) -> None:
        points = [(actor.start.x, actor.start.y), *((p.x, p.y) for p in actor.route)]
        self.path = Path(points)
        self.metres = self.aside = 0.0  # along the path and to the left of it
        self._leg = 0
        self._pauses: list[tuple[float, float]] = []  # metres, seconds
        self._pausing_until = -math.inf
        if actor.pauses:
            metres = [0.0]
            for (ax, ay), (bx, by) in pairwise(points):
                metres.append(metres[-1] + math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay)))
            self._pauses = [(metres[p.waypoint + 1], p.seconds) for p in actor.pauses if p.waypoint + 1 < len(metres)]
        self._next_pause = 0

    @property
    def left(self) -> float:
        """Metres to the goal."""
        return self.path.length - self.metres

    def advance(self, x: float, y: float) -> None:
        """Update the progress."""
        legs = self.path.legs
        metres, self.aside, self._leg = self.path.locate(x, y, self._leg)
        while self._leg + 1 < len(legs):
            ax, ay, tx, ty, start, _ = legs[self._leg + 1]
            dx, dy = x - ax, y - ay
            along, aside = dx * tx + dy * ty, dy * tx - dx * ty
            if start - metres > _REACHED and (along <= 0.0 or abs(aside) >= abs(self.aside)):
                break
            self._leg, metres, self.aside = self._leg + 1, start + along, aside
        self.metres = max(metres, self.path.start_of(self._leg))

    def pauses(self, seconds: float, standing: bool) -> bool:
        """Return whether the pedestrian pauses now."""
        if seconds < self._pausing_until:
            return True
        if self._next_pause < len(self._pauses):
            metres, duration = self._pauses[self._next_pause]
            if self.metres > metres - _THERE and (standing or self.metres > metres):
                self._next_pause += 1
                self._pausing_until = seconds + duration
                return True
        return False

    def to_stop(self, x: float, y: float) -> float:
        """Return the metres to the next pause, or to the goal, also from beside or beyond it."""
        left = self.left if self.left > _BESIDE else self.distance_to_goal(x, y)
        if self._next_pause < len(self._pauses):
            return min(left, max(0.0, self._pauses[self._next_pause][0] - self.metres))
        return left

    def direction(self, x: float, y: float, speed: float, *, passing: bool) -> Vector2:
        """Return the direction to a point of the path ahead, as a unit vector.

        Args:
            x: position, metres.
            y: position, metres.
            speed: m/s.
            passing: whether the pedestrian is passing another agent; it then returns to its path later.
        """
        look = max(_LEAST_LOOK, _LOOK_SECONDS * speed, min(abs(self.aside), 3.0))
        end = self.path.length
        if passing and self.path.legs:
            look = max(look, min(_PASSING_LOOK, self.path.start_of(self._leg + 1) - self.metres))
        px, py = self.path.at(min(self.metres + look, end))
        dx, dy = px - x, py - y
        size = math.sqrt(dx * dx + dy * dy)
        if size < _NEAR and self.left > look:
            return self.path.tangent(self.metres + look)
        return (dx / size, dy / size) if size > 1e-6 else (1.0, 0.0)

    def ahead(self, metres: float) -> Vector2:
        """Return the point of the path some metres ahead; the goal if that is nearer."""
        return self.path.at(min(self.metres + metres, self.path.length))

    def distance_to_goal(self, x: float, y: float) -> float:
        """Return the straight distance to the goal."""
        px, py = self.path.at(self.path.length)
        return math.sqrt((px - x) * (px - x) + (py - y) * (py - y))


def braking_speed(distance: float) -> float:
    """Return the maximum speed, m/s, from which a stop within a distance in metres is possible."""
    return math.sqrt(2.0 * _BRAKING * max(0.0, distance))
