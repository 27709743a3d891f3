"""Making way: a pedestrian who stands, or is blocked, steps aside for those who walk towards it.

In a dense crowd, avoidance alone ends in arches of people who block each other, or behind people who stand at their
goals. Real people step aside, out of the other's path.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from recipe_runtime.simulation.agent import Agent

if TYPE_CHECKING:
    from recipe_runtime.simulation.pedestrian import PedestrianAgent

SPEED = 0.4  # m/s, of a step aside
_NEAR = 0.7  # metres between two bodies within which one makes way
_CLEAR = 0.15  # metres beside the path of the other that are kept clear
_SAME_WAY = 0.3  # cosine between two directions from which one queues behind the other, and does not make way

Vector2 = tuple[float, float]


def steps(own: PedestrianAgent, aim: Vector2 | None, others: Sequence[Agent]) -> Sequence[Vector2]:
    """Return the directions in which to step aside, the best one first; none if nobody walks towards the pedestrian.

    The first is at right angles to the paths of the others, so that two who meet head-on step to opposite sides. If
    there is no room, one walks ahead of the others, or to the other side.

    Args:
        own: The pedestrian.
        aim: The direction in which it wants to go itself; None if it stands.
        others: Agents in sight.

    Returns:
        Unit vectors.
    """
    sx = sy = px = py = 0.0  # aside and ahead
    for other in others:
        theirs: Vector2 | None = getattr(other, "aim", None)
        if theirs is None or other is own.follower:
            continue
        dx, dy = own.x - other.x, own.y - other.y
        bodies = own.radius + other.radius
        reach = bodies + _NEAR
        if dx > reach or dx < -reach or dy > reach or dy < -reach:
            continue
        ux, uy = theirs
        ahead, across = dx * ux + dy * uy, ux * dy - uy * dx
        if ahead <= 0.0 or ahead > reach or abs(across) > bodies + _CLEAR:
            continue
        if aim is not None and ux * aim[0] + uy * aim[1] > _SAME_WAY:
            continue
        side = 1.0 if across > 0.0 else -1.0
        sx, sy = sx - side * uy / ahead, sy + side * ux / ahead
        px, py = px + ux / ahead, py + uy / ahead
    wanted = ((sx, sy), (sx + px, sy + py), (px, py), (-sx, -sy))
    return [(x / size, y / size) for x, y in wanted if (size := math.sqrt(x * x + y * y)) > 1e-6]
