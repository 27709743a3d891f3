"""Crossing of roads: where a pedestrian's route is on a road, and when the pedestrian may enter it.

At the crossing of a junction, pedestrians have right of way: they enter unless an approaching vehicle cannot stop. If
the crossing has a traffic light, they obey it. Elsewhere they wait for a gap between vehicles, and after some time only
until the next vehicle can stop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from recipe_compiler.ir.signals import may_walk

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.path import Path
from recipe_runtime.simulation.traffic.road_map import Junction, direction_of
from recipe_runtime.simulation.walking.surroundings import Surroundings

KERB = 0.45  # metres before the road where a pedestrian waits
_SCAN, _AHEAD, _MOST = 0.25, 25.0, 400  # metres between samples, metres scanned ahead, maximum samples per call
_FIRM, _REACTION = 2.5, 0.5  # m/s2 and seconds: expected braking and reaction time of vehicles
_MARGIN = 1.5  # seconds between the end of the crossing and the next vehicle
_IN_SIGHT = 60.0  # metres of a vehicle's path that are considered
_PATIENCE = 15.0  # seconds of waiting for a gap
_STANDING = 0.3  # m/s

Vector2 = tuple[float, float]


@dataclass(slots=True, eq=False)
class Crossing:
    """A section of a route that is on a road."""

    start: float  # arc length of the route at the kerb, metres
    end: float  # arc length where the road ends, as far as it is scanned
    open: bool  # whether the scan has not reached the end of the road
    begin: Vector2  # the kerb
    junction: Junction | None = None
    signal: Mapping[str, float] | None = None
    waited: float = 0.0  # seconds


class Crossings:
    """The crossings on one route, found as the pedestrian comes near."""

    def __init__(self, path: Path, surroundings: Surroundings) -> None:
        self._path, self._surroundings = path, surroundings
        self._scanned = 0.0
        self._found: list[Crossing] = []

    def next(self, metres: float) -> Crossing | None:
        """Return the crossing that the pedestrian is on, or the next one within 25 m; None if there is none.

        Args:
            metres: Its progress on the route, metres.
        """
        self._scan(metres)
        while self._found and not self._found[0].open and self._found[0].end < metres:
            self._found.pop(0)
        return self._found[0] if self._found else None

    def segment(self, crossing: Crossing) -> tuple[float, float, float, float]:
        """Return the segment of a crossing from kerb to kerb: x, y, x, y, metres."""
        return (*crossing.begin, *self._path.at(crossing.end))

    def _scan(self, metres: float) -> None:
        """Find roads on the route ahead."""
        until = min(metres + _AHEAD, self._path.length)
        for _ in range(_MOST):
            if self._scanned > until:
                break
            at = self._path.at(self._scanned)
            last = self._found[-1] if self._found else None
            if self._surroundings.on_road(*at):
                if last is None or not last.open:
                    self._found.append(self._crossing(self._scanned, at))
                else:
                    last.end = self._scanned
                    if last.junction is None:
                        self._assign(last, at)
            elif last is not None and last.open:
                last.end, last.open = self._scanned, False
            self._scanned += _SCAN
        else:
            self._scanned = max(self._scanned, metres)

    def _crossing(self, start: float, at: Vector2) -> Crossing:
        crossing = Crossing(max(0.0, start - _SCAN), start, True, at)
        self._assign(crossing, at)
        return crossing

    def _assign(self, crossing: Crossing, at: Vector2) -> None:
        """Store the junction to which the crossing belongs, and the traffic light for its arm."""
        junction = self._surroundings.junction_at(*at)
        if junction is None:
            return
        tx, ty = self._path.tangent(self._scanned)
        x, y = at[0] - junction.x, at[1] - junction.y
        from_arm = (0.0, -y) if abs(tx) > abs(ty) else (-x, 0.0)  # towards the junction
        travel = direction_of(from_arm)
        crossing.junction = junction
        crossing.signal = junction.arms[travel].signal or junction.arms[(travel + 2) % 4].signal

    def may_enter(self, crossing: Crossing, speed: float, others: Sequence[Agent], obeys: bool, seconds: float) -> bool:
        """Return whether a pedestrian may enter a road.

        Args:
            crossing: The crossing.
            speed: The pedestrian's walking speed, m/s.
            others: Agents in sight.
            obeys: Whether the pedestrian obeys traffic lights.
            seconds: Time since frame 0.
        """
        if crossing.signal is not None and obeys and not may_walk(crossing.signal, seconds):
            return False
        first = crossing.junction is not None or crossing.waited > _PATIENCE
        duration = (crossing.end - crossing.start) / max(speed, 0.5) + _MARGIN
        segment = self.segment(crossing)
        return not any(_prevents(other, segment, first, duration) for other in others)


def _prevents(other: Agent, segment: tuple[float, float, float, float], first: bool, duration: float) -> bool:
    """Return whether a vehicle prevents a pedestrian from entering a road.

    Args:
        other: Another agent.
        segment: The crossing, from kerb to kerb.
        first: Whether the pedestrian has right of way if the vehicle can stop.
        duration: Seconds that the pedestrian needs to cross.
    """
    path: Path | None = getattr(other, "path", None)
    if path is None or other.speed < _STANDING or not path.legs:
        return False
    progress: float = other.progress  # type: ignore[attr-defined]
    at = _meets(path, progress - other.reach - 0.5, progress + _IN_SIGHT, segment)
    if at == math.inf:
        return False
    gap = at - progress - other.reach - 0.6
    if gap < 0.0:
        return True
    can_stop = gap > other.speed * other.speed / (2.0 * _FIRM) + _REACTION * other.speed
    if first:
        return not can_stop
    return gap < duration * other.speed


def _meets(path: Path, start: float, end: float, segment: tuple[float, float, float, float]) -> float:
    """Return the arc length, from `start` to `end`, at which a path intersects a segment; infinity if it does not."""
    x0, y0, x1, y1 = segment
    sx, sy = x1 - x0, y1 - y0
    for ax, ay, tx, ty, metres, length in path.window(start, end):
        across = tx * sy - ty * sx
        if abs(across) < 1e-6:
            continue
        dx, dy = x0 - ax, y0 - ay
        along, part = (dx * sy - dy * sx) / across, (dx * ty - dy * tx) / across
        if 0.0 <= part <= 1.0 and 0.0 <= along <= length and start <= metres + along <= end:
            return metres + along
    return math.inf
