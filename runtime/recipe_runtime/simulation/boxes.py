"""Footprints of upright boxes, the colliders of obstacles, and groups of nearby ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from recipe_runtime.body.kinematics import Quaternion


@dataclass(frozen=True, slots=True)
class Box:
    """The footprint of an obstacle."""

    name: str
    place: tuple[float, float]  # of its middle, metres in the world frame
    rotation: Quaternion  # about the vertical
    half: tuple[float, float]  # of its extent along its own x and y, metres

    def distance(self, x: float, y: float) -> float:
        """Return the distance of a position, metres; 0 inside."""
        _, _, s, c = self.rotation
        cosine, sine = 1.0 - 2.0 * s * s, 2.0 * s * c
        dx, dy = x - self.place[0], y - self.place[1]
        ahead = max(0.0, abs(cosine * dx + sine * dy) - self.half[0])
        aside = max(0.0, abs(cosine * dy - sine * dx) - self.half[1])
        return math.sqrt(ahead * ahead + aside * aside)


def neighbourhoods(boxes: Sequence[Box], most: int) -> Iterator[Sequence[Box]]:
    """Yield all boxes in groups of at most `most` that are near each other.

    By sort-tile-recursive packing (S. Leutenegger et al., STR: a simple and efficient algorithm for R-tree packing,
    1997): strips along y with about as many groups as there are strips, and groups along each strip.
    """
    groups = -(-len(boxes) // most)
    strips = math.isqrt(max(0, groups - 1)) + 1
    size = -(-groups // strips) * most
    by_x = sorted(boxes, key=lambda box: (*box.place, box.name))
    for start in range(0, len(boxes), max(1, size)):
        strip = sorted(by_x[start : start + size], key=lambda box: (box.place[1], box.place[0], box.name))
        for first in range(0, len(strip), most):
            yield strip[first : first + most]
