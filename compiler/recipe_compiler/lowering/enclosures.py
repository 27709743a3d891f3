"""Finds yards: ground that is enclosed by buildings and walls.

A breadth-first search on a grid of square cells decides whether a lane or a sidewalk can be reached from a place.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Set as AbstractSet

from recipe_compiler.library.towns import Town

_CELL = 0.5  # edge length of a cell, metres
_REACH = 40.0  # metres; a place from which cells at this distance can be reached is not enclosed

Cell = tuple[int, int]


class Yards:
    """The yards of a town, found as they are asked for."""

    def __init__(self, town: Town) -> None:
        self._town = town
        self._spots: frozenset[Cell] | None = None
        self._bounds = (0.0, 0.0), (0.0, 0.0)  # of the obstacles, as x and y ranges of cells; set with the spots
        self._yards: list[set[Cell]] = []  # found so far
        self._open: set[Cell] = set()  # cells known not to be enclosed

    @staticmethod
    def cell(x: float, y: float) -> Cell:
        """Return the cell of a place."""
        return math.floor(x / _CELL), math.floor(y / _CELL)

    def around(self, x: float, y: float) -> AbstractSet[Cell]:
        """Return the cells that can be reached from a place.

        The result is empty if the place is not enclosed: if a spawn point, a cell `_REACH` metres away, or a cell
        outside the rectangle of all obstacles can be reached.
        """
        if self._spots is None:
            self._spots = frozenset(self.cell(point.pose.x, point.pose.y) for point in self._town.spawn_points)
            (x0, x1), (y0, y1) = self._town.obstacles.bounds
            self._bounds = (x0 / _CELL, x1 / _CELL), (y0 / _CELL, y1 / _CELL)
        (west, east), (south, north) = self._bounds
        start = self.cell(x, y)
        for yard in self._yards:
            if start in yard:
                return yard
        most, seen, edge = int(_REACH / _CELL), {start}, deque([start])
        while edge:
            i, j = edge.popleft()
            is_outside = not (west <= i < east and south <= j < north)
            is_far = max(abs(i - start[0]), abs(j - start[1])) > most
            if is_outside or is_far or (i, j) in self._spots or (i, j) in self._open:
                self._open |= seen
                return frozenset()
            for cell in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
                if cell not in seen and not self._blocked(cell):
                    seen.add(cell)
                    edge.append(cell)
        self._yards.append(seen)
        return seen

    def _blocked(self, cell: Cell) -> bool:
        """Whether an obstacle covers the middle of a cell or comes within half a cell of it."""
        return self._town.obstacles.at((cell[0] + 0.5) * _CELL, (cell[1] + 0.5) * _CELL, _CELL / 2) is not None
