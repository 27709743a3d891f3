"""Steering of a vehicle along a path, at an offset to its left.

Angles are given by their tangents, which need no trigonometry.
"""

from __future__ import annotations

from recipe_runtime.simulation.path import Path
from recipe_runtime.simulation.traffic.lateral import Lateral

_LOCK = 0.27  # largest curvature of any vehicle's path, 1/m
_SLOPE = 1.3  # tangent of the largest steering angle
_ROUND = 1.0  # metres to both sides over which corners of the path are rounded
_NEAREST = 2.4  # shortest look-ahead distance from the rear axle, metres
_BEHIND, _PREPARE = 1.5, 6.0  # metres behind the rear axle and ahead of the front axle where bends count

Vector2 = tuple[float, float]


class Steering:
    """Controls the front wheels of a vehicle that follows a path."""

    def __init__(self, path: Path, wheelbase: float, rear: float) -> None:
        """Create a controller.

        Args:
            path: What it follows.
            wheelbase: Metres between the axles.
            rear: Metres from its origin back to the rear axle.
        """
        self._path, self._wheelbase, self._rear = path, wheelbase, rear
        self._front_leg = self._rear_leg = 0
        self.lock = wheelbase * min(_LOCK, _SLOPE / wheelbase)

    def go_back(self, metres: float) -> int:
        """Look for the axles from an arc length of the path onward again; return the leg there."""
        leg = self._path.leg_at(metres)
        self._front_leg = self._rear_leg = leg
        return leg

    def target(self, place: Vector2, heading: Vector2, speed: float, lateral: Lateral) -> float:
        """Return the wanted tangent of the steering angle, positive to the left.

        In a bend, the rear wheels take a tighter path than the front wheels. In left bends, which have road on the
        inside, the front axle follows the lane. In right bends, which have the kerb on the inside, the rear axle does.

        Args:
            place: The vehicle's origin, metres in the world frame.
            heading: Unit vector.
            speed: m/s.
            lateral: Its motion across the path.
        """
        hx, hy = heading
        x, y = place[0] - self._rear * hx, place[1] - self._rear * hy
        here, _, self._rear_leg = self._path.locate(x, y, self._rear_leg)
        if self._path.next_bend(here - _BEHIND, here + self._wheelbase + _PREPARE) < 0.0:
            wanted = self._pursue((x, y), here, heading, speed, lateral)
        else:
            wanted = self._stanley((x + self._wheelbase * hx, y + self._wheelbase * hy), heading, speed, lateral)
        return max(-self.lock, min(self.lock, wanted))

    def _stanley(self, front: Vector2, heading: Vector2, speed: float, lateral: Lateral) -> float:
        """Steer the front axle along the path, after S. Thrun et al., Stanley (Journal of Field Robotics, 2006)."""
        here, aside, self._front_leg = self._path.locate(*front, self._front_leg)
        left = self._path.left(here + 0.3)
        aside, slope = lateral.line - aside, lateral.slope
        tx, ty = left[1] + slope * left[0], -left[0] + slope * left[1]
        cross, dot = heading[0] * ty - heading[1] * tx, heading[0] * tx + heading[1] * ty
        if dot <= 0.1:
            return self.lock if cross > 0.0 else -self.lock
        turn, shift = cross / dot, 1.5 * aside / (max(speed, 0.0) + 1.0)
        rest = 1.0 - turn * shift  # the tangent of a sum of angles
        if rest <= 0.1:
            return self.lock if turn > 0.0 else -self.lock
        return (turn + shift) / rest

    def _pursue(self, rear: Vector2, here: float, heading: Vector2, speed: float, lateral: Lateral) -> float:
        """Steer the rear axle to a point of the path ahead: pure pursuit (R. C. Coulter, 1992)."""
        reach = max(_NEAREST, 0.45 * speed)
        offset = lateral.line + reach * lateral.slope
        (ax, ay), (bx, by) = self._path.at(here + reach - _ROUND), self._path.at(here + reach + _ROUND)
        px, py = 0.5 * (ax + bx), 0.5 * (ay + by)
        left = self._path.left(here + reach) if offset else (0.0, 0.0)
        dx, dy = px + offset * left[0] - rear[0], py + offset * left[1] - rear[1]
        aside = heading[0] * dy - heading[1] * dx
        return self._wheelbase * 2.0 * aside / max(dx * dx + dy * dy, 1.0)
