"""Right of way at junctions: which vehicle may enter, and when.

A vehicle enters a junction only with permission, which it holds until its rear has left. Permission is granted to the
first vehicle of each lane, in order of arrival, under these conditions:

- its light is green, or amber and a comfortable stop is no longer possible; at a stop sign it has stopped;
- its swept path does not intersect the remaining swept path of a vehicle with permission;
- its swept path touches no vehicle without permission that stands beyond its waiting position;
- there is room for it behind the junction, so that it will not have to stop inside;
- no overtaking vehicle is oncoming on the road that it would enter;
- no vehicle with priority arrives before it has passed (gap acceptance): priority roads go before stop signs, oncoming
  traffic before left turns, and without signs the vehicle from the right first if both arrive at the same time;
- no other vehicle has waited too long; one that has goes next, and the others are stationary or can stop.

A vehicle that stands before its stop line and cannot go returns its permission.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from recipe_compiler.ir.signals import light

from recipe_runtime.simulation.traffic.following import stopping_distance
from recipe_runtime.simulation.traffic.passage import Crossing, Passage, decision_distance
from recipe_runtime.simulation.traffic.protocols import Body, Vehicle, is_vehicle
from recipe_runtime.simulation.traffic.road_map import DIRECTIONS, RoadMap
from recipe_runtime.simulation.traffic.swept_path import MARGIN, Movement, Overlap, sweep

PATIENCE, PATIENCE_AT_LIGHTS = 20.0, 12.0  # seconds of waiting, while the light is not red, until others yield
_IN_SIGHT = 60.0  # metres before the stop line within which vehicles count as approaching
EMERGING = 90.0  # metres before it within which overtaking and leaving the junction are mutually exclusive
_COMFORTABLE, _FIRM = 2.0, 2.5  # m/s2
_GIVES_UP = 2.0  # seconds that a vehicle with permission may stand before the line
_SAFETY = 0.7  # seconds between two vehicles at the same point
_LANE = (0.3, 2.7)  # metres to the right of a road's axis that a waiting vehicle covers
_MAX_SETBACK = 8.0  # metres
_BEYOND = 0.5  # metres past its waiting position from which a vehicle may obstruct others


@dataclass(slots=True)
class _Approach:
    """The first vehicle in a lane that leads to a junction."""

    order: int  # in the plan
    vehicle: Vehicle
    passage: Passage
    crossing: Crossing
    distance: float  # metres from its front to the painted line
    hold: float  # metres from its front to where it waits


class JunctionControl:
    """The junctions of a town, and the vehicles that have permission to enter them."""

    def __init__(self, road_map: RoadMap) -> None:
        self.road_map = road_map
        self._movements: dict[tuple[object, ...], Movement] = {}
        self._overlaps: dict[tuple[int, int], Overlap | None] = {}
        self._setbacks = [[0.0] * 4 for _ in road_map.junctions]
        self._measured: list[set[int]] = [set() for _ in road_map.junctions]
        self._claims: list[list[tuple[Passage, Crossing, Vehicle]]] = [[] for _ in road_map.junctions]
        self._overtaken: list[set[int]] = [set() for _ in road_map.junctions]  # arms on which a vehicle overtakes
        self._seconds: float | None = None

    def setback(self, crossing: Crossing) -> float:
        """Return the metres before the painted line at which a vehicle waits, clear of the swing of long vehicles."""
        return self._setbacks[crossing.junction][crossing.arm]

    def update(self, agents: Sequence[Body], seconds: float) -> None:
        """Grant and revoke permissions. Called once per tick, before any driver decides.

        Args:
            agents: All agents, in plan order.
            seconds: Time since frame 0.
        """
        dt = 0.1 if self._seconds is None else seconds - self._seconds
        self._seconds = seconds
        lanes: dict[int, list[_Approach | None]] = {}
        vehicles: list[tuple[int, Vehicle]] = [(k, agent) for k, agent in enumerate(agents) if is_vehicle(agent)]
        for _, vehicle in vehicles:
            self._follow(vehicle)
        for overtaken in self._overtaken:
            overtaken.clear()
        for order, vehicle in vehicles:
            passage = vehicle.driver.passage
            self._advance(vehicle, passage)
            crossing = passage.next
            if crossing is None or not vehicle.present or (vehicle.actor.held and seconds < 0.0):
                continue
            distance = crossing.entry - vehicle.progress - vehicle.reach
            if distance < EMERGING and vehicle.driver.overtakes:
                self._overtaken[crossing.junction].add(crossing.arm)
            if distance < _IN_SIGHT:
                lane = lanes.setdefault(crossing.junction, [None] * 4)
                first = lane[crossing.arm]
                if first is None or distance < first.distance:
                    hold = distance - self.setback(crossing)
                    lane[crossing.arm] = _Approach(order, vehicle, passage, crossing, distance, hold)
        for number in sorted(lanes):
            approaches = [approach for approach in lanes[number] if approach is not None]
            self._decide(number, approaches, seconds, dt)

    def holds(self, passage: Passage, crossing: Crossing) -> bool:
        """Return whether a vehicle has permission for a crossing."""
        return any(p is passage and c is crossing for p, c, _ in self._claims[crossing.junction])

    def leads_into(self, crossing: Crossing) -> bool:
        """Return whether a vehicle with permission leaves a junction into the road that leads to a crossing."""
        against = _opposite(crossing.arm)
        return any(claimed.exit == against for _, claimed, _ in self._claims[crossing.junction])

    def _follow(self, vehicle: Vehicle) -> None:
        """Find the junctions on a vehicle's path, if the path is a new one."""
        passage = vehicle.driver.passage
        if passage.path is vehicle.path:
            return
        self._release_all(passage)
        crossings = []
        for junction, entry, leave in self.road_map.passages(vehicle.path):
            movement = self._movement(vehicle, junction, (entry, leave))
            crossings.append(Crossing.on(vehicle.path, junction, (entry, leave), movement))
        passage.begin(vehicle.path, crossings)
        for crossing in crossings:
            self._measure(crossing)

    def _movement(self, vehicle: Vehicle, number: int, span: tuple[float, float]) -> Movement:
        """Return the movement of a vehicle through a junction; equal ones are computed once."""
        junction, path, shape = self.road_map.junctions[number], vehicle.path, vehicle.actor.shape
        vertices = [leg[4] for leg in path.legs if span[0] < leg[4] < span[1]]
        points = [path.at(s) for s in (span[0] - 6.0, span[0], *vertices, span[1], span[1] + 6.0)]
        offset = vehicle.driver.base_offset
        key = (
            *((round(x - junction.x, 2), round(y - junction.y, 2)) for x, y in points),
            *(shape[name] for name in ("body", "length", "width", "wheelbase")),
            offset,
        )
        if key not in self._movements:
            middle = (junction.x, junction.y)
            self._movements[key] = sweep(len(self._movements), path, span, middle, shape, offset)
        return self._movements[key]

    def _measure(self, crossing: Crossing) -> None:
        """Move the waiting positions of other arms back from the swept path of a movement."""
        number, movement = crossing.junction, crossing.movement
        if movement.number in self._measured[number]:
            return
        self._measured[number].add(movement.number)
        for arm in range(4):
            if arm != crossing.arm:
                line = self.road_map.junctions[number].arms[arm].line
                over = movement.reach_into(DIRECTIONS[arm], _LANE) + 0.5 - line
                self._setbacks[number][arm] = max(self._setbacks[number][arm], min(over, _MAX_SETBACK))

    def _advance(self, vehicle: Vehicle, passage: Passage) -> None:
        """Record which stop lines a vehicle has passed and which junctions it has left."""
        if not vehicle.present or vehicle.driver.arrived(vehicle):
            self._release_all(passage)
            return
        rear, front = vehicle.progress - vehicle.reach, vehicle.progress + vehicle.reach
        while passage.entered < len(passage.crossings) and front > passage.crossings[passage.entered].entry + 0.05:
            crossing = passage.crossings[passage.entered]
            if not self.holds(passage, crossing):
                self._claims[crossing.junction].append((passage, crossing, vehicle))
            passage.enter()
        while passage.left < passage.entered and rear > passage.crossings[passage.left].leave:
            self._release(passage, passage.crossings[passage.left])
            passage.left += 1

    def _release(self, passage: Passage, crossing: Crossing) -> None:
        claims = self._claims[crossing.junction]
        self._claims[crossing.junction] = [c for c in claims if not (c[0] is passage and c[1] is crossing)]
        passage.granted = False if passage.next is crossing else passage.granted

    def _release_all(self, passage: Passage) -> None:
        for crossing in passage.crossings[passage.left : passage.entered + 1]:
            self._release(passage, crossing)

    def _decide(self, number: int, approaches: list[_Approach], seconds: float, dt: float) -> None:
        """Decide about the first vehicles in the lanes of one junction."""
        for a in approaches:
            a.passage.obstructs = False
            a.passage.see(a.vehicle, a.hold, seconds, dt, self._light(a, seconds) != "red")
        for a in sorted(approaches, key=lambda a: (a.passage.since, a.order)):
            passage = a.passage
            if passage.granted:
                if self._must_give_back(a, seconds):
                    self._release(passage, a.crossing)
                continue
            passage.reason = self._reason(a, approaches, seconds)
            if not passage.reason and a.hold < decision_distance(a.vehicle.speed):
                passage.granted, passage.stood = True, 0.0
                self._claims[number].append((passage, a.crossing, a.vehicle))

    def _must_give_back(self, a: _Approach, seconds: float) -> bool:
        """Return whether a vehicle with permission that has not entered loses it."""
        can_stop = a.distance > stopping_distance(a.vehicle.speed, _FIRM)
        calmly = a.distance > stopping_distance(a.vehicle.speed, _COMFORTABLE) + 0.5
        if a.passage.stood > _GIVES_UP or (calmly and not a.passage.has_room(a.vehicle)):
            return True
        return can_stop and a.vehicle.actor.obeys and self._light(a, seconds) in ("red", "amber")

    def _light(self, a: _Approach, seconds: float) -> str:
        """Return the signal for a vehicle; green where there is no light."""
        signal = self.road_map.junctions[a.crossing.junction].arms[a.crossing.arm].signal
        return light(signal, seconds) if signal is not None else "green"

    def _reason(self, a: _Approach, approaches: list[_Approach], seconds: float) -> str:
        """Return why a vehicle may not enter; an empty string if it may."""
        shown = self._light(a, seconds)
        if a.vehicle.actor.obeys:
            if shown == "red":
                return "light"
            if shown == "amber" and a.distance > stopping_distance(a.vehicle.speed, _FIRM):
                return "light"
        control = self.road_map.junctions[a.crossing.junction].arms[a.crossing.arm].control
        if control == "stop" and a.vehicle.driver.obeys_signs and not a.passage.stopped:
            return "sign"
        if not a.vehicle.driver.sees_vehicles:
            return ""
        if not a.passage.has_room(a.vehicle):
            return "room"
        if _opposite(a.crossing.exit) in self._overtaken[a.crossing.junction]:
            return "oncoming"
        for passage, crossing, holder in self._claims[a.crossing.junction]:
            if passage is a.passage or (crossing.arm == a.crossing.arm and crossing is not a.crossing):
                continue
            overlap = self.overlap(a.crossing.movement, crossing.movement)
            if overlap is not None and holder.progress - crossing.entry <= overlap.other_last:
                return "occupied"
        in_way = [
            other for other in approaches if other.hold < -_BEYOND and other is not a and self._stands_in_way(other, a)
        ]
        for other in in_way:
            other.passage.obstructs = True
        if in_way:
            return "blocked"
        for other in approaches:
            if other is not a and not other.passage.granted and self._goes_first(other, a, seconds):
                return "priority"
        return ""

    def _stands_in_way(self, other: _Approach, a: _Approach) -> bool:
        """Return whether a vehicle without permission stands beyond its waiting position, on another's swept path."""
        if other.passage.granted:
            return False
        junction = self.road_map.junctions[a.crossing.junction]
        after = a.vehicle.progress - a.crossing.entry
        return a.crossing.movement.first_touch(other.vehicle, (junction.x, junction.y), after, MARGIN) is not None

    def overlap(self, a: Movement, b: Movement) -> Overlap | None:
        """Return where two movements intersect; computed once for each pair."""
        key = (a.number, b.number)
        if key not in self._overlaps:
            self._overlaps[key] = a.overlap(b)
        return self._overlaps[key]

    def _goes_first(self, other: _Approach, a: _Approach, seconds: float) -> bool:
        """Return whether a vehicle must yield to another one that has no permission yet."""
        if other.passage.reason in ("light", "room", "sign", "oncoming", "blocked"):
            return False
        overlap = self.overlap(a.crossing.movement, other.crossing.movement)
        if overlap is None:
            return False
        mine, theirs = self._impatient(a), self._impatient(other)
        if theirs > 0.0 or mine > 0.0:
            return (theirs, -other.order) > (mine, -a.order)
        if not self._has_priority(other, a, seconds):
            return False
        speed = max(other.vehicle.speed, 2.0)
        arrives = (other.distance + max(0.0, overlap.other_first)) / speed
        return arrives < self._seconds_to_pass(a, overlap) + _SAFETY

    def _impatient(self, a: _Approach) -> float:
        """Return the seconds that a vehicle has waited beyond its patience; 0 if it has patience left."""
        lit = self.road_map.junctions[a.crossing.junction].arms[a.crossing.arm].signal is not None
        return max(0.0, a.passage.waited - (PATIENCE_AT_LIGHTS if lit else PATIENCE))

    def _has_priority(self, other: _Approach, a: _Approach, seconds: float) -> bool:
        """Return whether the rules give another vehicle priority."""
        ranks = [self._rank(approach, seconds) for approach in (other, a)]
        if ranks[0] != ranks[1]:
            return ranks[0] > ranks[1]
        if other.crossing.arm == _opposite(a.crossing.arm):
            return a.crossing.movement.turn == "left" and other.crossing.movement.turn != "left"
        if (other.crossing.arm - a.crossing.arm) % 4 == 1 and ranks[0] == 1:  # from the right
            return abs(other.passage.since - a.passage.since) < 1.0 and a.passage.waited < 5.0
        return False

    def _rank(self, a: _Approach, seconds: float) -> int:
        """Return 2 for a priority road or a green light, 1 without signs, 0 for a stop or yield sign or a red light."""
        control = self.road_map.junctions[a.crossing.junction].arms[a.crossing.arm].control
        if control in ("stop", "yield") and not a.vehicle.driver.obeys_signs:
            return 2
        if control == "light":
            return 2 if self._light(a, seconds) == "green" else 0
        return {"priority": 2, "none": 1, "stop": 0, "yield": 0}[control]

    def _seconds_to_pass(self, a: _Approach, overlap: Overlap) -> float:
        """Return the seconds until a vehicle that goes now is past the place where another one meets it."""
        style = a.vehicle.driver.style
        speed, way = a.vehicle.speed, a.distance + a.vehicle.reach + overlap.last
        fastest = max(speed, 4.0 if a.crossing.movement.turn != "straight" else 8.0)
        rise = (fastest * fastest - speed * speed) / (2.0 * style.acceleration)
        if rise >= way:
            return (math.sqrt(speed * speed + 2.0 * style.acceleration * way) - speed) / style.acceleration
        return (fastest - speed) / style.acceleration + (way - rise) / fastest


def _opposite(direction: int) -> int:
    """Return the number of the opposite direction of travel."""
    return (direction + 2) % 4
