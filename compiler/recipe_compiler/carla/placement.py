"""Places a configuration in a town: one shift for all positions, and corrections of positions that are still occupied.

Absolute positions in CARLA's towns have no meaning in the library's towns, but relative positions do. So all positions
are moved by one vector, and nothing is rotated: directions, including the sun's, keep their meaning. The vector moves
the first actor (without actors, the first sensor) to a spawn point of its kind, or up to 2 m from it. Among these
vectors, the one with the lowest cost is chosen. Costs are points inside obstacles or off their lane or sidewalk, actors
hidden from the sensors by buildings, and the distance from the middle of the town. A point that is still inside an
obstacle is then moved to the nearest free position.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from recipe_compiler.ir import exact
from recipe_compiler.ir.ground.obstacles import BUILDINGS
from recipe_compiler.ir.ground.path_planner import Planner
from recipe_compiler.ir.plan import Pose
from recipe_compiler.library import towns
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering.enclosures import Yards

_OFFSETS = (0.0, -2.0, 2.0)  # metres from a spawn point, across and along its direction
_MAX_SPOTS = 150  # spawn points that are tried
_MAX_POINTS = 24  # points whose cost is computed
_LOW = 4.0  # metres: the view of lower cameras is blocked by buildings, and they are in the way of traffic
# Costs of a point:
_SOLID = 1000.0  # inside something solid
_OFF_LANE = 40.0  # a vehicle not on a lane
_ON_ROAD = 12.0  # a pedestrian on a road; half of it for a low camera
_HIDDEN = 6.0  # a building before a camera
_OBSTRUCTED = 2.0  # each obstacle on the way of an actor, or in the view of a camera
_PARTLY_HIDDEN = 0.5  # each smaller obstacle before a camera
_PER_METRE = 0.01  # cost per metre from the middle of the town
_LANE = 1.0  # metres by which a vehicle may deviate from a lane
_TURN = 25.0  # degrees by which a vehicle may deviate from a lane

XY = tuple[float, float]


@dataclass(frozen=True)
class Point:
    """A position of a configuration in the right-handed frame, before it is moved.

    Args:
        kind: what is at the position.
        x: metres.
        y: metres.
        z: height, of a sensor; metres.
        yaw: of a vehicle; degrees.
        goal: where a pedestrian goes, or a sensor moves.
    """

    kind: Literal["walker", "vehicle", "sensor"]
    x: float
    y: float
    z: float = 0.0
    yaw: float = 0.0
    goal: XY | None = None


class Site:
    """A town in which a configuration is placed."""

    def __init__(self, name: str) -> None:
        """Generate the town with a name and default parameters."""
        self.town = _town(name)
        self._planner = Planner(self.town.obstacles)
        self._yards = Yards(self.town)
        (x0, x1), (y0, y1) = self.town.streets.bounds
        self._middle = (0.0, 0.0) if x0 < 0.0 < x1 and y0 < 0.0 < y1 else ((x0 + x1) / 2, (y0 + y1) / 2)

    def shift(self, points: Sequence[Point]) -> XY:
        """Return the vector by which all points are moved, metres; (0, 0) without points."""
        if not points:
            return 0.0, 0.0
        actors = [point for point in points if point.kind != "sensor"]
        anchor = (actors or list(points))[0]
        compared = [anchor, *(point for point in points if point is not anchor)][:_MAX_POINTS]
        best: tuple[float, XY] | None = None
        for x, y in self._anchors(anchor):
            vector = (x - anchor.x, y - anchor.y)
            limit = math.inf if best is None else best[0]
            cost = self._cost(compared, vector, _length(x - self._middle[0], y - self._middle[1]), limit)
            if cost < limit:
                best = cost, vector
        assert best is not None
        return round(best[1][0], 2) + 0.0, round(best[1][1], 2) + 0.0  # centimetres are easy to read

    def free(self, x: float, y: float, *, vehicle: bool) -> XY:
        """Return a position if an actor can stand there and leave it, or else the nearest such position."""
        blocked = self._planner.inside(x, y, 0.0) if vehicle else self._planner.inside(x, y)
        if blocked is None and not self._in_yard(x, y):
            return x, y
        return self._planner.nearest_free(x, y, lambda u, v: not self._in_yard(u, v)) or (x, y)

    def lane(self, x: float, y: float) -> Pose:
        """Return the nearest spawn point for vehicles, which is on a lane and faces along it."""
        return min(self.town.spots["vehicle"], key=lambda spot: (_length(spot.x - x, spot.y - y), spot.x, spot.y))

    def _anchors(self, anchor: Point) -> Iterator[XY]:
        """Yield the candidate positions of the anchor, those near the middle of the town first."""
        spots = self.town.spots["vehicle" if anchor.kind == "vehicle" else "pedestrian"]
        if anchor.kind == "vehicle":
            spots = tuple(spot for spot in spots if _angle_between(spot.yaw, anchor.yaw) < _TURN) or spots
        mx, my = self._middle
        near = sorted(spots, key=lambda spot: (_length(spot.x - mx, spot.y - my), spot.x, spot.y))
        for spot in near[:_MAX_SPOTS]:
            s, c = exact.sin_cos_deg(spot.yaw)
            for across in _OFFSETS if anchor.kind != "vehicle" else (0.0,):
                for along in _OFFSETS:
                    yield spot.x + c * along - s * across, spot.y + s * along + c * across

    def _cost(self, points: Sequence[Point], vector: XY, distance: float, limit: float) -> float:
        """Return the cost of a shift; if it exceeds `limit`, some value that is at least `limit`."""
        moved = [(point, (point.x + vector[0], point.y + vector[1])) for point in points]
        total = distance * _PER_METRE
        cameras = [at for point, at in moved if point.kind == "sensor" and point.z < _LOW]
        for point, (x, y) in moved:
            if total >= limit:
                break
            if point.kind == "sensor":
                total += self._cost_of_sensor(point, x, y, vector)
            else:
                total += self._cost_of_actor(point, x, y, vector, cameras)
        return total

    def _cost_of_sensor(self, point: Point, x: float, y: float, vector: XY) -> float:
        solid = self.town.obstacles.at(x, y, 0.3)
        low = point.z < _LOW
        inside = solid is not None and (solid.kind in BUILDINGS or low)
        cost = _SOLID * inside + _ON_ROAD / 2 * (low and self._is_road(x, y))
        if point.goal is None:
            return cost
        way = (x, y, point.goal[0] + vector[0], point.goal[1] + vector[1])
        across = [o for o in self.town.obstacles.across(way, 0.3) if low or o.kind in BUILDINGS]
        return cost + sum(_SOLID / 4 if o.kind in BUILDINGS else _OBSTRUCTED for o in across)

    def _cost_of_actor(self, point: Point, x: float, y: float, vector: XY, cameras: Sequence[XY]) -> float:
        if point.kind == "vehicle":
            cost = _SOLID * (self._planner.inside(x, y, 0.0) is not None)
            return cost + _OFF_LANE * (not self._on_lane(x, y, point.yaw)) + self._hidden((x, y), cameras)
        ways = [(x, y)]
        if point.goal is not None:
            ways.append((point.goal[0] + vector[0], point.goal[1] + vector[1]))
        cost = sum(_SOLID * (not self._can_walk(*at)) + _ON_ROAD * self._is_road(*at) for at in ways)
        if len(ways) == 2:
            cost += _OBSTRUCTED * len(self.town.obstacles.across((*ways[0], *ways[1]), 0.3))
            ways.append(((ways[0][0] + ways[1][0]) / 2, (ways[0][1] + ways[1][1]) / 2))
        return cost + sum(self._hidden(at, cameras) for at in ways)

    def _hidden(self, at: XY, cameras: Sequence[XY]) -> float:
        """Return the cost of obstacles between a position and the cameras: buildings hide it, others hide parts."""
        across = (self.town.obstacles.across((*camera, *at), 0.0) for camera in cameras)
        return sum(
            _HIDDEN if any(o.kind in BUILDINGS for o in found) else _PARTLY_HIDDEN * len(found) for found in across
        )

    def _can_walk(self, x: float, y: float) -> bool:
        """Return whether a pedestrian can stand at a position and leave it."""
        return self._planner.clear(x, y) and not self._in_yard(x, y)

    def _in_yard(self, x: float, y: float) -> bool:
        """Return whether a position is enclosed by buildings and walls."""
        return bool(self._yards.around(x, y))

    def _is_road(self, x: float, y: float) -> bool:
        """Return whether a position is on a road or outside the town."""
        (x0, x1), (y0, y1) = self.town.streets.bounds
        if not (x0 < x < x1 and y0 < y < y1):
            return True
        return self.town.ground(x, y) < self.town.spots["pedestrian"][0].z

    def _on_lane(self, x: float, y: float, yaw: float) -> bool:
        return any(_fits(spot, x, y, yaw) for spot in self.town.spots["vehicle"])


@functools.lru_cache(maxsize=len(towns.NAMES))
def _town(name: str) -> Town:
    return towns.build(name, 0, {})


def _fits(spot: Pose, x: float, y: float, yaw: float) -> bool:
    """Return whether a vehicle is on the lane of a spawn point, within 12 m of it, and faces its direction."""
    dx, dy = x - spot.x, y - spot.y
    if abs(dx) > 12.0 or abs(dy) > 12.0 or _angle_between(spot.yaw, yaw) > _TURN:
        return False
    s, c = exact.sin_cos_deg(spot.yaw)
    return abs(c * dy - s * dx) < _LANE


def _angle_between(a: float, b: float) -> float:
    """Return the angle between two directions, 0 to 180 degrees."""
    return abs((a - b + 180.0) % 360.0 - 180.0)


def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)
