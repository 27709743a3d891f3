"""What a town is: its plan, its colours, where actors may appear, and the ways they may go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from recipe_compiler.plan import Point, Pose, TownPlan
from recipe_compiler.streams import Stream
from recipe_compiler.towns.streets import StreetGrid

Category = Literal["vehicle", "pedestrian"]


@dataclass(frozen=True)
class Parameter:
    """A list of `length` whole numbers, each between `low` and `high`."""

    low: int
    high: int
    length: int
    default: tuple[int, ...]
    description: str

    def check(self, name: str, value: Any) -> None:
        """ValueError unless `value` is allowed."""
        whole = isinstance(value, list | tuple) and all(type(v) is int for v in value)
        if not whole or len(value) != self.length or not all(self.low <= v <= self.high for v in value):
            limits = f"{self.length} whole numbers from {self.low} to {self.high}"
            raise ValueError(f"{name} is {value!r}; it must be {limits}")


@dataclass(frozen=True)
class SpawnPoint:
    """A place where an actor may appear: on the ground, facing the way it would go."""

    category: Category
    pose: Pose


@dataclass(frozen=True)
class Town:
    """A town as numbers, and the questions that placing actors asks of it."""

    plan: TownPlan
    looks: dict[str, dict[str, str]]  # element -> slot -> "#rrggbb"
    spawn_points: tuple[SpawnPoint, ...]
    streets: StreetGrid

    @cached_property
    def spots(self) -> dict[Category, tuple[Pose, ...]]:
        """Where each category may appear, in the order of the spawn points."""
        categories: tuple[Category, ...] = ("vehicle", "pedestrian")
        return {c: tuple(point.pose for point in self.spawn_points if point.category == c) for c in categories}

    def route(self, category: Category, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Waypoints of a way of about `length_m` metres from `start`, turns drawn from `stream`.

        Vehicles keep to the right-hand lanes; pedestrians to sidewalks, over crossings.
        """
        if category == "vehicle":
            return self.streets.drive(start, length_m, stream)
        return self.streets.walk(start, length_m, stream)

    def ground(self, x: float, y: float) -> float:
        """Height of the ground in metres: 0 on the road, the kerb's height on a sidewalk."""
        return self.streets.ground(x, y)
