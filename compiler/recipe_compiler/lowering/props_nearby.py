"""Estimates how often simulated agents look at props: many props in one place make a simulation slow."""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Sequence

Disc = tuple[float, float, float]  # x and y of a prop's origin, and the radius that it reaches, metres

_WALK = (2.0, 110.0)  # metres within which a pedestrian looks at props, and how often it does, times a second
_DRIVE = (100.0, 13.0)  # the same of a vehicle
_FEW = 8  # props in one place that the time of an agent includes
_LARGE = 8  # cells from its middle; a larger prop is near every place


def radius(low: Sequence[float], high: Sequence[float], *, upright: bool) -> float:
    """Return the radius, seen from above, that a box reaches about its origin.

    Args:
        low: minimum corner, metres.
        high: maximum corner, metres.
        upright: whether it is turned about the vertical only.
    """
    corner = [max(abs(a), abs(b)) for a, b in zip(low, high, strict=True)]
    return math.sqrt(sum(extent * extent for extent in corner[: 2 if upright else 3]))


def looks(props: Sequence[Disc], pedestrians: int, vehicles: int, seconds: float) -> float:
    """Return how often agents look at a prop in a simulation, at most, besides the few that any place may have.

    Args:
        props: the props.
        pedestrians: the number of moving pedestrians.
        vehicles: the number of moving vehicles.
        seconds: the duration.
    """
    if len(props) <= _FEW:
        return 0.0
    kinds = (pedestrians, _WALK), (vehicles, _DRIVE)
    return seconds * sum(n * rate * max(0, _most(tuple(props), reach) - _FEW) for n, (reach, rate) in kinds if n)


@functools.lru_cache(maxsize=16)
def _most(props: tuple[Disc, ...], reach: float) -> int:
    """Return the largest number of props that are within `reach` of a square cell with sides of that length."""
    everywhere, cells = 0, Counter[tuple[int, int]]()
    for x, y, size in props:
        extent = size + reach
        if extent > _LARGE * reach:
            everywhere += 1
            continue
        (west, east), (south, north) = (
            (math.floor((middle - extent) / reach), math.floor((middle + extent) / reach)) for middle in (x, y)
        )
        cells.update((i, j) for i in range(west, east + 1) for j in range(south, north + 1))
    return everywhere + max(cells.values(), default=0)
