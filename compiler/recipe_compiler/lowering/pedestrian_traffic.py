"""Random choices for pedestrians in traffic: running, pauses and companions."""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Pause, Point, Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.blueprints import Blueprint

RUNNERS = 1 / 12  # share of adults
PAUSING = 0.25  # share of walkers
PAIRED = 0.2  # share of those after a walker without companion
_RUNNING = (2.6, 3.2)  # m/s
_PAUSES = 0.5  # share of the places where one may pause at which one who pauses does
_SECONDS = (4.0, 15.0)  # of a pause
_ASIDE = 0.7  # metres between the middles of two who walk side by side
_LONG = 12.0  # metres; on longer legs one may pause on the way too


def running_speed(blueprint: Blueprint, stream: Stream) -> float | None:
    """Return the speed of a pedestrian who runs, m/s; None for one who walks."""
    if blueprint.attributes["generation"] != "adult" or stream.unit() >= RUNNERS:
        return None
    return stream.uniform(*_RUNNING)


def with_pauses(start: Pose, route: Sequence[Point], stream: Stream) -> tuple[tuple[Point, ...], tuple[Pause, ...]]:
    """Return a route and the pauses on it, for which waypoints are added on long legs.

    A route that begins with another one has its pauses, and perhaps more.
    """
    if stream.unit() >= PAUSING:
        return tuple(route), ()
    points: list[Point] = []
    pauses: list[Pause] = []
    at = (start.x, start.y)
    for point in route:
        dx, dy = point.x - at[0], point.y - at[1]
        part = stream.uniform(0.2, 0.8)
        places = [(at[0] + part * dx, at[1] + part * dy), (point.x, point.y)]
        for n, (x, y) in enumerate(places):
            pauses_here, seconds = stream.unit() < _PAUSES, stream.uniform(*_SECONDS)
            if n == 1 or (pauses_here and math.sqrt(dx * dx + dy * dy) > _LONG):
                points.append(Point(x=x, y=y))
                pauses += [Pause(waypoint=len(points) - 1, seconds=seconds)] if pauses_here else []
        at = (point.x, point.y)
    return tuple(points), tuple(pauses)


def is_paired(stream: Stream) -> bool:
    """Draw whether a pedestrian accompanies the previous one, if that one does not accompany another."""
    return stream.unit() < PAIRED


def places_beside(leader: ActorPlan, stream: Stream) -> list[Pose]:
    """Return the starts next to a pedestrian, the preferred side first; empty if it has no companion."""
    if leader.companion is not None or leader.speed > _RUNNING[0]:
        return []
    s, c = exact.sin_cos_deg(leader.start.yaw)
    side = stream.choice((_ASIDE, -_ASIDE))
    return [
        Pose(x=leader.start.x - s * aside, y=leader.start.y + c * aside, z=leader.start.z, yaw=leader.start.yaw)
        for aside in (side, -side)
    ]
