"""Obstacles ahead: the agents in the corridor that a vehicle sweeps along its path.

While a vehicle changes its offset, its corridor leads from the current to the desired offset, see `lateral`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from recipe_runtime.simulation.path import Leg, nearest_on
from recipe_runtime.simulation.traffic.lateral import Lateral
from recipe_runtime.simulation.traffic.protocols import Body, Vehicle, is_vehicle
from recipe_runtime.simulation.traffic.road_map import RoadMap

CLEARANCE = 0.3  # metres on both sides of a moving vehicle
_TIGHT, _TOUCHING = 0.05, -0.1  # likewise for obstacles level with its front, and behind its front
_LONG = 2.9  # metres; bodies with a larger half length are tested in three pieces
_PERSON = 0.55  # metres on both sides of a pedestrian
_LAG = 1.0  # metres by which steering may be late
_FORESIGHT = 2.5  # seconds for which the motion of a pedestrian on the road is predicted
_STEP = 1.2  # likewise for a pedestrian about to step onto the road
_SOON = 0.8  # seconds before a pedestrian on the road enters the corridor from which a vehicle brakes hard
_ROADSIDE = 6.0  # metres beside a corridor within which pedestrians are considered
_BEFORE_CROSSING, _PACE = 1.2, 1.6  # metres to stop before the middle of a crossing; m/s of a crossing pedestrian
_KIND = 2.5  # m/s2, maximum braking for a pedestrian who is not yet on the road


@dataclass(slots=True)
class Corridor:
    """The strip ahead of a vehicle."""

    legs: Sequence[Leg]  # of the path
    start: float  # arc length of the vehicle's middle
    reach: float  # half its length
    length: float  # metres ahead of its front
    radius: float  # half its width
    offset: float  # metres to the left of the path
    target: float  # desired offset
    lateral: Lateral  # its motion to there
    speed: float  # of the vehicle
    open_end: bool  # whether the last leg is the path's last
    roads: RoadMap

    @classmethod
    def of(cls, vehicle: Vehicle, length: float, target: float, roads: RoadMap) -> Corridor:
        """Return the strip that a vehicle covers while it moves to an offset."""
        path, start, speed, driver = vehicle.path, vehicle.progress, vehicle.speed, vehicle.driver
        end = start + vehicle.reach + length
        legs, open_end = path.window(start - 2.0, end), end >= path.length
        in_lane = target == driver.base_offset == driver.line  # then any offset is due to bends
        offset, lateral = (target if in_lane else vehicle.offset), driver.lateral.plan(target)
        return cls(legs, start, vehicle.reach, length, vehicle.radius, offset, target, lateral, speed, open_end, roads)

    def edges(self, gap: float) -> tuple[float, float]:
        """Return the right and the left edge of the strip at a distance from the front."""
        if self.target == self.offset:
            return self.offset - self.radius, self.offset + self.radius
        aside, way, gap = self.target - self.offset, self.target - self.lateral.line, max(gap - _LAG, 0.0)
        if way:
            rest = (self.target - self.lateral.ahead(gap, self.speed)) / way
        else:  # it was displaced
            rest = max(0.0, 1.0 - gap / self.lateral.length(aside, self.speed))
        here = self.target - rest * aside
        return min(here, self.target) - self.radius, max(here, self.target) + self.radius


@dataclass(slots=True)
class Obstacle:
    """An agent in a corridor."""

    body: Body
    gap: float  # metres from the vehicle's front to its nearest part, along the path
    speed: float  # along the path, m/s
    right: float  # its edges, metres to the left of the path
    left: float
    along: float  # cosine of the angle between its heading and the path
    person: bool


def obstacles(corridor: Corridor, neighbours: Sequence[Body]) -> list[Obstacle]:
    """Return the agents in a corridor, in the order of the neighbours."""
    c, found = corridor, []
    low_x, low_y, high_x, high_y = _bounds(c)
    for body in neighbours:
        x, y, person = body.x, body.y, body.actor.category == "pedestrian"
        size = _ROADSIDE if person else body.reach
        if x < low_x - size or x > high_x + size or y < low_y - size or y > high_y + size:
            continue
        if person:
            obstacle = _crossing(c, body) or _person(c, body)
        elif size <= _LONG:
            obstacle = _vehicle(c, body, x, y, size)
        else:
            hx, hy = body.heading[0] * size / 1.5, body.heading[1] * size / 1.5
            pieces = [_vehicle(c, body, x + k * hx, y + k * hy, size / 3.0) for k in (-1.0, 0.0, 1.0)]
            obstacle = min((p for p in pieces if p is not None), key=lambda p: p.gap, default=None)
        if obstacle is not None:
            found.append(obstacle)
    return found


def _bounds(c: Corridor) -> tuple[float, float, float, float]:
    """Return the bounding box of a corridor: minimum x and y, maximum x and y."""
    end = c.start + c.reach + c.length
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for ax, ay, tx, ty, start, length in c.legs:
        first = c.start - start if c.start > start else 0.0
        last = length if end - start > length and not c.open_end else end - start
        for along in (first, last):
            x, y = ax + tx * along, ay + ty * along
            low_x, high_x = (x if x < low_x else low_x), (x if x > high_x else high_x)
            low_y, high_y = (y if y < low_y else low_y), (y if y > high_y else high_y)
    side = max(abs(c.offset), abs(c.target)) + c.radius + 3.0
    return low_x - side, low_y - side, high_x + side, high_y + side


def _direction(c: Corridor, metres: float) -> tuple[float, float]:
    """Return the direction of the path at an arc length."""
    for _, _, tx, ty, start, length in c.legs:
        if metres <= start + length:
            return tx, ty
    return c.legs[-1][2], c.legs[-1][3]


def _vehicle(c: Corridor, body: Body, x: float, y: float, size: float) -> Obstacle | None:
    """Return a vehicle, or a piece of one that reaches `size` metres to both ends, if it is in the corridor."""
    metres, aside = nearest_on(c.legs, x, y, c.open_end)
    if metres <= c.start or abs(aside) > max(abs(c.offset), abs(c.target)) + c.radius + size + 1.5:
        return None
    tx, ty = _direction(c, metres)
    hx, hy = body.heading
    cosine, sine = abs(hx * tx + hy * ty), abs(hx * ty - hy * tx)
    half = cosine * body.radius + sine * size
    gap = metres - cosine * size - sine * body.radius - c.start - c.reach
    if gap > c.length:
        return None
    room = _room(gap, CLEARANCE)
    low, high = aside - half, aside + half
    if is_vehicle(body) and gap > 0.3 and hx * tx + hy * ty > 0.9:  # a change of lanes that has begun
        shift = body.driver.offset - body.offset
        low, high = low + min(shift, 0.0), high + max(shift, 0.0)
    right, left = c.edges(gap)
    if low > left + room or high < right - room:
        return None
    vx, vy = body.velocity
    along = hx * tx + hy * ty if is_vehicle(body) else 0.0  # a prop faces nowhere
    return Obstacle(body, gap, vx * tx + vy * ty, low, high, along, False)


def _person(c: Corridor, body: Body) -> Obstacle | None:
    """Return a pedestrian who is in the corridor, or is predicted to enter it before the vehicle has passed."""
    metres, aside = nearest_on(c.legs, body.x, body.y, c.open_end)
    gap = metres - c.start - c.reach - body.radius
    if metres <= c.start or gap > c.length:
        return None
    tx, ty = _direction(c, metres)
    vx, vy = body.velocity
    along, across = vx * tx + vy * ty, vy * tx - vx * ty
    room = body.radius + _room(gap, _PERSON)
    right, left = c.edges(gap)
    to_right, to_left = right - room - aside, aside - left - room  # metres to the corridor, if positive
    if to_right > 0.0 or to_left > 0.0:
        distance, approach = (to_right, across) if to_right > 0.0 else (to_left, -across)
        if approach < 0.2 or distance > _FORESIGHT * approach:
            return None
        beside = not c.roads.paved(body.x, body.y)
        if beside and distance > _STEP * approach:
            return None
        late = c.speed * c.speed > 2.0 * _KIND * max(gap, 0.1)  # for a comfortable stop
        if late and distance > 0.3 and (beside or distance > _SOON * approach):
            return None
        passed = (gap + 2.0 * c.reach + 1.0) / max(c.speed, 0.5)
        if passed < distance / approach:
            return None
    return Obstacle(body, gap, min(along, c.speed), aside - body.radius, aside + body.radius, 0.0, True)


def _crossing(c: Corridor, body: Body) -> Obstacle | None:
    """Return a pedestrian who crosses the path with right of way, as an obstacle before the crossing.

    None if the vehicle can pass first, has passed, or cannot stop comfortably.
    """
    way: tuple[float, float, float, float] | None = getattr(body, "crossing", None)
    if way is None:
        return None
    x, y, dx, dy = way[0], way[1], way[2] - way[0], way[3] - way[1]
    size = math.sqrt(dx * dx + dy * dy)
    for ax, ay, tx, ty, start, length in c.legs:
        cross = tx * dy - ty * dx
        if abs(cross) < 1e-6 * size:
            continue
        metres = ((x - ax) * dy - (y - ay) * dx) / cross  # along the leg, and across
        across = ((x - ax) * ty - (y - ay) * tx) / cross * size
        if not (0.0 <= metres <= length and 0.0 <= across <= size):
            continue
        gap = start + metres - c.start - c.reach - _BEFORE_CROSSING
        walked = ((body.x - x) * dx + (body.y - y) * dy) / size
        left = across - walked - c.radius - body.radius  # metres until it is in the way
        if not 0.0 < gap <= c.length or left < -2.0 * c.radius - 1.0:
            return None
        if c.speed * c.speed > 2.0 * _KIND * gap or (gap + 2.0 * c.reach + 3.0) * _PACE < left * c.speed:
            return None
        return Obstacle(body, gap, 0.0, -c.radius, c.radius, 0.0, True)
    return None


def _room(gap: float, usual: float) -> float:
    """Return the lateral clearance to a body, metres; less if the vehicle's front is level with it or past it."""
    return usual if gap > 0.3 else _TIGHT if gap > -0.6 else _TOUCHING
