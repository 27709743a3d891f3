"""Start positions and instance numbers of actors, chosen so that adding an actor moves no other.

Starts are drawn from streams keyed by the actor's name. Actors with a start in the recipe are placed first. Traffic,
then the named actors without a start, take the first free spawn point in their own random order. An added actor
therefore displaces another one only if both would take the same spawn point.

Instance numbers are assigned per recipe, so an actor has the same number in every variant. Named actors, traffic and
parked cars have separate ranges of numbers, so that none depends on how many of the others there are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose
from recipe_compiler.ir.semantic_tags import Category
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.blueprints import Blueprint

BASE_NUMBERS = (1, 299)  # actors of the base, in file order
DELTA_NUMBERS = (300, 399)  # actors that occur only in deltas, by a hash of the name
PARKED_NUMBERS = 400  # first of 100 numbers for traffic.parked.*
PEDESTRIAN_NUMBERS = 500  # first of 250 numbers for traffic.pedestrian.*
VEHICLE_NUMBERS = 750  # first of the numbers for traffic.vehicle.*
_ALONG = 1.5  # metres kept free in front of and behind a vehicle
_ASIDE = 0.25  # metres kept free at its sides
_PERSON = 0.6  # metres around a pedestrian
_CELL = 14.0  # metres, more than two bodies that touch can be apart
_TRIES = 64
CANDIDATES = 24  # free spawn points that are compared where a score is given
_PLACE = (5.0, 2.3)  # a body occupies a parking place within this distance of its middle, along and across; metres


def instance_numbers(base: Sequence[str], deltas: Sequence[str]) -> dict[str, int]:
    """Assign instance numbers to the named actors of a recipe.

    Args:
        base: names of the base's actors, in file order.
        deltas: names of the actors that occur only in deltas.

    Raises:
        ValueError: there are more actors than numbers.
    """
    first, last = BASE_NUMBERS
    if len(base) > last - first + 1:
        raise ValueError(f"the limit of {last - first + 1} actors is exceeded, {len(base)}; use `traffic` for crowds")
    numbers = {name: first + index for index, name in enumerate(base)}
    low, high = DELTA_NUMBERS
    if len(deltas) > high - low + 1:
        most = f"{high - low + 1}; use `traffic` for crowds"
        raise ValueError(f"the limit of actors that occur only in deltas is exceeded, {len(deltas)}: it is {most}")
    taken: set[int] = set()
    for name in deltas:
        number = Stream(0, "instance", name).integer(low, high)
        while number in taken:
            number = number + 1 if number < high else low
        taken.add(number)
        numbers[name] = number
    return numbers


def _cell(x: float, y: float) -> tuple[int, int]:
    """Return the grid cell of a point. Two bodies that touch are in the same cell or in neighbouring cells."""
    return math.floor(x / _CELL), math.floor(y / _CELL)


@dataclass(frozen=True)
class Footprint:
    """The rectangle that an actor keeps free at its start, in the world frame, metres."""

    x: float
    y: float
    ahead: tuple[float, float]  # unit vector
    half_length: float
    half_width: float

    @classmethod
    def of(cls, blueprint: Blueprint, x: float, y: float, yaw: float) -> Footprint:
        """Return the footprint of a blueprint that faces `yaw`, in degrees."""
        if blueprint.category == "pedestrian":
            return cls(x, y, (1.0, 0.0), _PERSON, _PERSON)
        sine, cosine = exact.sin_cos_deg(yaw)
        length, width = blueprint.shape["length"], blueprint.shape["width"]
        return cls(x, y, (cosine, sine), length / 2 + _ALONG, width / 2 + _ASIDE)

    def overlaps(self, other: Footprint) -> bool:
        """Return whether two footprints overlap: no side of either separates them."""
        dx, dy = other.x - self.x, other.y - self.y
        for body in (self, other):
            for ux, uy in (body.ahead, (-body.ahead[1], body.ahead[0])):
                if abs(dx * ux + dy * uy) >= self._extent(ux, uy) + other._extent(ux, uy):
                    return False
        return True

    def _extent(self, ux: float, uy: float) -> float:
        along = abs(self.ahead[0] * ux + self.ahead[1] * uy)
        aside = abs(self.ahead[0] * uy - self.ahead[1] * ux)
        return along * self.half_length + aside * self.half_width


@dataclass
class Spots:
    """The spawn points of a town, and the actors that start at some of them."""

    points: Mapping[Category, Sequence[Pose]]
    _standing: dict[tuple[int, int], list[Footprint]] = field(default_factory=dict)

    def occupy(self, body: Footprint) -> None:
        """Record that a body is here."""
        self._standing.setdefault(_cell(body.x, body.y), []).append(body)

    def free(self, body: Footprint, beside: Footprint | None = None) -> bool:
        """Return whether a body fits here; it may touch the companion next to which it starts."""
        i, j = _cell(body.x, body.y)
        near = (other for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1) for other in self._standing.get((a, b), ()))
        return not any(body.overlaps(other) for other in near if other != beside)

    def take(self, blueprint: Blueprint, stream: Stream, score: Callable[[Pose], float] | None = None) -> Pose | None:
        """Take a free spawn point: the first in the stream's order, or the best of several.

        Args:
            blueprint: What is to stand there.
            stream: Draws the order.
            score: Rates a spawn point; the best of the first free ones is taken. None: the first one is.

        Returns:
            The spawn point; None if the town has no free one left.
        """
        found = []
        for pose in self._in_order(blueprint.category, stream):
            if self.free(Footprint.of(blueprint, pose.x, pose.y, pose.yaw)):
                found.append(pose)
                if score is None or len(found) == CANDIDATES:
                    break
        if not found:
            return None
        chosen = found[0] if score is None else max(found, key=score)
        self.occupy(Footprint.of(blueprint, chosen.x, chosen.y, chosen.yaw))
        return chosen

    def _in_order(self, category: Category, stream: Stream) -> Iterator[Pose]:
        """Yield spawn points as drawn, and then those after the last one drawn."""
        options = self.points[category]
        if not options:
            return
        drawn: set[int] = set()
        index = 0
        for _ in range(_TRIES):
            index = stream.integer(0, len(options) - 1)
            if index not in drawn:
                drawn.add(index)
                yield options[index]
        for step in range(1, len(options)):
            if (index + step) % len(options) not in drawn:
                yield options[(index + step) % len(options)]


@dataclass
class Parking:
    """The parking places of a town, and which are occupied.

    Parking places are apart from the lanes, so traffic never occupies one; only what the recipe itself places does.
    """

    places: Sequence[Pose]
    _taken: set[int] = field(default_factory=set)

    def occupy(self, x: float, y: float) -> None:
        """Mark the parking places that a body at this position occupies."""
        for index, place in enumerate(self.places):
            dx, dy = x - place.x, y - place.y
            if max(abs(dx), abs(dy)) > _PLACE[0] + _PLACE[1]:
                continue
            s, c = exact.sin_cos_deg(place.yaw)
            if abs(c * dx + s * dy) < _PLACE[0] and abs(c * dy - s * dx) < _PLACE[1]:
                self._taken.add(index)

    def take(self, stream: Stream) -> Pose | None:
        """Draw a free parking place, more often one of the first, and occupy it; None if all are occupied."""
        for attempt in range(_TRIES + len(self.places)):
            if not self.places:
                break
            draw = stream.unit()
            first = int(len(self.places) * draw * draw * draw) if attempt < _TRIES else attempt - _TRIES
            if first not in self._taken:
                self._taken.add(first)
                return self.places[first]
        return None
