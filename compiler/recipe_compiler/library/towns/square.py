"""The walkable lattice of a square: pedestrians walk along its lines; trees and furniture stand in its cells."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Point, Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns.streets import SIDE, XY, StreetGrid, until

CELL = 6.0  # distance between lattice lines, metres
HEART = 10.0  # distance between the two lattice lines on either side of the middle, metres


def lines(half: float) -> tuple[float, ...]:
    """Return the coordinates of the lattice lines along one axis; the outermost ones follow the square's edges.

    Args:
        half: half the square's extent along this axis, metres.
    """
    found, at = [], HEART / 2
    while at < half - SIDE - 4.0:
        found.append(at)
        at += CELL
    found.append(half - SIDE)
    return (*(-a for a in reversed(found)), *found)


@dataclass(frozen=True)
class SquareGrid(StreetGrid):
    """Four streets around a square that is centred on (0, 0)."""

    half: tuple[float, float] = (0.0, 0.0)  # half the square's extents along x and y, metres

    def on_square(self, x: float, y: float) -> bool:
        """Whether a point is on the square."""
        return abs(x) < self.half[0] and abs(y) < self.half[1]

    def walk(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Generate a pedestrian's route: on the square's lattice if it starts on the square, else on the sidewalks."""
        if not self.on_square(start.x, start.y):
            return super().walk(start, length_m, stream)
        offset = stream.uniform(-0.5, 0.5)
        axes = (lines(self.half[0]), lines(self.half[1]))
        s, c = exact.sin_cos_deg(start.yaw)
        along_x = abs(c) >= abs(s)
        step = (1 if c > 0 else -1, 0) if along_x else (0, 1 if s > 0 else -1)
        node = self._ahead(axes, start, step)
        points: list[XY] = []
        length, at = 0.0, (start.x, start.y)
        while length < length_m and len(points) < 1_000:
            aim = (axes[0][node[0]] + offset, axes[1][node[1]] + offset)
            points.append(aim)
            length += abs(aim[0] - at[0]) + abs(aim[1] - at[1])
            at = aim
            step = self._turn(axes, node, step, stream)
            node = (node[0] + step[0], node[1] + step[1])
        return until((start.x, start.y), points, length_m)

    def _ahead(self, axes: tuple[tuple[float, ...], ...], start: Pose, step: tuple[int, int]) -> tuple[int, int]:
        """Return the next lattice node ahead of `start` in the direction `step`."""
        i, j = (min(range(len(a)), key=lambda k: abs(a[k] - v)) for a, v in zip(axes, (start.x, start.y), strict=True))
        near = [axes[0][i], axes[1][j]]
        for axis, (here, way) in enumerate(((start.x, step[0]), (start.y, step[1]))):
            if way and (near[axis] - here) * way < 0.0:
                index = (i, j)[axis] + way
                index = max(0, min(len(axes[axis]) - 1, index))
                i, j = (index, j) if axis == 0 else (i, index)
        return i, j

    def _turn(
        self, axes: tuple[tuple[float, ...], ...], node: tuple[int, int], step: tuple[int, int], stream: Stream
    ) -> tuple[int, int]:
        """Draw the next step: straight on (weight 2), left or right (weight 1 each); back only at a dead end."""
        sides = [(step[1], -step[0]), (-step[1], step[0])]
        options = [s for s in (step, step, *sides) if self._open(axes, node, s)]
        return stream.choice(options) if options else (-step[0], -step[1])

    def _open(self, axes: tuple[tuple[float, ...], ...], node: tuple[int, int], step: tuple[int, int]) -> bool:
        """Whether the lattice has a node one step ahead."""
        i, j = node[0] + step[0], node[1] + step[1]
        return 0 <= i < len(axes[0]) and 0 <= j < len(axes[1])
