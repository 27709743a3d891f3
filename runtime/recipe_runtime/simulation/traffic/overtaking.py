"""Overtaking in the oncoming lane of a street: bicycles, and stationary obstacles in the lane.

A vehicle overtakes if it can return to its lane before the next junction, bend and oncoming vehicle. It can abort until
it is alongside the other one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from recipe_runtime.body.skeleton import BICYCLE, is_person
from recipe_runtime.simulation.traffic.corridor import Corridor, Obstacle, obstacles
from recipe_runtime.simulation.traffic.junctions import EMERGING, JunctionControl
from recipe_runtime.simulation.traffic.protocols import Body, Vehicle, is_vehicle
from recipe_runtime.simulation.traffic.road_map import RoadMap

_BESIDE_RIDER, _BESIDE_CAR = 1.2, 0.6  # lateral clearance, metres
_LEFT_EDGE = 4.3  # metres to the left of the lane's middle that the vehicle's side may reach
_NEAR = 22.0  # metres; farther leaders are not overtaken yet
_AFTER = 3.0  # metres between the two when the vehicle is back in its lane
_STANDS, _PERSON_STANDS = 4.0, 25.0  # seconds after which a stationary vehicle, or a pedestrian, is passed
_TICK = 0.1  # seconds between decisions


@dataclass(slots=True)
class _Plan:
    """An overtaking manoeuvre in progress."""

    body: Body
    offset: float


class Overtaking:
    """The decisions of one vehicle to overtake."""

    def __init__(self, junctions: JunctionControl) -> None:
        self._junctions = junctions
        self._plan: _Plan | None = None
        self._behind: Body | None = None
        self._seconds = 0.0  # for which it has been behind the same stationary body

    def decide(
        self, vehicle: Vehicle, neighbours: Sequence[Body], nearest: Obstacle | None, roads: RoadMap
    ) -> float | None:
        """Return the offset for overtaking, metres to the left of the path; None to stay in the lane.

        Args:
            vehicle: The vehicle, on a street.
            neighbours: Agents in its neighbourhood, in plan order.
            nearest: The nearest obstacle in its corridor that is not being overtaken.
            roads: The roads.
        """
        desired = vehicle.driver.desired
        self._count(nearest)
        if self._plan is not None:
            return self._go_on(vehicle, neighbours, self._plan, roads)
        if nearest is None or nearest.gap > _NEAR or not self._wants(nearest, desired):
            return None
        room = room_ahead(vehicle, self._junctions)
        rider = nearest.person or _is_bicycle(nearest.body)
        offset = nearest.left + (_BESIDE_RIDER if rider else _BESIDE_CAR) + vehicle.radius
        if offset + vehicle.radius > _LEFT_EDGE or nearest.right > 1.0:
            return None
        if not _free(vehicle, neighbours, nearest.body, (nearest.gap, nearest.speed), offset, room, roads):
            return None
        self._plan = _Plan(nearest.body, offset)
        return offset

    def _count(self, nearest: Obstacle | None) -> None:
        """Measure for how long the same body has stood ahead without waiting for others."""
        stands = nearest is not None and abs(nearest.speed) < 0.2 and nearest.gap < 16.0 and is_stalled(nearest.body)
        if nearest is None or not stands or nearest.body is not self._behind:
            self._seconds = 0.0
        self._behind = nearest.body if nearest is not None else None
        self._seconds += _TICK

    def _wants(self, nearest: Obstacle, desired: float) -> bool:
        """Return whether a leader should be overtaken."""
        if abs(nearest.speed) < 0.3:
            return self._seconds > (_PERSON_STANDS if nearest.person else _STANDS)
        return _is_bicycle(nearest.body) and 0.0 < nearest.speed < 0.75 * desired

    def _go_on(self, vehicle: Vehicle, neighbours: Sequence[Body], plan: _Plan, roads: RoadMap) -> float | None:
        """Continue, complete or abort the manoeuvre."""
        tx, ty = vehicle.path.tangent(vehicle.progress)
        body = plan.body
        ahead = (body.x - vehicle.x) * tx + (body.y - vehicle.y) * ty
        sizes = vehicle.reach + body.reach
        if ahead < -sizes - 1.0 - 0.2 * vehicle.speed or ahead > 40.0 or not body.present:
            self._plan = None
            return None
        if ahead > sizes:  # not yet alongside
            speed = body.velocity[0] * tx + body.velocity[1] * ty
            leader, room = (ahead - sizes, speed), room_ahead(vehicle, self._junctions) + 4.0
            if not _free(vehicle, neighbours, body, leader, plan.offset, room, roads):
                self._plan = None
                return None
        return plan.offset


def room_ahead(vehicle: Vehicle, junctions: JunctionControl) -> float:
    """Return the metres of straight road from a vehicle's front to its waiting position before a junction.

    The result is 0 in a junction, and if another vehicle leaves the next one towards it.
    """
    passage = vehicle.driver.passage
    if passage.inside:
        return 0.0
    path, front = vehicle.path, vehicle.progress + vehicle.reach
    crossing = passage.next
    end = path.length
    if crossing is not None:
        end = crossing.entry - junctions.setback(crossing)
        if end - front < EMERGING and junctions.leads_into(crossing):
            return 0.0
    tx, ty = path.tangent(vehicle.progress)
    for leg in path.window(vehicle.progress, end - 1.0)[1:]:
        if leg[2] * tx + leg[3] * ty < 0.999:
            end = min(end, leg[4])
            break
    return end - front


def _free(
    vehicle: Vehicle,
    neighbours: Sequence[Body],
    body: Body,
    leader: tuple[float, float],
    offset: float,
    room: float,
    roads: RoadMap,
) -> bool:
    """Return whether there is time and room to pass a body.

    Args:
        vehicle: The vehicle.
        neighbours: Agents in its neighbourhood.
        body: The body to pass.
        leader: Its distance from the vehicle's front, and its speed, m and m/s.
        offset: The offset while passing.
        room: Metres without a junction ahead.
        roads: The roads.
    """
    gap, speed = leader
    pace = max(1.5, (vehicle.speed + 2.0 * vehicle.driver.desired) / 3.0)
    if pace - speed < 1.0:
        return False
    driver = vehicle.driver
    half = 0.5 * driver.lateral.length(offset - driver.base_offset, pace)  # metres until its middle has returned
    back = half + vehicle.reach
    seconds = (gap + 2.0 * (body.reach + vehicle.reach) + _AFTER) / (pace - max(0.0, speed)) + back / pace + 0.5
    way = pace * seconds
    if way > room:
        return False
    length = min(2.5 * way + 15.0, vehicle.driver.horizon)
    lanes = [Corridor.of(vehicle, length, target, roads) for target in (vehicle.driver.base_offset, offset)]
    for other in [*obstacles(lanes[0], neighbours), *obstacles(lanes[1], neighbours)]:
        if other.body is body:
            continue
        at = other.gap + other.speed * seconds  # of its nearest part when the vehicle is back
        if at < way + 3.0:
            return False
    return not _overtaken(vehicle, neighbours, offset)


def _overtaken(vehicle: Vehicle, neighbours: Sequence[Body], offset: float) -> bool:
    """Return whether a vehicle behind overtakes or is about to."""
    tx, ty = vehicle.path.tangent(vehicle.progress)
    for body in neighbours:
        dx, dy = body.x - vehicle.x, body.y - vehicle.y
        along, aside = dx * tx + dy * ty, dy * tx - dx * ty
        if -25.0 < along <= 0.0 and aside > body.radius - vehicle.radius + 0.3 and aside < offset + 2.0:
            speed = body.velocity[0] * tx + body.velocity[1] * ty
            if along + body.reach > -vehicle.reach - 1.0 and abs(aside) < 3.5 and speed > -0.5:
                return True
            if speed > vehicle.speed + 0.5 and aside > 0.8:
                return True
    return False


def _is_bicycle(body: Body) -> bool:
    return not is_person(body.actor.shape) and int(body.actor.shape["body"]) == BICYCLE


def is_stalled(body: Body) -> bool:
    """Return whether a body is stationary for a reason of its own: neither in a queue nor at a stop line."""
    return not is_vehicle(body) or body.driver.stalled
