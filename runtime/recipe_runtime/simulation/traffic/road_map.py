"""The road network as drivers see it: junctions with their stop lines, lights and signs, lanes and speed limits.

Everything is derived from the elements of the town that a picture shows. Directions of travel are numbered 0 to 3: +x,
+y, -x, -y; the arm of a junction has the number of the direction in which one enters by it.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element, TownPlan

from recipe_runtime.simulation.path import Path

Control = Literal["light", "stop", "yield", "priority", "none"]
DIRECTIONS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
_STOP_SIGN, _GIVE_WAY_SIGN = 0, 3  # faces of a sign
_CELL = 32.0  # metres of the grid in which roads are looked up
_SPAN = 2.2  # metres to both sides over which the curvature of a path is measured, for the speed
_BEFORE = 4  # metres before a corner of a path from which its speed is kept: the front axle turns earlier
_LINE = 3.0  # from a junction's edge to its stop line where no road shows one


@dataclass(slots=True)
class Arm:
    """The entry of a junction in one direction of travel."""

    line: float  # from the junction's middle to the stop line, metres
    control: Control = "none"
    signal: Mapping[str, float] | None = None  # parameters of its traffic light


@dataclass(slots=True)
class Junction:
    """A junction: the rectangle between its stop lines."""

    x: float
    y: float
    half: tuple[float, float]  # half its size along x and y, without the ways to its stop lines
    arms: tuple[Arm, Arm, Arm, Arm]

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Minimum x, minimum y, maximum x and maximum y between its stop lines."""
        east, north, west, south = (arm.line for arm in self.arms)  # who goes east enters from the west
        return self.x - east, self.y - north, self.x + west, self.y + south


@dataclass(frozen=True, slots=True)
class Lanes:
    """The lanes next to the one that a vehicle is in."""

    left: int
    right: int
    width: float  # metres


@dataclass(frozen=True, slots=True)
class _Road:
    """A rectangle of carriageway."""

    x: float
    y: float
    along: tuple[float, float]  # unit vector
    half_length: float
    half_width: float
    limit: float  # m/s
    lanes: int  # 0: a street with one lane in each direction
    lane: float
    shoulder: float

    def contains(self, x: float, y: float) -> bool:
        dx, dy = x - self.x, y - self.y
        u, v = dx * self.along[0] + dy * self.along[1], dy * self.along[0] - dx * self.along[1]
        return -self.half_length <= u <= self.half_length and -self.half_width <= v <= self.half_width


@dataclass(slots=True)
class RoadMap:
    """The road network of a town."""

    town: TownPlan
    junctions: list[Junction] = field(init=False)
    _cells: dict[tuple[int, int], list[_Road]] = field(init=False)

    def __post_init__(self) -> None:
        elements = self.town.elements
        self.junctions = [_junction(e) for e in elements if e.kind == "junction"]
        self._cells = {}
        for element in elements:
            if element.kind in ("road", "carriageway"):
                self._add_road(element)
            if element.kind == "road":
                self._place_stop_lines(element)
        for element in elements:
            self._place_control(element)
        for junction in self.junctions:
            if any(arm.control in ("stop", "yield") for arm in junction.arms):
                for arm in junction.arms:
                    arm.control = "priority" if arm.control == "none" else arm.control

    def limit(self, x: float, y: float) -> float | None:
        """Return the speed limit of the road at a position in m/s; None where there is no road."""
        road = self._road(x, y)
        return road.limit if road else None

    def paved(self, x: float, y: float) -> bool:
        """Return whether a position is on a carriageway or a junction."""
        if self._road(x, y) is not None:
            return True
        return any(abs(x - j.x) < j.half[0] and abs(y - j.y) < j.half[1] for j in self.junctions)

    def lanes(self, x: float, y: float) -> Lanes | None:
        """Return the lanes next to the one at a position; None on a street, and off the road."""
        road = self._road(x, y)
        if road is None or not road.lanes:
            return None
        dx, dy = x - road.x, y - road.y
        aside = dy * road.along[0] - dx * road.along[1]
        from_right = aside + road.half_width - road.shoulder
        number = min(max(math.floor(from_right / road.lane), 0), road.lanes - 1)  # 0 is the rightmost
        return Lanes(road.lanes - 1 - number, number, road.lane)

    def passages(self, path: Path) -> list[tuple[int, float, float]]:
        """Return the junctions that a path passes, in order: index, and arc lengths at the stop lines."""
        found: list[tuple[int, float, float]] = []
        last: dict[int, int] = {}  # junction -> the latest entry of `found`
        for ax, ay, tx, ty, start, length in path.legs:
            for n in range(len(self.junctions)):
                low_x, low_y, high_x, high_y = self.junctions[n].bounds
                span = _clip((ax, ay, tx, ty), length, (low_x, low_y, high_x, high_y))
                if span is None:
                    continue
                a, b = start + span[0], start + span[1]
                if n in last and a - found[last[n]][2] < 1e-3:
                    found[last[n]] = (n, found[last[n]][1], b)
                else:
                    last[n] = len(found)
                    found.append((n, a, b))
        return sorted(found, key=lambda passage: passage[1])

    def _road(self, x: float, y: float) -> _Road | None:
        for road in self._cells.get((math.floor(x / _CELL), math.floor(y / _CELL)), ()):
            if road.contains(x, y):
                return road
        return None

    def _add_road(self, e: Element) -> None:
        s, c = exact.sin_cos_deg(e.pose.yaw)
        shape, (length, width, _) = e.shape, e.size
        lanes = int(shape.get("lanes", 0))
        limit = shape["limit"] / 3.6
        lane, shoulder = shape.get("lane", 0.0), shape.get("shoulder", 0.0)
        road = _Road(e.pose.x, e.pose.y, (c, s), length / 2, width / 2, limit, lanes, lane, shoulder)
        half_x = abs(c) * length / 2 + abs(s) * width / 2
        half_y = abs(s) * length / 2 + abs(c) * width / 2
        for i in range(math.floor((road.x - half_x) / _CELL), math.floor((road.x + half_x) / _CELL) + 1):
            for j in range(math.floor((road.y - half_y) / _CELL), math.floor((road.y + half_y) / _CELL) + 1):
                self._cells.setdefault((i, j), []).append(road)

    def _place_stop_lines(self, e: Element) -> None:
        """Assign the stop lines of a road to the junctions at its ends."""
        s, c = exact.sin_cos_deg(e.pose.yaw)
        for stop, sign in ((e.shape["stop_a"], 1.0), (e.shape["stop_b"], -1.0)):
            if stop <= 0.0:
                continue
            along = -sign * (e.size[0] / 2 - stop)
            x, y, step = e.pose.x + c * along, e.pose.y + s * along, e.size[0] / 2
            travel = direction_of((-sign * c, -sign * s))
            junction = self._ahead(x, y, travel, step)
            if junction is not None:
                dx, dy = DIRECTIONS[travel]
                junction.arms[travel].line = (junction.x - x) * dx + (junction.y - y) * dy

    def _place_control(self, e: Element) -> None:
        """Assign a traffic light or a sign to the junction behind it, for the direction of travel that it faces."""
        if e.kind == "sign" and int(e.shape["face"]) not in (_STOP_SIGN, _GIVE_WAY_SIGN):
            return
        if e.kind not in ("sign", "traffic_light"):
            return
        s, c = exact.sin_cos_deg(e.pose.yaw)
        travel = direction_of((-c, -s))
        junction = self._ahead(e.pose.x, e.pose.y, travel, 30.0)
        if junction is None:
            return
        arm = junction.arms[travel]
        if e.kind == "traffic_light":
            arm.control, arm.signal = "light", e.shape
        elif arm.control == "none":
            arm.control = "stop" if int(e.shape["face"]) == _STOP_SIGN else "yield"

    def _ahead(self, x: float, y: float, travel: int, reach: float) -> Junction | None:
        """Return the nearest junction ahead of a position at the side of a road."""
        best, found = reach, None
        dx, dy = DIRECTIONS[travel]
        for junction in self.junctions:
            ahead = (junction.x - x) * dx + (junction.y - y) * dy
            aside = abs((junction.y - y) * dx - (junction.x - x) * dy)
            if 0.0 < ahead < best and aside < 9.0:
                best, found = ahead, junction
        return found


def direction_of(vector: tuple[float, float]) -> int:
    """Return the index of the direction of travel that is nearest to a vector."""
    if abs(vector[0]) >= abs(vector[1]):
        return 0 if vector[0] >= 0.0 else 2
    return 1 if vector[1] >= 0.0 else 3


def _junction(e: Element) -> Junction:
    half = (e.size[0] / 2, e.size[1] / 2)
    x, y = half[0] + _LINE, half[1] + _LINE
    return Junction(e.pose.x, e.pose.y, half, (Arm(x), Arm(y), Arm(x), Arm(y)))


def _clip(
    ray: tuple[float, float, float, float], length: float, box: tuple[float, float, float, float]
) -> tuple[float, float] | None:
    """Return the part of a leg inside a box (minimum x and y, maximum x and y); None if there is none."""
    low, high = 0.0, length
    for start, step, least, greatest in ((ray[0], ray[2], box[0], box[2]), (ray[1], ray[3], box[1], box[3])):
        if abs(step) < 1e-12:
            if not least <= start <= greatest:
                return None
            continue
        a, b = (least - start) / step, (greatest - start) / step
        low, high = max(low, min(a, b)), min(high, max(a, b))
    return (low, high) if low < high else None


def _numbers(value: float, count: int) -> array[float]:
    return array("d", (value,)) * count


def speed_profile(
    path: Path, road_map: RoadMap, *, lateral: float, braking: float, goal: bool, factor: float = 1.0
) -> Sequence[float]:
    """Return the maximum speed at each whole metre of a path, m/s, from which all later limits can be met.

    Args:
        path: The path.
        road_map: The roads, with their limits.
        lateral: The greatest lateral acceleration in bends, m/s2.
        braking: The braking before lower limits, m/s2.
        goal: Whether the path ends in a stop.
        factor: The driver's desired speed relative to the limit.
    """
    count = int(path.length) + 2
    speeds, limit, known = _numbers(60.0, count), 60.0, 0  # one for each metre, so no list
    for n in range(0, count, 2):
        at = road_map.limit(*path.at(float(n)))
        if at is not None:
            at *= factor
            if not known:
                speeds[:n] = _numbers(at, n)
            limit, known = at, 1
        speeds[n : n + 2] = _numbers(limit, min(2, count - n))
    for (_, _, ux, uy, _, _), (_, _, wx, wy, start, _) in zip(path.legs, path.legs[1:], strict=False):
        if abs(ux * wy - uy * wx) < 0.02 and ux * wx + uy * wy > 0.0:
            continue
        curvature = max(abs(path.curvature(start + metres, _SPAN)) for metres in (-1.0, 0.0, 1.0))
        if curvature > 0.01:
            fastest = max(1.2, math.sqrt(lateral / curvature))
            for n in range(max(0, int(start) - _BEFORE), min(count, int(start) + 3)):
                speeds[n] = min(speeds[n], fastest)
    if goal:
        speeds[-1] = 0.0
    for n in range(count - 2, -1, -1):
        later = speeds[n + 1]
        speeds[n] = min(speeds[n], math.sqrt(later * later + 2.0 * braking))
    return speeds
