"""The result of generating a town: its plan, colours, spawn points, parking places and routes.

Lengths are in metres and yaws in degrees, in the world frame: x east, y north, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from recipe_compiler.ir.ground.obstacles import ObstacleMap
from recipe_compiler.ir.plan import Point, Pose, TownPlan
from recipe_compiler.ir.semantic_tags import CATEGORIES, Category
from recipe_compiler.ir.streams import Stream

Span = tuple[float, float]


@dataclass(frozen=True)
class TownParameter:
    """An integer parameter of a town, or a list of integers if `length` is given."""

    low: int
    high: int
    default: int | tuple[int, ...]
    description: str  # shown in error messages and in the JSON Schema
    length: int | None = None  # number of items of a list; None for a single number
    rising: bool = False  # whether the items of a list must not decrease

    @property
    def wanted(self) -> str:
        """A description of the valid values, for error messages."""
        if self.length is None:
            return f"a whole number from {self.low} to {self.high}"
        order = ", in ascending order" if self.rising else ""
        return f"a list of {self.length} whole numbers from {self.low} to {self.high}{order}"

    def check(self, name: str, value: object) -> None:
        """Check a value.

        Raises:
            ValueError: the value has another type or length, or is out of range.
        """
        values = [value] if self.length is None else value
        whole = [v for v in values if type(v) is int] if isinstance(values, list | tuple) else []
        valid = isinstance(values, list | tuple) and len(whole) == len(values) == (self.length or 1)
        if not valid or not all(self.low <= v <= self.high for v in whole) or (self.rising and whole != sorted(whole)):
            raise ValueError(f"{name} is {value!r}; it must be {self.wanted}")


@dataclass(frozen=True)
class SpawnPoint:
    """A place where an actor may start, on the ground, facing its direction of travel."""

    category: Category
    pose: Pose


class Ways(Protocol):
    """The height of a town's ground and the routes through the town."""

    @property
    def bounds(self) -> tuple[Span, Span]:
        """The ranges of x and of y that the town covers."""

    def ground(self, x: float, y: float) -> float:
        """Height of the ground at a point."""

    def lane_yaw(self, x: float, y: float) -> float:
        """Direction of the traffic on the side of the street where a point is, degrees."""

    def drive(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Generate a vehicle's route along the lanes."""

    def walk(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Generate a pedestrian's route."""

    def entry(self, start: Pose) -> Pose | None:
        """Where a vehicle that starts here enters again after it has left; None on roads without through traffic."""


@dataclass(frozen=True)
class Town:
    """A generated town."""

    plan: TownPlan
    looks: dict[str, dict[str, str]]  # element -> slot -> "#rrggbb"
    spawn_points: tuple[SpawnPoint, ...]
    streets: Ways
    parking: tuple[Pose, ...] = ()  # parking places, each with the yaw of a car parked there
    barred: tuple[str, ...] = ()  # prefixes of blueprint ids that traffic must not use here

    @cached_property
    def limit(self) -> float:
        """The highest speed limit of its roads, m/s."""
        return max(element.shape["limit"] for element in self.plan.elements if "limit" in element.shape) / 3.6

    @cached_property
    def spots(self) -> dict[Category, tuple[Pose, ...]]:
        """The spawn points of each category, in plan order."""
        return {c: tuple(point.pose for point in self.spawn_points if point.category == c) for c in CATEGORIES}

    def route(self, category: Category, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Generate a random route: vehicles on right-hand lanes, pedestrians on sidewalks and crossings.

        Args:
            category: the category of the actor.
            start: where it starts; the yaw decides the direction.
            length_m: the longest length, metres.
            stream: the random stream for the turns.

        Returns:
            Waypoints in the world frame, without the start.
        """
        if category == "vehicle":
            return self.streets.drive(start, length_m, stream)
        return self.streets.walk(start, length_m, stream)

    def ground(self, x: float, y: float) -> float:
        """Height of the ground at a point: 0 on the road, the height of the kerb on a sidewalk."""
        return self.streets.ground(x, y)

    @cached_property
    def obstacles(self) -> ObstacleMap:
        """Obstacles for pedestrians."""
        return ObstacleMap.of(self.plan)

    @cached_property
    def lane_metres(self) -> float:
        """Length of all lanes together."""
        roads = sum(2.0 * e.size[0] for e in self.plan.elements if e.kind == "road")
        return roads + sum(e.shape["lanes"] * e.size[0] for e in self.plan.elements if e.kind == "carriageway")

    @cached_property
    def sidewalk_metres(self) -> float:
        """Length of all sidewalks and footpaths together, both sides of a street counted."""
        roads = sum(2.0 * e.size[0] for e in self.plan.elements if e.kind == "road")
        return roads + sum(e.size[0] for e in self.plan.elements if e.kind == "path" and not e.shape["drive"])
