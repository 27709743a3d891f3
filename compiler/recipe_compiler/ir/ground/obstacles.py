"""Obstacles on the ground as rotated rectangles.

Path planning, the checks of starts and goals, and the simulation of pedestrians share this model. All lengths are in
metres, in the world frame.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Element, Pose, PropPlan, TownPlan

BUILDINGS = frozenset({"building", "house", "tower"})
FRONTED = frozenset({"building", "house", "wall"})  # elements with the origin in the middle of their front
# Elements with the origin in their middle. A billboard's panel is above head height, so it is not solid.
FURNITURE = frozenset({"bench", "bin", "bollard", "bus_stop", "bush", "fence", "fountain", "guardrail", "hedge"})
FURNITURE |= {
    "bicycles",
    "board",
    "cafe",
    "delivery",
    "letter_box",
    "hydrant",
    "kiosk",
    "lamp",
    "planter",
    "statue",
    "tower",
    "traffic_light",
}
STEP_OVER = 0.25  # metres; people step over lower objects
HEADROOM = 1.9  # metres; people walk under higher objects
_BARK = 1.1  # half the side of a tree's square, as a multiple of its trunk's radius
_CELL = 4.0  # metres, edge length of a cell of the index
_REACH = 0.6  # metres, the greatest margin of a query
_MAX_CELLS = 4096  # of one obstacle in the index
_INFINITE = math.inf

Segment = tuple[float, float, float, float]  # x and y of its start, x and y of its end
Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A rotated rectangle."""

    name: str
    kind: str  # of the element; "prop" or "vehicle"
    x: float  # of its middle
    y: float
    cos: float  # of its yaw
    sin: float
    depth: float  # half its extent along its own x
    width: float  # half its extent along its own y

    @classmethod
    def of_element(cls, element: Element) -> Obstacle | None:
        """Return the footprint of a town's element; None if it is not solid."""
        kind = element.kind
        depth, width = element.size[0] / 2, element.size[1] / 2
        if kind == "tree":
            depth = width = _BARK * element.shape["trunk"]
        elif kind not in FURNITURE and kind not in FRONTED:
            return None
        back = depth if kind in FRONTED else 0.0
        return cls._placed(element.name, kind, element.pose, (-back, 0.0), (depth, width))

    @classmethod
    def of_prop(cls, prop: PropPlan, ground: float) -> Obstacle | None:
        """Return the footprint of a prop; None if people step over it or walk under it.

        Args:
            prop: the prop.
            ground: height of the ground at its origin.
        """
        sp, cp = exact.sin_cos_deg(prop.pose.pitch)
        sr, cr = exact.sin_cos_deg(prop.pose.roll)
        corners = [
            (cp * x + sp * (sr * y + cr * z), cr * y - sr * z, -sp * x + cp * (sr * y + cr * z))
            for x, y, z in itertools.product(*zip(prop.low, prop.high, strict=True))
        ]
        low = [min(corner[axis] for corner in corners) for axis in range(3)]
        high = [max(corner[axis] for corner in corners) for axis in range(3)]
        above = prop.pose.z - ground
        if high[2] + above < STEP_OVER or low[2] + above >= HEADROOM:
            return None
        middle = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2)
        return cls._placed(prop.name, "prop", prop.pose, middle, ((high[0] - low[0]) / 2, (high[1] - low[1]) / 2))

    @classmethod
    def of_vehicle(cls, actor: ActorPlan) -> Obstacle:
        """Return the footprint of a vehicle at its start."""
        return cls._placed(
            actor.name, "vehicle", actor.start, (0.0, 0.0), (actor.shape["length"] / 2, actor.shape["width"] / 2)
        )

    @classmethod
    def _placed(
        cls, name: str, kind: str, pose: Pose, middle: tuple[float, float], half: tuple[float, float]
    ) -> Obstacle:
        s, c = exact.sin_cos_deg(pose.yaw)
        x, y = pose.x + c * middle[0] - s * middle[1], pose.y + s * middle[0] + c * middle[1]
        return cls(name, kind, x, y, c, s, half[0], half[1])

    def outside(self, x: float, y: float) -> float:
        """Return by how much the rectangle must be enlarged on all sides to reach a point; negative inside."""
        dx, dy = x - self.x, y - self.y
        along, aside = self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx
        return max(abs(along) - self.depth, abs(aside) - self.width)

    def corners(self, margin: float) -> Sequence[tuple[float, float]]:
        """Return the corners of the rectangle, enlarged by a margin on all sides."""
        a, b = self.depth + margin, self.width + margin
        return [
            (self.x + self.cos * u - self.sin * v, self.y + self.sin * u + self.cos * v)
            for u, v in ((a, b), (-a, b), (-a, -b), (a, -b))
        ]

    def meets(self, segment: Segment, margin: float) -> bool:
        """Return whether a segment runs through the rectangle, enlarged by a margin."""
        return self.entry(segment, margin) < _INFINITE

    def entry(self, segment: Segment, margin: float) -> float:
        """Return the part of a segment, 0 to 1, before it enters the rectangle enlarged by a margin; else infinity."""
        x0, y0, x1, y1 = segment
        dx, dy = x0 - self.x, y0 - self.y
        ux, uy = x1 - x0, y1 - y0
        low, high = 0.0, 1.0
        for start, step, half in (
            (self.cos * dx + self.sin * dy, self.cos * ux + self.sin * uy, self.depth + margin),
            (self.cos * dy - self.sin * dx, self.cos * uy - self.sin * ux, self.width + margin),
        ):
            if abs(step) < 1e-9:
                if abs(start) >= half:
                    return _INFINITE
                continue
            a, b = (-half - start) / step, (half - start) / step
            low, high = max(low, min(a, b)), min(high, max(a, b))
            if low >= high:
                return _INFINITE
        return low


class ObstacleMap:
    """Obstacles in a uniform grid. All results are in the order in which obstacles were added."""

    def __init__(self, obstacles: Iterable[Obstacle], reach: float = _REACH, cell: float = _CELL) -> None:
        """Build the index.

        Args:
            obstacles: the obstacles.
            reach: the greatest margin of a query.
            cell: edge length of a cell.
        """
        self._all, self._cell = list(obstacles), cell
        self._cells: dict[tuple[int, int], list[tuple[int, Obstacle]]] = {}
        self._large: list[tuple[int, Obstacle]] = []  # obstacles that are near every place
        for number, o in enumerate(self._all):
            half_x = abs(o.cos) * o.depth + abs(o.sin) * o.width + reach
            half_y = abs(o.sin) * o.depth + abs(o.cos) * o.width + reach
            across = range(self._index(o.x - half_x), self._index(o.x + half_x) + 1)
            along = range(self._index(o.y - half_y), self._index(o.y + half_y) + 1)
            if len(across) * len(along) > _MAX_CELLS:
                self._large.append((number, o))
                continue
            entry = number, o  # shared by all cells, which may be millions
            for i in across:
                for j in along:
                    self._cells.setdefault((i, j), []).append(entry)

        columns, rows = [i for i, _ in self._cells] or [0], [j for _, j in self._cells] or [0]
        self._extent = (min(columns), max(columns)), (min(rows), max(rows))  # of the cells that are not empty

    @classmethod
    def of(
        cls, town: TownPlan, props: Iterable[tuple[PropPlan, float]] = (), reach: float = _REACH, cell: float = _CELL
    ) -> ObstacleMap:
        """Return the obstacles of a scene.

        Args:
            town: the town.
            props: the props, each with the height of the ground at its origin.
            reach: the greatest margin of a query.
            cell: edge length of a cell of the index.
        """
        found = [Obstacle.of_element(element) for element in town.elements]
        found += [Obstacle.of_prop(prop, ground) for prop, ground in props]
        return cls((obstacle for obstacle in found if obstacle is not None), reach, cell)

    def with_more(self, obstacles: Iterable[Obstacle], reach: float = _REACH) -> ObstacleMap:
        """Return a map of these obstacles and more, for queries with margins up to `reach`."""
        return ObstacleMap([*self._all, *obstacles], reach)

    def near(self, x: float, y: float) -> list[Obstacle]:
        """Return the obstacles within at least the map's reach of a point, and some farther ones."""
        here = self._cells.get((self._index(x), self._index(y)), [])
        return [o for _, o in (sorted(here + self._large, key=_number) if self._large else here)]

    def around(self, x: float, y: float, distance: float) -> list[Obstacle]:
        """Return the obstacles of which a part may be within a distance of a point along both axes."""
        found = dict(self._large)
        for i in range(self._index(x - distance), self._index(x + distance) + 1):
            for j in range(self._index(y - distance), self._index(y + distance) + 1):
                found.update(self._cells.get((i, j), ()))
        return [found[n] for n in sorted(found)]

    def at(self, x: float, y: float, margin: float = 0.0) -> Obstacle | None:
        """Return the first obstacle that covers a point when it is enlarged by a margin, at most the map's reach."""
        return next((o for o in self.near(x, y) if o.outside(x, y) < margin), None)

    def across(self, segment: Segment, margin: float) -> list[Obstacle]:
        """Return the obstacles, enlarged by a margin of at most the map's reach, through which a segment runs."""
        found = dict(self._large)
        for cell in self._along(segment):
            found.update(self._cells.get(cell, ()))
        return [found[n] for n in sorted(found) if found[n].meets(segment, margin)]

    @property
    def bounds(self) -> tuple[Span, Span]:
        """The ranges of x and of y outside which nothing is within the map's reach of an obstacle."""
        if self._large:
            return (-_INFINITE, _INFINITE), (-_INFINITE, _INFINITE)
        (west, east), (south, north) = self._extent
        size = self._cell
        return (west * size, (east + 1) * size), (south * size, (north + 1) * size)

    def cells_along(self, segment: Segment) -> float:
        """Return approximately how many cells `across` visits."""
        x0, y0, x1, y1 = segment
        (west, east), (south, north) = self._extent
        return min(abs(x1 - x0) / self._cell, east - west) + min(abs(y1 - y0) / self._cell, north - south)

    def _index(self, metres: float) -> int:
        return math.floor(metres / self._cell)

    def _along(self, segment: Segment) -> Iterator[tuple[int, int]]:
        """Yield the cells that a segment crosses; one may be missing near a corner, for which the reach compensates."""
        x0, y0, x1, y1 = segment
        if x0 > x1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        slope = (y1 - y0) / (x1 - x0) if x1 - x0 > 1e-9 else 0.0
        (west, east), (south, north) = self._extent
        for i in range(max(west, self._index(x0)), min(east, self._index(x1)) + 1):
            a, b = y0, y1
            if slope != 0.0:
                a = y0 + slope * (max(x0, i * self._cell) - x0)
                b = y0 + slope * (min(x1, (i + 1) * self._cell) - x0)
            for j in range(max(south, self._index(min(a, b))), min(north, self._index(max(a, b))) + 1):
                yield i, j


def _number(entry: tuple[int, Obstacle]) -> int:
    return entry[0]
