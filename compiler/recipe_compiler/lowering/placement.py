"""Start positions and instance numbers of actors, chosen so that adding an actor moves no other.

Starts are drawn from streams keyed by the actor's name. Actors with a start in the recipe are placed first. Traffic,
then the named actors without a start, take the first free spawn point in their own random order. An added actor
therefore displaces another one only if both would take the same spawn point.

Instance numbers are assigned per recipe, so an actor has the same number in every variant. Named actors, traffic and
parked cars have separate ranges of numbers, so that none depends on how many of the others there are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from recipe_compiler.ir import exact
from recipe_compiler.ir.actor_kinds import Category
from recipe_compiler.ir.plan import Pose
from recipe_compiler.ir.streams import Stream

BASE_NUMBERS = (1, 299)  # actors of the base, in file order
DELTA_NUMBERS = (300, 399)  # actors that occur only in deltas, by a hash of the name
PARKED_NUMBERS = 400  # first of 100 numbers for traffic.parked.*
PEDESTRIAN_NUMBERS = 500  # first of 250 numbers for traffic.pedestrian.*
VEHICLE_NUMBERS = 750  # first of the numbers for traffic.vehicle.*
_CLEARANCE: dict[Category, float] = {"pedestrian": 0.6, "vehicle": 4.0}  # radius kept free around a body, metres
_CELL = 2 * max(_CLEARANCE.values())
_TRIES = 64
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


@dataclass
class Spots:
    """The spawn points of a town, and the bodies placed so far."""

    points: Mapping[Category, Sequence[Pose]]
    _standing: dict[tuple[int, int], list[tuple[float, float, float]]] = field(default_factory=dict)

    def occupy(self, category: Category, x: float, y: float) -> None:
        """Add a body at a position in the world frame, metres."""
        self._standing.setdefault(_cell(x, y), []).append((x, y, _CLEARANCE[category]))

    def free(self, category: Category, x: float, y: float) -> bool:
        """Whether a body of this category at a position keeps clear of all bodies placed so far."""
        own, (i, j) = _CLEARANCE[category], _cell(x, y)
        near = (body for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1) for body in self._standing.get((a, b), ()))
        return all((x - a) * (x - a) + (y - b) * (y - b) >= (own + r) * (own + r) for a, b, r in near)

    def take(self, category: Category, stream: Stream) -> Pose | None:
        """Occupy and return the first free spawn point in a random order; None if all are occupied."""
        options = self.points[category]
        if not options:
            return None
        index = 0
        for _ in range(_TRIES):
            index = stream.integer(0, len(options) - 1)
            if self._try(category, options[index]):
                return options[index]
        for step in range(1, len(options)):
            pose = options[(index + step) % len(options)]
            if self._try(category, pose):
                return pose
        return None

    def _try(self, category: Category, pose: Pose) -> bool:
        if not self.free(category, pose.x, pose.y):
            return False
        self.occupy(category, pose.x, pose.y)
        return True


@dataclass
class Parking:
    """The parking places of a town, and which are occupied.

    Parking places are apart from the lanes, so traffic never occupies one; only actors with a start in the recipe do.
    """

    places: Sequence[Pose]
    _taken: set[int] = field(default_factory=set)

    def occupy(self, x: float, y: float) -> None:
        """Mark the parking places that a body at this position occupies."""
        for index, place in enumerate(self.places):
            s, c = exact.sin_cos_deg(place.yaw)
            dx, dy = x - place.x, y - place.y
            if abs(c * dx + s * dy) < _PLACE[0] and abs(c * dy - s * dx) < _PLACE[1]:
                self._taken.add(index)

    def take(self, stream: Stream) -> Pose | None:
        """Occupy and return the first free parking place in a random order; None if all are occupied."""
        for attempt in range(_TRIES + len(self.places)):
            if not self.places:
                break
            first = stream.integer(0, len(self.places) - 1) if attempt < _TRIES else attempt - _TRIES
            if first not in self._taken:
                self._taken.add(first)
                return self.places[first]
        return None
