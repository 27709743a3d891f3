"""The decisions of one pedestrian, ten times a second: walk, pause, wait at a kerb, accompany another pedestrian."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from recipe_compiler.ir.ground.obstacles import Obstacle
from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.walking import avoidance, making_way
from recipe_runtime.simulation.walking.avoidance import LOOK, Disc, Scene
from recipe_runtime.simulation.walking.crossings import KERB, Crossing, Crossings
from recipe_runtime.simulation.walking.detour import Detour
from recipe_runtime.simulation.walking.route import Route, braking_speed
from recipe_runtime.simulation.walking.surroundings import SIGHT, Surroundings

if TYPE_CHECKING:
    from recipe_runtime.simulation.pedestrian import PedestrianAgent

DT = 0.1  # seconds between decisions
_COMFORT, _LEAST_COMFORT = 0.2, 0.02  # metres between two people, usually and in a jam
_APART = 0.42  # minimum distance between the middles of two people, metres
_TO_WALL, _TO_VEHICLE, _TO_COMPANION = 0.05, 0.2, 0.08  # clearance to obstacles, vehicles and companions, metres
_NEAR = 8.0  # metres within which others are avoided
_BEHIND = -0.3  # metres ahead; others farther behind are not avoided
_FORESIGHT, _STILL = 1.5, 4.0  # seconds of prediction for moving and for stationary vehicles
_STANDING = 0.15  # m/s
_BLOCKED, _DETOUR = 2.0, 3.5  # seconds of standing after which wide turns are permitted, and their duration
_AGAIN = 15.0  # seconds after such an attempt within which a second one plans a path
_GOALS = (6.0, 9.0, 12.0, 3.0)  # metres ahead on the route of the goals of such a path
_PASSING = 1.0  # seconds after a sidestep during which the side is kept
_ARRIVED, _CROWDED, _BACK = 0.02, 1.2, 0.6  # metres to the goal: reached; reached if it is occupied; left again
_LEAST_STEP = 0.05  # metres of room for a step aside
_RETURN = 2.0  # seconds after it has made way, at which a pedestrian goes back
_DECISION = 1.0  # metres before the kerb, in addition to the braking distance, at which a crossing is decided
_NEAR_ROAD = 6.0  # metres before a road from which distant vehicles are considered
_HURRY, _FASTEST = 7.0, 1.7  # duration of crossing at a traffic light, seconds, with at most this speed, m/s
_ASIDE, _FLIP = 0.7, 0.25  # metres between companions; lateral offset, metres, from which the side is kept
_LAG, _FAR_BEHIND, _LOST = 1.5, 3.0, 12.0  # metres between companions
_WAIT_FOR = 20.0  # seconds to wait for a companion at a kerb

Segment = tuple[float, float, float, float]  # from kerb to kerb: x, y, x, y, metres


@dataclass(frozen=True, slots=True)
class Wish:
    """The desired motion of a pedestrian until the next decision."""

    ux: float = 1.0  # direction, a unit vector
    uy: float = 0.0
    speed: float = 0.0  # m/s
    waits: bool = False  # at a kerb
    crossing: Segment | None = None  # the crossing that it is on or about to enter
    look: float = 0.0  # degrees to the left of its heading
    aim: tuple[float, float] | None = None  # direction in which it would walk if nobody were in its way; a unit vector


class Walker:
    """Makes the decisions of one pedestrian.

    Attributes:
        leader: The pedestrian that it accompanies.
        near_road: Whether distant vehicles are considered.
    """

    def __init__(self, actor: ActorPlan, surroundings: Surroundings) -> None:
        self.leader: PedestrianAgent | None = None
        self.near_road = False
        self._actor, self._surroundings = actor, surroundings
        self._route = Route(actor)
        self._crossings = Crossings(self._route.path, surroundings)
        self._seed = zlib.crc32(actor.name.encode())
        self._side, self._beside = 0, 1
        self._stood, self._detour_until, self._passing_until = 0.0, -math.inf, -math.inf
        self._made_way = math.inf  # time of the last step aside after which it has not gone back
        self._blocked_at, self._detour = -math.inf, Detour(surroundings)
        self._arrived = not actor.route or actor.speed <= 0.0

    def decide(self, own: PedestrianAgent, others: Sequence[Agent], seconds: float, *, stands: bool) -> Wish:
        """Return the desired motion.

        Args:
            own: The pedestrian.
            others: Agents in sight.
            seconds: Time since frame 0.
            stands: Whether it has to stand still.
        """
        if stands:
            return Wish(*own.heading)
        if self.leader is not None:
            return self._keep_beside(self.leader, own, others, seconds)
        route = self._route
        route.advance(own.x, own.y)
        if self._is_there(own) or route.pauses(seconds, own.speed < 0.5):
            ux, uy, pace = self._stand(own, others, seconds)
            return Wish(ux, uy, pace, look=self._look_about(seconds))
        speed, stop = self._pace(own), route.to_stop(own.x, own.y)
        crossing, on_road, waits, segment = self._crossings.next(route.metres), False, False, None
        if crossing is not None:
            on_road = route.metres > crossing.start - 0.1
            if on_road:
                segment = self._crossings.segment(crossing)
                if crossing.signal is not None:
                    speed = max(speed, min(_FASTEST, (crossing.end - crossing.start) / _HURRY))
            else:
                to_kerb = crossing.start - KERB - route.metres
                if to_kerb < _DECISION + own.speed * own.speed / 3.0:
                    if not self._may_enter(crossing, own, others, seconds):
                        stop = min(stop, max(0.0, to_kerb))
                        waits = stop < 0.5
                        crossing.waited += DT if waits else 0.0
                    elif crossing.junction is not None:
                        segment = self._crossings.segment(crossing)
        self.near_road = crossing is not None and not on_road and crossing.start - route.metres < _NEAR_ROAD
        speed = min(speed, braking_speed(stop), 2.5 * stop)
        if waits and stop < 0.1:
            return Wish(*own.heading, waits=True, look=self._look_both_ways(seconds))
        ux, uy = route.direction(own.x, own.y, own.speed, passing=seconds < self._passing_until)
        wish = self._avoid(own, others, (ux, uy), speed, stop, on_road=on_road, seconds=seconds)
        look = self._look_both_ways(seconds) if waits else self._look_at(own, own.follower, seconds)
        aim = (ux, uy) if speed > _STANDING else None
        if aim is not None and wish.speed < _STANDING and not on_road:
            ux, uy, pace = self._make_way(own, others, aim) or (wish.ux, wish.uy, wish.speed)
            return Wish(ux, uy, pace, waits, segment, look, aim)
        return Wish(wish.ux, wish.uy, wish.speed, waits, segment, look, aim)

    def _stand(self, own: PedestrianAgent, others: Sequence[Agent], seconds: float) -> tuple[float, float, float]:
        """Return direction and speed of a pedestrian who stands: it makes way, and goes back later."""
        step = self._make_way(own, others, None) if self._actor.route and self._actor.speed > 0.0 else None
        if step is not None:
            self._made_way = seconds
        elif seconds > self._made_way + _RETURN:
            self._made_way = math.inf
            self._arrived = self._arrived and self._route.distance_to_goal(own.x, own.y) < _BACK
        return step or (*own.heading, 0.0)

    def _make_way(
        self, own: PedestrianAgent, others: Sequence[Agent], aim: tuple[float, float] | None
    ) -> tuple[float, float, float] | None:
        """Return the direction and the speed of a step aside; None if there is no reason or no room for it."""
        scene = None
        for step in making_way.steps(own, aim, others):
            scene = scene or self._scene(own, others, None, on_road=False, comfort=_LEAST_COMFORT)
            free = scene.free_aside(*step, making_way.SPEED, SIGHT)
            if free > _LEAST_STEP:
                return (*step, min(making_way.SPEED, free))
        return None

    def _is_there(self, own: PedestrianAgent) -> bool:
        """Return whether it has reached its goal, or is near a goal that others occupy."""
        if self._actor.route and self._route.left < _CROWDED:
            distance = self._route.distance_to_goal(own.x, own.y)
            if distance < _ARRIVED or (distance < _CROWDED and self._stood > _BLOCKED - DT):
                self._arrived = True
            elif distance > _BACK + _CROWDED:
                self._arrived = False
        return self._arrived

    def _pace(self, own: PedestrianAgent) -> float:
        """Return the desired speed without obstacles: lower if its companion has fallen behind."""
        if own.follower is None:
            return self._actor.speed
        lag = _distance(own, own.follower)
        part = 1.0 if lag < _LAG or lag > _LOST else (0.75 if lag < _FAR_BEHIND else 0.5)
        return part * self._actor.speed

    def _may_enter(self, crossing: Crossing, own: PedestrianAgent, others: Sequence[Agent], seconds: float) -> bool:
        lag = 0.0 if own.follower is None else _distance(own, own.follower)
        if _FAR_BEHIND < lag < _LOST and crossing.waited < _WAIT_FOR:
            return False
        return self._crossings.may_enter(crossing, self._actor.speed, others, self._actor.obeys, seconds)

    def _keep_beside(
        self, leader: PedestrianAgent, own: PedestrianAgent, others: Sequence[Agent], seconds: float
    ) -> Wish:
        """Return the motion that keeps the pedestrian at the leader's side, at its pace."""
        (hx, hy), dx, dy = leader.heading, own.x - leader.x, own.y - leader.y
        across = hx * dy - hy * dx
        self._beside = self._beside if abs(across) < _FLIP else (1 if across > 0.0 else -1)
        ex = -dx - self._beside * _ASIDE * hy
        ey = -dy + self._beside * _ASIDE * hx
        away = math.sqrt(ex * ex + ey * ey)
        self.near_road = leader.crossing is not None
        if leader.pace < _STANDING and away < 0.35:
            return Wish(*own.heading, waits=leader.waiting, look=self._look_at(own, leader, seconds))
        wx, wy = leader.velocity[0] + ex, leader.velocity[1] + ey
        size = math.sqrt(wx * wx + wy * wy)
        if size < 1e-6:
            return Wish(*own.heading)
        speed, distance = min(size, 1.35 * self._actor.speed + 0.2), LOOK if leader.pace > _STANDING else away
        aim = (wx / size, wy / size)
        wish = self._avoid(own, others, aim, speed, distance, on_road=leader.crossing is not None, seconds=seconds)
        look = self._look_at(own, leader, seconds)
        return Wish(wish.ux, wish.uy, wish.speed, False, leader.crossing, look, aim)

    def _avoid(
        self,
        own: PedestrianAgent,
        others: Sequence[Agent],
        ahead: tuple[float, float],
        speed: float,
        distance: float,
        *,
        on_road: bool,
        seconds: float,
    ) -> avoidance.Choice:
        """Return the direction and the speed that avoid others and obstacles."""
        wants = speed > 2.0 * _STANDING
        stands = own.velocity[0] * own.velocity[0] + own.velocity[1] * own.velocity[1] < _STANDING * _STANDING
        self._stood = self._stood + DT if wants and stands else max(0.0, self._stood - DT)
        if self._stood > _BLOCKED:
            self._go_round(own, others, seconds)
        if self._detour.active:
            ahead = self._detour.direction(own, self.leader, seconds) or ahead
        comfort = max(_LEAST_COMFORT, _COMFORT - 0.05 * self._stood)
        scene = self._scene(own, others, ahead, on_road=on_road, comfort=comfort)
        choice = avoidance.choose(scene, ahead, speed, distance, self._side, seconds < self._detour_until)
        if choice.side:
            self._side, self._passing_until = choice.side, seconds + _PASSING
        elif seconds > max(self._passing_until, self._detour_until):
            self._side = 0
        return choice

    def _go_round(self, own: PedestrianAgent, others: Sequence[Agent], seconds: float) -> None:
        """Start to go around an obstacle: by wide turns, or on a planned path if that has been tried recently."""
        again = seconds < self._blocked_at + _AGAIN
        self._blocked_at, self._stood = seconds, 0.0
        leader = self.leader
        goals = ((leader.x, leader.y),) if leader is not None else tuple(map(self._route.ahead, _GOALS))
        if not (again and self._detour.plan(own, goals, others, seconds)):
            self._detour_until = seconds + _DETOUR
            self._side = -self._side if again else self._side  # the wide turns to this side led nowhere

    def _scene(
        self,
        own: PedestrianAgent,
        others: Sequence[Agent],
        ahead: tuple[float, float] | None,
        *,
        on_road: bool,
        comfort: float,
    ) -> Scene:
        """Return the obstacles nearby: people ahead, or all; `comfort` is the distance to them, metres."""
        x, y, radius, (ux, uy) = own.x, own.y, own.radius, ahead or (0.0, 0.0)
        discs: list[Disc] = []
        boxes = []
        for other in others:
            dx, dy, size = other.x - x, other.y - y, other.reach
            if dx > _NEAR + size or dx < -_NEAR - size or dy > _NEAR + size or dy < -_NEAR - size:
                continue
            vx, vy = other.velocity
            if size == other.radius:  # a pedestrian
                if dx * ux + dy * uy < _BEHIND:
                    continue
                kept = _TO_COMPANION if other is self.leader or other is own.follower else comfort
                room = max(radius + size + kept, _APART)
                discs.append((dx, dy, vx, vy, dx * dx + dy * dy - room * room))
                continue
            moves = vx * vx + vy * vy > 0.1
            if moves and not on_road:
                continue
            hx, hy = other.heading
            box = Obstacle("", "vehicle", other.x, other.y, hx, hy, size, other.radius)
            margin = min(radius + _TO_VEHICLE, box.outside(x, y) - 0.01)
            if margin > 0.0:
                boxes.append((box, margin, vx, vy, _FORESIGHT if moves else _STILL))
        walls = []
        for wall in self._surroundings.obstacles.near(x, y):
            gap = wall.outside(x, y)
            if 0.0 < gap < SIGHT:
                walls.append((wall, min(radius + _TO_WALL, gap - 0.005)))
        surroundings = self._surroundings
        paved = not on_road and not surroundings.on_road(x, y)
        return Scene(x, y, discs, boxes, walls, SIGHT, surroundings.on_road if paved else None)

    def _look_about(self, seconds: float) -> float:
        """Return a direction that changes every two seconds."""
        return float(self._draw(seconds, 2.0) % 121) - 60.0

    def _look_both_ways(self, seconds: float) -> float:
        """Return left, right and ahead in turn, degrees to the left."""
        return (60.0, -60.0, 0.0)[math.floor(seconds / 1.2) % 3]

    def _look_at(self, own: PedestrianAgent, other: PedestrianAgent | None, seconds: float) -> float:
        """Return the direction to a companion from time to time, else ahead, degrees to the left."""
        if other is None or self._draw(seconds, 3.0) % 3:
            return 0.0
        hx, hy = own.heading
        return 40.0 if hx * (other.y - own.y) - hy * (other.x - own.x) > 0.0 else -40.0

    def _draw(self, seconds: float, period: float) -> int:
        """Return a number that depends on the pedestrian and the time."""
        return (self._seed * 31 + math.floor(seconds / period) * 40_503) % 65_521


def _distance(a: Agent, b: Agent) -> float:
    dx, dy = a.x - b.x, a.y - b.y
    return math.sqrt(dx * dx + dy * dy)
