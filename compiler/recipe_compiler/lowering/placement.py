"""Where actors start and which instance number each has, so that adding one moves no other.

Starts are drawn by name. Actors whose recipe says where they start stand there; traffic and then the actors without a
start take the first spot of their own random order that is free. So one that is added can only ever push away one
that would have stood on the very same spot.

Instance numbers are the recipe's, not the variant's: an actor has the same one in every variant. They are unique
across all categories, from blocks of their own, so that traffic and deltas shift nobody.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns.town import Category

BASE_NUMBERS = (1, 299)  # actors of the base, in file order
DELTA_NUMBERS = (300, 399)  # actors that only deltas have, by a hash of the name
PARKED_NUMBERS = 400  # traffic.parked.0 and on, 100 of them
PEDESTRIAN_NUMBERS = 500  # traffic.pedestrian.0 and on, 250 of them
VEHICLE_NUMBERS = 750
_CLEARANCE: dict[Category, float] = {"pedestrian": 0.6, "vehicle": 4.0}  # metres around a body
_CELL = 2 * max(_CLEARANCE.values())
_TRIES = 64
_PLACE = (5.0, 2.3)  # metres along and across a parking place within which a body is in it


def instance_numbers(base: Sequence[str], deltas: Sequence[str]) -> dict[str, int]:
    """Instance numbers of the base's actors and of those that only deltas name; ValueError if there are too many."""
    first, last = BASE_NUMBERS
    if len(base) > last - first + 1:
        raise ValueError(
            f"{len(base)} actors are more than the most allowed, {last - first + 1}; use `traffic` for crowds"
        )
    numbers = {name: first + index for index, name in enumerate(base)}
    low, high = DELTA_NUMBERS
    if len(deltas) > high - low + 1:
        most = f"{high - low + 1}; use `traffic` for crowds"
        raise ValueError(f"{len(deltas)} actors that only deltas have are more than the most allowed, {most}")
    taken: set[int] = set()
    for name in deltas:
        number = Stream(0, "instance", name).integer(low, high)
        while number in taken:
            number = number + 1 if number < high else low
        taken.add(number)
        numbers[name] = number
    return numbers


def _cell(x: float, y: float) -> tuple[int, int]:
    """The square of a grid in which a point lies: two bodies that touch are in the same or in neighbouring ones."""
    return math.floor(x / _CELL), math.floor(y / _CELL)


@dataclass
class Spots:
    """The spawn points of a town, and who stands where."""

    points: Mapping[Category, Sequence[Pose]]
    _standing: dict[tuple[int, int], list[tuple[float, float, float]]] = field(default_factory=dict)

    def occupy(self, category: Category, x: float, y: float) -> None:
        """Note that a body stands here."""
        self._standing.setdefault(_cell(x, y), []).append((x, y, _CLEARANCE[category]))

    def free(self, category: Category, x: float, y: float) -> bool:
        """Whether a body of this category fits here."""
        own, (i, j) = _CLEARANCE[category], _cell(x, y)
        near = (body for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1) for body in self._standing.get((a, b), ()))
        return all((x - a) * (x - a) + (y - b) * (y - b) >= (own + r) * (own + r) for a, b, r in near)

    def take(self, category: Category, stream: Stream) -> Pose | None:
        """The first free spawn point in the stream's order, now taken; None if the town has no free one left."""
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
    """A town's places for parked cars, and which are taken.

    They are apart from the lanes, so that cars that stand and cars that drive never take one another's place; only
    bodies that the recipe itself puts into a place keep it free.
    """

    places: Sequence[Pose]
    _taken: set[int] = field(default_factory=set)

    def occupy(self, x: float, y: float) -> None:
        """Note that a body stands here."""
        for index, place in enumerate(self.places):
            s, c = exact.sin_cos_deg(place.yaw)
            dx, dy = x - place.x, y - place.y
            if abs(c * dx + s * dy) < _PLACE[0] and abs(c * dy - s * dx) < _PLACE[1]:
                self._taken.add(index)

    def take(self, stream: Stream) -> Pose | None:
        """The first free place in the stream's order, now taken; None if none is left."""
        for attempt in range(_TRIES + len(self.places)):
            if not self.places:
                break
            first = stream.integer(0, len(self.places) - 1) if attempt < _TRIES else attempt - _TRIES
            if first not in self._taken:
                self._taken.add(first)
                return self.places[first]
        return None
