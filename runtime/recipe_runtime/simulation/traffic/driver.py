"""A vehicle's driver: chooses acceleration and lateral offset ten times a second.

The speed is the minimum of the driver's own speed, the limit of the road, and the limit of bends ahead. `following`
keeps the distance to obstacles in the `corridor`. `junctions` controls stop lines. `lane_change` chooses lanes on roads
with several, `overtaking` uses the oncoming lane of streets. `reversing` applies after a collision, or if the vehicle
is too near to an obstacle to pass it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from recipe_compiler.ir.plan import ActorPlan, DriverPlan

from recipe_runtime.body.skeleton import BICYCLE
from recipe_runtime.simulation.path import Path
from recipe_runtime.simulation.traffic import corridor
from recipe_runtime.simulation.traffic.corridor import Corridor, Obstacle
from recipe_runtime.simulation.traffic.following import (
    HARDEST_BRAKING,
    following_acceleration,
    free_acceleration,
    stopping_acceleration,
    stopping_distance,
    style_of,
)
from recipe_runtime.simulation.traffic.junctions import JunctionControl
from recipe_runtime.simulation.traffic.lane_change import LaneChanger, Own
from recipe_runtime.simulation.traffic.lateral import Lateral
from recipe_runtime.simulation.traffic.overtaking import Overtaking, is_stalled
from recipe_runtime.simulation.traffic.passage import Passage
from recipe_runtime.simulation.traffic.protocols import Body, Vehicle, is_vehicle
from recipe_runtime.simulation.traffic.reversing import Reversing, Situation
from recipe_runtime.simulation.traffic.road_map import Lanes, RoadMap, speed_profile
from recipe_runtime.simulation.traffic.standing_props import PropsNearby, StandingProp

_LATERAL, _EARLY_BRAKING = 1.4, 1.2  # m/s2: lateral acceleration in bends, and braking before lower speed limits
_BICYCLE_OFFSET = -0.8  # metres: bicycles keep to the right
_BEFORE_LINE = 1.5  # metres before the waiting position from which vehicles in the junction matter
_AT_LINE = 0.7  # metres between the front and the waiting position
_FIRM = 2.4  # m/s2, maximum braking to stop at the waiting position instead of at the painted line behind it
_LATE = 4.0  # m/s2, maximum braking to keep the distance from which a stationary obstacle can be passed
_SLACK = 0.5  # metres by which queues may be longer than necessary
_RETURN = 6.0  # additional gap to an oncoming overtaking vehicle, metres, so that it can return to its lane
_PASSING = 1.5  # m/s from which a crossing vehicle is expected to clear the way
_PULL_OUT = 11.0  # additional gap behind a stationary obstacle, metres, from which a vehicle can pass it
_LONG = 3.2  # half length, metres, from which the tail swing of the body is considered
_SWING = 15.0  # metres, the sum of both axes, within which it is considered for pedestrians
_IDLE_TICKS = 20  # decisions to accelerate without moving after which it is stalled, for example by a crash
_LANE_TICKS = 8  # decisions between two checks of other lanes


@dataclass(frozen=True, slots=True)
class Command:
    """A driver's command to its vehicle."""

    acceleration: float  # m/s2 along the path
    reverse: bool = False  # reverse slowly instead


class Driver:
    """The driver of one vehicle.

    Attributes:
        style: Its parameters of car following.
        obeys_signs: Whether it obeys stop and yield signs.
        sees_vehicles: Whether it reacts to other vehicles.
        passage: Its state at the junctions on its path.
        lateral: The vehicle's lateral motion.
        desired: Its desired speed on a free road, m/s.
        waiting: Whether it waits at a stop line, or will have to.
        horizon: Metres within which it needs to know its neighbours.
        stalled: Whether it is stationary for a reason of its own: not in a queue, at a stop line or for another agent.
    """

    def __init__(
        self, actor: ActorPlan, road_map: RoadMap, junctions: JunctionControl, props: Sequence[StandingProp] = ()
    ) -> None:
        plan = actor.driver or DriverPlan()
        self.actor, self.style, self._plan = actor, style_of(actor.shape, actor.driver), plan
        self.obeys_signs, self.sees_vehicles = plan.obeys_signs, plan.sees_vehicles
        self.base_offset = _BICYCLE_OFFSET if int(actor.shape["body"]) == BICYCLE else 0.0
        self.passage = Passage(extent=math.inf if actor.route else 0.0)
        self.lateral = Lateral(actor.shape, self.base_offset, street=True)
        self.desired = actor.speed
        self.waiting, self.stalled = False, not actor.route or actor.speed <= 0.0
        self.horizon = 60.0
        self._map, self._junctions = road_map, junctions
        self._props = PropsNearby(props) if props else None
        self._path: Path | None = None
        self._profile: Sequence[float] = ()
        self._lanes: Lanes | None = None
        self._changer, self._overtaking = LaneChanger(), Overtaking(junctions)
        self._reversing = Reversing(road_map, junctions)
        self._ticks = self._idle = 0

    @property
    def offset(self) -> float:
        """The desired offset, metres to the left of the path."""
        return self.lateral.target

    @property
    def line(self) -> float:
        """The offset that the vehicle should have by now."""
        return self.lateral.line

    @property
    def overtakes(self) -> bool:
        """Whether it is in the oncoming lane of a street."""
        return self._lanes is None and max(self.offset, self.line) > self.base_offset + 0.3

    @property
    def lane_offset(self) -> float:
        """The offset of its lane."""
        return self.base_offset if self._lanes is None else self._changer.lane * self._lanes.width

    def arrived(self, vehicle: Vehicle) -> bool:
        """Return whether the vehicle has reached the end of its path and stays there."""
        return self.actor.entry is None and vehicle.progress > vehicle.path.length - 1.5

    def decide(self, vehicle: Vehicle, neighbours: Sequence[Body], seconds: float) -> Command:
        """Return the command until the next decision.

        Args:
            vehicle: The vehicle.
            neighbours: The agents within `horizon` metres, in plan order, without the vehicle.
            seconds: Time since frame 0.
        """
        if vehicle.path is not self._path:
            self._take_path(vehicle)
        if self.actor.speed <= 0.0 or not vehicle.path.legs or (self.actor.held and seconds < 0.0):
            self.waiting, self.stalled, self.passage.extent = False, True, 0.0
            return Command(-2.0 if vehicle.speed > 0.0 else 0.0)
        if not (self._plan.sees_vehicles and self._plan.sees_walkers):
            neighbours = [body for body in neighbours if self._sees(body)]
        if self._props is not None:
            neighbours = [*neighbours, *self._props.near(vehicle.x, vehicle.y, self.horizon)]
        speed, style = vehicle.speed, self.style
        self.desired = self._desired(vehicle)
        free = free_acceleration(speed, self.desired, style)
        line = self._distance_to_line(vehicle)
        ahead = self._corridor(vehicle, line)
        found = corridor.obstacles(ahead, neighbours)
        if self.passage.inside:
            found += self._swung_at(vehicle, neighbours, found)
        wish = min(free, self._before_line(vehicle, line, free), self._before_goal(vehicle, free))
        nearest: Obstacle | None = None
        for obstacle in found:
            if nearest is None or obstacle.gap < nearest.gap:
                nearest = obstacle
            gap = obstacle.gap - self._spare(vehicle, obstacle)
            if obstacle.person:
                wish = min(wish, stopping_acceleration(speed, free, gap, obstacle.speed, style, style.gap + 0.5))
                continue
            if _is_inside(obstacle.body) and obstacle.along < 0.3:  # it will clear the way
                if obstacle.gap < line - _BEFORE_LINE:
                    ahead_speed = max(0.0, obstacle.speed)
                    wish = min(wish, stopping_acceleration(speed, free, gap, ahead_speed, style, style.gap))
                continue
            standstill = style.gap + (_RETURN if obstacle.along < -0.5 and not self.overtakes else 0.0)
            wish = min(wish, following_acceleration(speed, free, gap, obstacle.speed, style, standstill))
        self._idle = self._idle + 1 if speed < 0.1 and wish > 0.2 else 0
        self.stalled = self._idle > _IDLE_TICKS or self.arrived(vehicle)
        self._note_room(vehicle, found, line)
        self.waiting = line < 12.0
        self._choose_offset(vehicle, neighbours, nearest, seconds)
        reverse = speed < 0.1 and self._drives_back(vehicle, neighbours, Situation(wish, nearest), seconds)
        return Command(max(-HARDEST_BRAKING, wish), reverse)

    def _drives_back(self, vehicle: Vehicle, neighbours: Sequence[Body], situation: Situation, seconds: float) -> bool:
        """Return whether a vehicle that is stationary or reversing reverses now."""
        situation.overtakes = self._lanes is None and self.offset > self.base_offset + 0.3
        return self._reversing.decide(vehicle, neighbours, situation, seconds)

    def _sees(self, body: Body) -> bool:
        """Return whether it reacts to another agent."""
        return self._plan.sees_walkers if body.actor.category == "pedestrian" else self._plan.sees_vehicles

    def _take_path(self, vehicle: Vehicle) -> None:
        """Compute the speeds along a new path."""
        path = self._path = vehicle.path
        self._overtaking = Overtaking(self._junctions)
        if path.legs:
            goal = self.actor.entry is None
            factor = self._plan.limit_factor
            self._profile = speed_profile(
                path, self._map, lateral=_LATERAL, braking=_EARLY_BRAKING, goal=goal, factor=factor
            )
            self._lanes = self._map.lanes(*path.at(0.0))
        self.lateral = Lateral(self.actor.shape, self.lane_offset, street=self._lanes is None)
        fastest = min(self.actor.speed, max(self._profile, default=0.0))
        self.horizon = max(60.0, min(200.0, 5.0 * fastest + 30.0))

    def _desired(self, vehicle: Vehicle) -> float:
        """Return the desired speed on a free road, slightly ahead of the vehicle."""
        at = int(vehicle.progress + 0.3 * vehicle.speed)
        return min(self.actor.speed, self._profile[max(0, min(at, len(self._profile) - 1))])

    def _distance_to_line(self, vehicle: Vehicle) -> float:
        """Return the metres from the front to the waiting position; infinity if it need not wait."""
        crossing = self.passage.next
        if crossing is None or self.passage.granted:
            return math.inf
        painted = crossing.entry - vehicle.progress - vehicle.reach
        hold = painted - self._junctions.setback(crossing)
        needed = stopping_distance(vehicle.speed, _FIRM)
        return hold if hold > needed + 0.3 else max(hold, min(painted, needed + _AT_LINE))

    def _before_line(self, vehicle: Vehicle, line: float, free: float) -> float:
        """Return the acceleration that stops at the line."""
        if line > 80.0:
            return free
        if line <= _AT_LINE:  # beyond the waiting position, but not over the painted line
            return -3.0 if vehicle.speed > 0.0 else 0.0
        return stopping_acceleration(vehicle.speed, free, line, 0.0, self.style, _AT_LINE)

    def _before_goal(self, vehicle: Vehicle, free: float) -> float:
        """Return the acceleration that stops at the end of the path, if the vehicle stays there."""
        left = vehicle.path.length - vehicle.progress
        if self.actor.entry is not None or left > 60.0:
            return free
        if left < 0.5:
            return -3.0 if vehicle.speed > 0.0 else 0.0
        return stopping_acceleration(vehicle.speed, free, left, 0.0, self.style, 0.5)

    def _corridor(self, vehicle: Vehicle, line: float) -> Corridor:
        """Return the strip ahead in which obstacles are considered."""
        speed = vehicle.speed
        length = _PULL_OUT + 5.0 + 2.0 * speed + stopping_distance(speed, 2.2)
        crossing = self.passage.next
        if crossing is not None:
            to_line = crossing.entry - vehicle.progress
            if to_line < 30.0:  # to see whether there is room behind the junction
                length = max(length, crossing.leave - vehicle.progress + vehicle.reach + 6.0)
        return Corridor.of(vehicle, min(length, self.horizon - 5.0), self.offset, self._map)

    def _swung_at(self, vehicle: Vehicle, neighbours: Sequence[Body], found: list[Obstacle]) -> list[Obstacle]:
        """Return the agents that the body would touch where it swings out of its corridor in its current junction."""
        passage = self.passage
        crossing = passage.crossings[passage.left]
        junction = self._map.junctions[crossing.junction]
        known = [obstacle.body for obstacle in found]
        after, long, more = vehicle.progress - crossing.entry, vehicle.reach > _LONG, []
        for body in neighbours:
            person = body.actor.category == "pedestrian"
            far = person and abs(body.x - vehicle.x) + abs(body.y - vehicle.y) > _SWING
            if far or not (person or long) or any(body is other for other in known):
                continue
            contact = crossing.movement.first_touch(body, (junction.x, junction.y), after + 1.0)
            if contact is not None:
                more.append(Obstacle(body, contact - after - 0.5, 0.0, 0.0, 0.0, 0.0, person))
        return more

    def _spare(self, vehicle: Vehicle, obstacle: Obstacle) -> float:
        """Return the additional gap to keep to an obstacle, metres: enough to pull out behind a stalled one."""
        if obstacle.person or self._lanes is not None or abs(obstacle.speed) > 0.2 or not is_stalled(obstacle.body):
            return 0.0
        room = obstacle.gap - self.style.gap - stopping_distance(vehicle.speed, _LATE)
        return max(0.0, min(_PULL_OUT, room))

    def _note_room(self, vehicle: Vehicle, found: Sequence[Obstacle], line: float) -> None:
        """Store how far the front may go before it has to stop behind another agent."""
        room = solid = math.inf
        for obstacle in found:
            here, body = max(0.0, obstacle.gap - self.style.gap - _SLACK), obstacle.body
            if is_vehicle(body) and body.actor.speed > 0.0:
                if obstacle.along > 0.3:
                    here += max(0.0, body.driver.passage.extent)
                elif body.speed > _PASSING and (obstacle.along > -0.7 or body.driver.passage.inside):
                    continue  # it crosses or turns, and will clear the way
            room = min(room, here)
            solid = solid if obstacle.person else min(solid, here)
        self.passage.room, self.passage.solid_room = room, solid
        end = math.inf if self.actor.entry is not None else vehicle.path.length - vehicle.progress
        self.passage.extent = max(0.0, min(room, line - _AT_LINE, end))

    def _choose_offset(
        self, vehicle: Vehicle, neighbours: Sequence[Body], nearest: Obstacle | None, seconds: float
    ) -> None:
        """Choose a lane, or overtake."""
        self._ticks += 1
        if self._lanes is not None:
            if self._ticks % _LANE_TICKS == 0 and self._plan.changes_lanes:
                own = Own(vehicle.speed, self.desired, 2.0 * vehicle.reach, self.style, self._plan.keeps_right)
                self.lateral.move_to(self._changer.decide(vehicle, own, self._lanes, neighbours, seconds))
            return
        shift = self._overtaking.decide(vehicle, neighbours, nearest, self._map)
        self.lateral.move_to(self.base_offset if shift is None else shift)


def _is_inside(body: Body) -> bool:
    """Return whether a body is a vehicle in a junction."""
    return is_vehicle(body) and body.driver.passage.inside
