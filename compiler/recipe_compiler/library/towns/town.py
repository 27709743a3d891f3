"""What a town is: its plan, its colours, where actors may appear, and the ways they may go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

from recipe_compiler.ir.plan import Point, Pose, TownPlan
from recipe_compiler.ir.streams import Stream

Category = Literal["vehicle", "pedestrian"]
Span = tuple[float, float]


@dataclass(frozen=True)
class Parameter:
    """A whole number between `low` and `high`, or, where `length` is given, a list of so many."""

    low: int
    high: int
    default: int | tuple[int, ...]
    description: str
    length: int | None = None
    rising: bool = False  # none is below the one before it

    @property
    def wanted(self) -> str:
        """What a value must be, in words."""
        if self.length is None:
            return f"a whole number from {self.low} to {self.high}"
        order = ", none below the one before it" if self.rising else ""
        return f"a list of {self.length} whole numbers from {self.low} to {self.high}{order}"

    def check(self, name: str, value: object) -> None:
        """ValueError unless `value` is allowed."""
        values = [value] if self.length is None else value
        whole = [v for v in values if type(v) is int] if isinstance(values, list | tuple) else []
        valid = isinstance(values, list | tuple) and len(whole) == len(values) == (self.length or 1)
        if not valid or not all(self.low <= v <= self.high for v in whole) or (self.rising and whole != sorted(whole)):
            raise ValueError(f"{name} is {value!r}; it must be {self.wanted}")


@dataclass(frozen=True)
class SpawnPoint:
    """A place where an actor may appear: on the ground, facing the way it would go."""

    category: Category
    pose: Pose


class Ways(Protocol):
    """A town's ground, and the ways over it."""

    @property
    def bounds(self) -> tuple[Span, Span]:
        """What the town spans along x and along y."""

    def ground(self, x: float, y: float) -> float:
        """Height of the ground in metres."""

    def drive(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """A way along the lanes."""

    def walk(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """A way for somebody on foot."""

    def entry(self, start: Pose) -> Pose | None:
        """Where a vehicle that starts here enters again after it has left; None on roads that nobody leaves."""


@dataclass(frozen=True)
class Town:
    """A town as numbers, and the questions that placing actors asks of it.

    Its traffic drives `pace` times as fast as its vehicles do of their own accord; bicycles are `barred` from a
    motorway. `parking` holds the places where cars stand, each with the yaw of a car in it.
    """

    plan: TownPlan
    looks: dict[str, dict[str, str]]  # element -> slot -> "#rrggbb"
    spawn_points: tuple[SpawnPoint, ...]
    streets: Ways
    parking: tuple[Pose, ...] = ()
    pace: float = 1.0
    barred: tuple[str, ...] = ()  # blueprints whose ids begin so

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
