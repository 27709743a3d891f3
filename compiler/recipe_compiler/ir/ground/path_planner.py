"""Plans paths of pedestrians around obstacles: shortest paths on the visibility graph of obstacle corners.

A path is straight if the straight line is free. Otherwise the graph consists of the corners of the obstacles that block
it, enlarged by the clearance. Obstacles that block the shortest path so far are added until none does; if there is no
path, obstacles that cover the corners of others are added as well. The result is the shortest path around all
obstacles, except that it may be longer where obstacles touch.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from itertools import pairwise

from recipe_compiler.ir.ground.obstacles import Obstacle, ObstacleMap
from recipe_compiler.ir.plan_types import fixed

CLEARANCE = 0.35  # metres between the middle of a pedestrian and an obstacle
BODY = 0.2  # metres: minimum distance between the middle of a pedestrian and an obstacle
_OUTSIDE = 0.01  # metres from the clearance to the corners where paths bend
_MAX_OBSTACLES = 160  # in one search; paths around more of them are not found
_STEP = 0.25  # metres, grid spacing of candidates for free positions
_RINGS = 200  # maximum number of rings of candidates
_PLACE = 8  # cost of testing whether a position is clear, in tests of one obstacle
_EPSILON = 1e-6  # metres

XY = tuple[float, float]


class TooManyObstaclesError(Exception):
    """A path leads around too many obstacles."""


class TooMuchWorkError(Exception):
    """Planning takes more work than is allowed for a recipe."""


class Work:
    """The remaining work allowed for planning, in tests of one obstacle; a million take about half a second."""

    def __init__(self, limit: float = math.inf) -> None:
        self.left = limit

    def spend(self, tests: float) -> None:
        """Subtract some work.

        Raises:
            TooMuchWorkError: there is not enough left.
        """
        self.left -= tests
        if self.left < 0:
            raise TooMuchWorkError


class Planner:
    """Plans paths among obstacles. Equal queries have equal results until the work allowed is used up."""

    def __init__(self, obstacles: ObstacleMap, work: float = math.inf, total: Work | None = None) -> None:
        """Create a planner.

        Args:
            obstacles: the obstacles.
            work: number of line segments that all searches together may test.
            total: the work left for this and other planners; `TooMuchWorkError` is raised when it is used up.
        """
        self._obstacles, self._work, self._total = obstacles, work, total or Work()

    def inside(self, x: float, y: float, body: float = BODY) -> Obstacle | None:
        """Return an obstacle that a body at a position would intersect, or None."""
        return self._obstacles.at(x, y, body)

    def clear(self, x: float, y: float) -> bool:
        """Return whether a position keeps the clearance to all obstacles."""
        return self._obstacles.at(x, y, CLEARANCE) is None

    def nearest_free(
        self,
        x: float,
        y: float,
        allowed: Callable[[float, float], bool] = lambda x, y: True,
        work: Work | None = None,
    ) -> XY | None:
        """Return the clear position nearest to a position, on a grid of 0.25 m; None if there is none nearby.

        Args:
            x: position, metres.
            y: position, metres.
            allowed: returns whether a position may be returned.
            work: the work left for the search; by default the planner's.
        """
        work = work or self._total
        i0, j0 = math.floor(x / _STEP + 0.5), math.floor(y / _STEP + 0.5)
        best: tuple[float, XY] | None = None
        for ring in range(_RINGS):
            if best is not None and best[0] < (ring - 1) * _STEP:
                break
            work.spend(_PLACE * 8 * ring)
            for i, j in _ring(ring):
                at = ((i0 + i) * _STEP, (j0 + j) * _STEP)
                distance = _distance((x, y), at)
                if (best is None or distance < best[0]) and self.clear(*at) and allowed(*at):
                    best = distance, at
        return None if best is None else best[1]

    def shortest_path(self, start: XY, goal: XY) -> list[XY] | None:
        """Return the waypoints of the shortest path, without the start, ending with the goal; None if there is no path.

        Raises:
            TooManyObstaclesError: the path leads around too many obstacles, or the work allowed is used up.
        """
        found = self._blocking(start, goal, start, goal)
        search, points = _Search(self._obstacles, start, goal, self._total), [start, goal]
        while found:
            if self._work < 0:
                raise TooManyObstaclesError
            search.add(found)
            before = search.tests
            shortest = search.shortest()
            self._work -= search.tests - before
            if shortest is None:
                found = [o for o in search.covering if o not in search.obstacles]
                if found:
                    continue
                return None
            points = shortest
            across = (o for a, b in pairwise(points) for o in self._blocking(a, b, start, goal))
            found = [o for o in across if o not in search.obstacles]
        return [*((fixed(x), fixed(y)) for x, y in points[1:-1]), goal]

    def _blocking(self, a: XY, b: XY, start: XY, goal: XY) -> list[Obstacle]:
        """Return the obstacles to which a straight line from `a` to `b` does not keep the margin."""
        self._total.spend(self._obstacles.cells_along((*a, *b)))
        across = self._obstacles.across((*a, *b), CLEARANCE)
        return [o for o in across if o.meets((*a, *b), margin(o, start, goal))]


class _Search:
    """A search for the shortest path among a growing set of obstacles."""

    def __init__(self, around: ObstacleMap, start: XY, goal: XY, total: Work) -> None:
        self.obstacles: list[Obstacle] = []
        self.covering: list[Obstacle] = []  # obstacles that cover corners of these
        self._around, self._total = around, total
        self.tests = 0
        self._points = [start, goal]
        self._margins: list[float] = []
        self._tested: dict[tuple[int, int], int] = {}  # pair of points -> obstacles that do not block it; -1: blocked

    def add(self, obstacles: Sequence[Obstacle]) -> None:
        """Take obstacles into account.

        Raises:
            TooManyObstaclesError: there are too many obstacles.
        """
        start, goal = self._points[:2]
        for o in obstacles:
            if o in self.obstacles:
                continue
            if len(self.obstacles) >= _MAX_OBSTACLES:
                raise TooManyObstaclesError
            self.obstacles.append(o)
            self._margins.append(margin(o, start, goal))
            for corner in o.corners(CLEARANCE + _OUTSIDE):
                over = self._around.at(*corner, CLEARANCE)
                if over is None:
                    self._points.append(corner)
                else:
                    self.covering.append(over)

    def shortest(self) -> list[XY] | None:
        """Return the shortest path from the start to the goal by A*; None if there is none."""
        points = self._points
        cost, before = {0: 0.0}, {0: 0}
        queue, done = [(_distance(points[0], points[1]), 0)], set()
        while queue:
            _, here = heapq.heappop(queue)
            if here in done:
                continue
            if here == 1:
                path = [1]
                while path[-1]:
                    path.append(before[path[-1]])
                return [points[n] for n in reversed(path)]
            done.add(here)
            before_here = self.tests
            for there in range(1, len(points)):
                if there in done:
                    continue
                through = cost[here] + _distance(points[here], points[there])
                if through < cost.get(there, math.inf) - _EPSILON and self._free(here, there):
                    cost[there], before[there] = through, here
                    heapq.heappush(queue, (through + _distance(points[there], points[1]), there))
            self._total.spend(self.tests - before_here + len(points))
        return None

    def _free(self, a: int, b: int) -> bool:
        """Return whether the straight line between two points is free of the obstacles so far."""
        key = (a, b) if a < b else (b, a)
        tested = self._tested.get(key, 0)
        if tested < 0:
            return False
        segment = (*self._points[a], *self._points[b])
        self.tests += len(self.obstacles) - tested
        for number in range(tested, len(self.obstacles)):
            if self.obstacles[number].meets(segment, self._margins[number]):
                self._tested[key] = -1
                return False
        self._tested[key] = len(self.obstacles)
        return True


def margin(obstacle: Obstacle, start: XY, goal: XY) -> float:
    """Return the distance to keep from an obstacle: the clearance, or less if the start or the goal is nearer."""
    return min(CLEARANCE, *(max(0.0, obstacle.outside(x, y) - _EPSILON) for x, y in (start, goal)))


def _ring(n: int) -> list[tuple[int, int]]:
    """Return the cells of a square ring around the origin."""
    if n == 0:
        return [(0, 0)]
    sides = [(i, j) for i in range(-n, n + 1) for j in (-n, n)]
    return sides + [(i, j) for j in range(1 - n, n) for i in (-n, n)]


def _distance(a: XY, b: XY) -> float:
    dx, dy = a[0] - b[0], a[1] - b[1]
    return math.sqrt(dx * dx + dy * dy)
