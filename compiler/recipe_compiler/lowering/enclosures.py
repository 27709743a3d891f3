"""Warns of starts, goals and waypoints inside a building, and of starts in a yard enclosed by buildings and walls.

Walls, fences and buildings are rectangles on the ground. A breadth-first search on a grid of square cells decides
whether a lane or a sidewalk can be reached from the start.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import ActorPlan, Element
from recipe_compiler.library.towns import Town
from recipe_compiler.schema.scene import Actor, GroundPoint
from recipe_compiler.source.yaml_reader import Value

_BUILDINGS = ("building", "house", "tower")
_BEHIND = ("building", "house", "wall")  # elements with the origin in the middle of their front
_AROUND = ("fence", "guardrail", "hedge", "tower")  # elements with the origin in their middle
_CELL = 0.5  # edge length of a cell, metres
_BLOCK = 16.0  # edge length of the squares in which buildings are looked up, metres
_REACH = 40.0  # metres; a start from which cells at this distance can be reached is not enclosed
_REMEDY = "move it to a lane or a sidewalk, which a map of the town shows"

Cell = tuple[int, int]


def of_enclosed_starts(
    base: Value, actors: Sequence[ActorPlan], routed: Collection[str], town: Town
) -> Iterator[Problem]:
    """Yield warnings for starts inside a building, and for starts in a yard that the actor cannot leave.

    Args:
        base: the recipe's base, for the places of its values.
        actors: the actors whose start is given in the recipe.
        routed: names of the actors whose route or goal is given too; their route may stay within a yard.
        town: the town.
    """
    ground = _Ground(town) if actors else None
    for actor in actors:
        assert ground is not None
        x, y = actor.start.x, actor.start.y
        house = ground.building(x, y)
        if house is not None:
            what = f"it is inside {house}"
        else:
            yard = ground.yard(x, y)
            if not yard or (actor.name in routed and all(_cell(p.x, p.y) in yard for p in actor.route)):
                continue
            what = "it is in a yard enclosed by buildings and walls, which the actor cannot leave"
        place = base.place_of("actors", actor.name, "start")
        yield Problem(f"actors.{actor.name}.start: {what}", place, _REMEDY, Code.PLACEMENT)


def of_enclosed_goals(base: Value, actors: Mapping[str, Actor], town: Town) -> Iterator[Problem]:
    """Yield warnings for goals and waypoints inside a building: the actor would walk on the spot at its wall.

    Args:
        base: the recipe's base, for the places of its values.
        actors: the actors as the recipe gives them.
        town: the town.
    """
    ways: list[tuple[tuple[str | int, ...], GroundPoint]] = []
    for name, actor in actors.items():
        ways += [((name, "goal"), actor.goal)] if actor.goal is not None else []
        ways += [((name, "route", number), point) for number, point in enumerate(actor.route or ())]
    ground = _Ground(town) if ways else None
    for path, point in ways:
        assert ground is not None
        house = ground.building(point.x, point.y)
        if house is not None:
            label = ".".join(map(str, path[:2])) + "".join(f"[{number}]" for number in path[2:])
            place = base.place_of("actors", *path)
            yield Problem(f"actors.{label}: it is inside {house}", place, _REMEDY, Code.PLACEMENT)


@dataclass(frozen=True)
class _Obstacle:
    """The ground plan of an obstacle: a rotated rectangle, in metres."""

    name: str
    building: bool
    x: float  # of its middle
    y: float
    cos: float  # of its yaw
    sin: float
    depth: float  # half its depth
    width: float  # half its width

    @classmethod
    def of(cls, element: Element) -> _Obstacle:
        """The ground plan of an element."""
        s, c = exact.sin_cos_deg(element.pose.yaw)
        depth, width = element.size[0] / 2, element.size[1] / 2
        back = depth if element.kind in _BEHIND else 0.0
        x, y = element.pose.x - c * back, element.pose.y - s * back
        return cls(element.name, element.kind in _BUILDINGS, x, y, c, s, depth, width)

    def covers(self, x: float, y: float, margin: float = 0.0) -> bool:
        """Whether a point is inside the rectangle, enlarged by a margin on all sides."""
        dx, dy, reach = x - self.x, y - self.y, self.depth + self.width + margin
        if abs(dx) > reach or abs(dy) > reach:
            return False
        along, aside = self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx
        return abs(along) < self.depth + margin and abs(aside) < self.width + margin


class _Ground:
    """The ground of a town as a grid of square cells, and the obstacles on it."""

    def __init__(self, town: Town) -> None:
        kinds = (*_BEHIND, *_AROUND)
        self._obstacles = [_Obstacle.of(e) for e in town.plan.elements if e.kind in kinds]
        self._buildings: dict[Cell, list[_Obstacle]] = {}  # by the squares of `_BLOCK` that they may reach into
        for o in self._obstacles:
            reach = o.depth + o.width
            if o.building:
                for i in range(math.floor((o.x - reach) / _BLOCK), math.floor((o.x + reach) / _BLOCK) + 1):
                    for j in range(math.floor((o.y - reach) / _BLOCK), math.floor((o.y + reach) / _BLOCK) + 1):
                        self._buildings.setdefault((i, j), []).append(o)
        self._spots = {_cell(point.pose.x, point.pose.y) for point in town.spawn_points}
        self._yards: list[set[Cell]] = []  # found so far
        self._open: set[Cell] = set()  # cells known not to be enclosed

    def building(self, x: float, y: float) -> str | None:
        """Return the name of the building that covers a point, or None."""
        near = self._buildings.get((math.floor(x / _BLOCK), math.floor(y / _BLOCK)), ())
        return next((o.name for o in near if o.covers(x, y)), None)

    def yard(self, x: float, y: float) -> set[Cell]:
        """Return the cells that can be reached from a point.

        The result is empty if the point is not enclosed: if a spawn point, or a cell `_REACH` metres away, can be
        reached.
        """
        start = _cell(x, y)
        for yard in self._yards:
            if start in yard:
                return yard
        near = [o for o in self._obstacles if max(abs(o.x - x), abs(o.y - y)) < 2 * _REACH]
        most, seen, edge = int(_REACH / _CELL), {start}, deque([start])
        while edge:
            i, j = edge.popleft()
            if (i, j) in self._spots or (i, j) in self._open or max(abs(i - start[0]), abs(j - start[1])) > most:
                self._open |= seen
                return set()
            for cell in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
                if cell not in seen and not _blocked(near, cell):
                    seen.add(cell)
                    edge.append(cell)
        self._yards.append(seen)
        return seen


def _cell(x: float, y: float) -> Cell:
    return math.floor(x / _CELL), math.floor(y / _CELL)


def _blocked(obstacles: Sequence[_Obstacle], cell: Cell) -> bool:
    """Whether an obstacle covers the middle of a cell or comes within half a cell of it."""
    x, y = (cell[0] + 0.5) * _CELL, (cell[1] + 0.5) * _CELL
    return any(o.covers(x, y, _CELL / 2) for o in obstacles)
