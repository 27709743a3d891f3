"""A grid of streets: its dimensions, the height of its ground, and random routes through it.

Streets along y are centred on the coordinates `xs`, streets along x on `ys`; they cross at junctions. A street has two
lanes with right-hand traffic, and may have parking bays along both kerbs. Kerbs are rounded at the four corners of
every junction. Lengths are in metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Point, Pose
from recipe_compiler.ir.plan_types import fixed
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns.town import Span

LANE = 3.0  # width of a lane; a carriageway has two
BAY = 2.3  # width of the parking bays along a kerb
KERB = 0.15  # height of a kerb
CORNER = 3.0  # radius of the kerb at a junction
SIDE = 3.5  # from the kerb to the middle of the sidewalk, and from the cross street's kerb to the middle of a crossing
STOP = SIDE + 2.5  # from the cross street's kerb to the stop line

Cell = tuple[int, int]  # a unit step along x or y, or the indices of a junction
XY = tuple[float, float]


def _direction(yaw: float) -> Cell:
    """Return the grid direction nearest to a yaw in degrees."""
    s, c = exact.sin_cos_deg(yaw)
    if abs(c) >= abs(s):
        return (1 if c > 0 else -1, 0)
    return (0, 1 if s > 0 else -1)


def _right(d: Cell) -> Cell:
    return d[1], -d[0]


def _left(d: Cell) -> Cell:
    return -d[1], d[0]


def _arc(centre: XY, start: XY, end: XY, steps: int = 6) -> list[XY]:
    """Return points on the quarter circle from `start` to `end`, without `start`.

    The radii from `centre` to `start` and to `end` must be perpendicular and of equal length.
    """
    ax, ay = start[0] - centre[0], start[1] - centre[1]
    bx, by = end[0] - centre[0], end[1] - centre[1]
    points = []
    for k in range(1, steps + 1):
        s, c = exact.sin_cos_deg(90.0 * k / steps)
        points.append((centre[0] + c * ax + s * bx, centre[1] + c * ay + s * by))
    return points


def until(start: XY, points: list[XY], length: float) -> tuple[Point, ...]:
    """Return the points of a way up to the first one that is `length` metres or more from `start` along it.

    A longer way therefore begins with the points of a shorter one.
    """
    route: list[Point] = []
    at, left = start, length
    for point in points:
        dx, dy = point[0] - at[0], point[1] - at[1]
        step = math.sqrt(dx * dx + dy * dy)
        if step < 1e-6:
            continue
        route.append(Point(x=point[0], y=point[1]))
        at, left = point, left - step
        if left <= 0.0:
            break
    return tuple(route)


class _Way:
    """A polyline under construction, and its length in metres."""

    def __init__(self, start: Pose) -> None:
        self.points: list[XY] = []
        self.length = 0.0
        self._at = (start.x, start.y)

    def extend(self, points: list[XY]) -> None:
        """Append points."""
        for point in points:
            dx, dy = point[0] - self._at[0], point[1] - self._at[1]
            self.length += math.sqrt(dx * dx + dy * dy)
            self._at = point
        self.points += points


@dataclass(frozen=True)
class StreetGrid:
    """A grid of streets; all values in metres."""

    xs: tuple[float, ...]  # x of the streets along y, ascending
    ys: tuple[float, ...]  # y of the streets along x, ascending
    bays_x: tuple[float, ...]  # width of the parking bays along the streets at `xs`; 0 if there are none
    bays_y: tuple[float, ...]  # the same for the streets at `ys`
    edge: float  # distance from the outermost streets' centre lines to the outer edge of the blocks beyond them

    @property
    def bounds(self) -> tuple[Span, Span]:
        """The ranges of x and of y that the town covers."""
        return (
            (self.xs[0] - self.edge, self.xs[-1] + self.edge),
            (self.ys[0] - self.edge, self.ys[-1] + self.edge),
        )

    def kerb_x(self, i: int) -> float:
        """Distance from the centre line of a street along y to its kerbs."""
        return LANE + self.bays_x[i]

    def kerb_y(self, j: int) -> float:
        """Distance from the centre line of a street along x to its kerbs."""
        return LANE + self.bays_y[j]

    def reach(self, junction: Cell) -> XY:
        """Half the extents of a junction along x and y, up to the ends of its rounded corners."""
        return self.kerb_x(junction[0]) + CORNER, self.kerb_y(junction[1]) + CORNER

    def ground(self, x: float, y: float) -> float:
        """Height of the ground at a point: `KERB` on blocks, 0 on streets and outside the town."""
        (x0, x1), (y0, y1) = self.bounds
        if not (x0 < x < x1 and y0 < y < y1):
            return 0.0
        in_x = min(abs(x - s) - self.kerb_x(i) for i, s in enumerate(self.xs))
        in_y = min(abs(y - s) - self.kerb_y(j) for j, s in enumerate(self.ys))
        if in_x <= 0.0 or in_y <= 0.0:
            return 0.0
        ax, ay = CORNER - in_x, CORNER - in_y
        if ax > 0.0 and ay > 0.0 and ax * ax + ay * ay > CORNER * CORNER:
            return 0.0
        return KERB

    def exists(self, junction: Cell) -> bool:
        """Whether the grid has a junction with these indices."""
        return 0 <= junction[0] < len(self.xs) and 0 <= junction[1] < len(self.ys)

    def centre(self, junction: Cell) -> XY:
        """The centre of a junction."""
        return self.xs[junction[0]], self.ys[junction[1]]

    def lane_yaw(self, x: float, y: float) -> float:
        """Direction of the traffic on the side of the nearest street where a point is, degrees."""
        i, j = self._nearest(x, y)
        if abs(x - self.xs[i]) <= abs(y - self.ys[j]):
            return 90.0 if x >= self.xs[i] else 270.0
        return 0.0 if y <= self.ys[j] else 180.0

    def drive(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Generate a route along the lanes; straight on, right or left are drawn at each junction."""
        d, junction = self._lane_ahead(start)
        way = _Way(start)
        while self.exists(junction) and len(way.points) < 10_000:
            turns = [t for t in (d, _right(d), _left(d)) if self.exists((junction[0] + t[0], junction[1] + t[1]))]
            new = stream.choice(turns) if turns else d
            way.extend(self._through(junction, d, new))
            d, junction = new, (junction[0] + new[0], junction[1] + new[1])
            if not turns or way.length >= length_m:
                break
        return until((start.x, start.y), way.points, length_m)

    def walk(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Generate a route along the sidewalks; at each corner, a crossing or a sidewalk is drawn."""
        d, junction = self._lane_ahead(start)
        offset = stream.uniform(-0.9, 0.9)
        cx, cy = self.centre(junction)
        corner = (-d[0] or (1 if start.x > cx else -1), -d[1] or (1 if start.y > cy else -1))
        way = _Way(start)
        way.extend([self._corner(junction, corner, offset)])
        while way.length < length_m and len(way.points) < 1_000:
            steps = self._steps(junction, corner)
            back = (-d[0], -d[1])
            d = stream.choice([s for s in steps if s != back] or steps)
            if (corner[0] * d[0] + corner[1] * d[1]) < 0:  # towards the street: cross it
                corner = (corner[0] + 2 * d[0], corner[1] + 2 * d[1])
            else:
                junction = (junction[0] + d[0], junction[1] + d[1])
                corner = (corner[0] - 2 * d[0], corner[1] - 2 * d[1])
            way.extend([self._corner(junction, corner, offset)])
        return until((start.x, start.y), way.points, length_m)

    def entry(self, start: Pose) -> Pose | None:
        """None: vehicles do not leave a street grid."""
        return None

    def _nearest(self, x: float, y: float) -> Cell:
        """Return the indices of the nearest street along y and of the nearest street along x."""
        i = min(range(len(self.xs)), key=lambda k: abs(x - self.xs[k]))
        return i, min(range(len(self.ys)), key=lambda k: abs(y - self.ys[k]))

    def _lane_ahead(self, start: Pose) -> tuple[Cell, Cell]:
        """Return the direction of travel along the nearest street, and the next junction ahead."""
        i, j = self._nearest(start.x, start.y)
        along_y = abs(start.x - self.xs[i]) <= abs(start.y - self.ys[j])
        d = _direction(start.yaw)
        if along_y:
            d = (0, d[1] or (1 if exact.sin_deg(start.yaw) >= 0 else -1))
            ahead = [k for k in range(len(self.ys)) if (self.ys[k] - start.y) * d[1] > self.kerb_y(k) + CORNER]
            return (d, (i, ahead[0] if d[1] > 0 else ahead[-1])) if ahead else ((0, -d[1]), (i, j))
        d = (d[0] or (1 if exact.cos_deg(start.yaw) >= 0 else -1), 0)
        ahead = [k for k in range(len(self.xs)) if (self.xs[k] - start.x) * d[0] > self.kerb_x(k) + CORNER]
        return (d, (ahead[0] if d[0] > 0 else ahead[-1], j)) if ahead else ((-d[0], 0), (i, j))

    def _through(self, junction: Cell, d: Cell, new: Cell) -> list[XY]:
        """Return the waypoints of a vehicle through a junction, from direction `d` to direction `new`."""
        (cx, cy), (tx, ty) = self.centre(junction), self.reach(junction)

        def lane(heading: Cell, sign: int) -> XY:
            r, along = _right(heading), sign * (tx if heading[0] else ty)
            return cx + along * heading[0] + 0.5 * LANE * r[0], cy + along * heading[1] + 0.5 * LANE * r[1]

        first, last = lane(d, -1), lane(new, 1)
        if new == d:
            return [first, last]
        pivot = (cx + tx * (new[0] - d[0]), cy + ty * (new[1] - d[1]))
        return [first, *_arc(pivot, first, last)]

    def _corner(self, junction: Cell, corner: Cell, offset: float) -> XY:
        cx, cy = self.centre(junction)
        x, y = self.kerb_x(junction[0]) + SIDE + offset, self.kerb_y(junction[1]) + SIDE + offset
        return fixed(cx + corner[0] * x), fixed(cy + corner[1] * y)

    def _steps(self, junction: Cell, corner: Cell) -> list[Cell]:
        """Return the directions in which a pedestrian can leave a corner: across a street, or along a sidewalk."""
        crossings = [(-corner[0], 0), (0, -corner[1])]
        along = [(corner[0], 0), (0, corner[1])]
        return crossings + [a for a in along if self.exists((junction[0] + a[0], junction[1] + a[1]))]
