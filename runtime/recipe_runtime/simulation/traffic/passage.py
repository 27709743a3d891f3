"""A vehicle's passage through the junctions on its path."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from recipe_runtime.simulation.path import Path
from recipe_runtime.simulation.traffic.following import stopping_distance
from recipe_runtime.simulation.traffic.protocols import Vehicle
from recipe_runtime.simulation.traffic.road_map import direction_of
from recipe_runtime.simulation.traffic.swept_path import Movement

_STANDING = 0.3  # m/s
_AT_THE_LINE = 6.0  # metres before the waiting position within which a stationary vehicle waits for the junction
_STOPPED_SPEED = 0.1  # m/s
_STOPPED = 3.0  # metres before the waiting position within which a stop counts at a stop sign
_BEHIND = 1.0  # metres between a junction and the rear of a vehicle that stops behind it


def decision_distance(speed: float) -> float:
    """Return the metres before a stop line at which a vehicle requests permission, early enough not to brake."""
    return stopping_distance(speed, 1.5) + speed + 6.0


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """A junction on a path."""

    junction: int
    arm: int  # direction of travel at the stop line
    exit: int  # direction of travel where it leaves the junction
    entry: float  # arc length at the stop line
    leave: float  # arc length where the junction ends
    movement: Movement

    @classmethod
    def on(cls, path: Path, junction: int, span: tuple[float, float], movement: Movement) -> Crossing:
        """Return the crossing of a junction between two arc lengths of a path."""
        arm, way_out = (direction_of(path.tangent(metres)) for metres in span)
        return cls(junction, arm, way_out, span[0], span[1], movement)


@dataclass(slots=True)
class Passage:
    """The state of a vehicle's passage through the junctions on its path."""

    path: Path | None = None
    crossings: list[Crossing] = field(default_factory=list)
    left: int = 0  # number of junctions that its rear has left
    entered: int = 0  # number of junctions whose stop line its front has passed
    granted: bool = False  # whether it has permission to enter the next junction
    reason: str = ""  # why it has no permission
    since: float = math.inf  # time when it came near the next stop line, seconds
    waited: float = 0.0  # seconds of waiting there while the light was not red
    stood: float = 0.0  # seconds of standing there with permission
    stopped: bool = False  # whether it has stopped at the next stop line
    obstructs: bool = False  # whether it stands beyond the waiting position, on the swept path of another vehicle
    room: float = math.inf  # metres to the position where its front has to stop behind another agent
    solid_room: float = math.inf  # likewise, ignoring pedestrians
    extent: float = math.inf  # likewise, and not beyond the next stop line without permission

    @property
    def next(self) -> Crossing | None:
        """The next junction, whose stop line is ahead."""
        return self.crossings[self.entered] if self.entered < len(self.crossings) else None

    @property
    def inside(self) -> bool:
        """Whether the vehicle is in a junction."""
        return self.left < self.entered

    def begin(self, path: Path, crossings: list[Crossing]) -> None:
        """Start a new path."""
        self.path, self.crossings = path, crossings
        self.left = self.entered = 0
        self._reset()

    def enter(self) -> None:
        """Record that the front has passed the next stop line."""
        self.entered += 1
        self._reset()

    def _reset(self) -> None:
        self.granted, self.reason, self.since = False, "", math.inf
        self.waited = self.stood = 0.0
        self.stopped = False

    def see(self, vehicle: Vehicle, hold: float, seconds: float, dt: float, free: bool) -> None:
        """Update the waiting times.

        Args:
            vehicle: The vehicle, the first one in its lane.
            hold: Metres from its front to the waiting position.
            seconds: Time since frame 0.
            dt: Seconds since the last update.
            free: Whether the light is not red.
        """
        if self.since == math.inf and hold < decision_distance(vehicle.speed):
            self.since = seconds
        if vehicle.speed < _STANDING and hold < _AT_THE_LINE:
            self.stopped = self.stopped or (hold < _STOPPED and vehicle.speed < _STOPPED_SPEED)
            self.waited += dt if free else 0.0
            self.stood += dt if self.granted else 0.0

    def has_room(self, vehicle: Vehicle) -> bool:
        """Return whether there is room behind the next junction; after 10 s of waiting, pedestrians are ignored."""
        crossing = self.next
        if crossing is None:
            return True
        room = self.room if self.waited < 10.0 else self.solid_room
        return room >= crossing.leave - vehicle.progress + vehicle.reach + _BEHIND
