"""Pedestrian agents: bodies that walk as `walking.walker` decides, and follow the ground."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.body import walk_cycle
from recipe_runtime.body.footsteps import Footsteps
from recipe_runtime.body.gait import Gait
from recipe_runtime.body.skeleton import Figure
from recipe_runtime.body.walk_cycle import HEAD_TURN
from recipe_runtime.simulation.agent import STANDSTILL, Agent, move_towards
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.walking.surroundings import Surroundings
from recipe_runtime.simulation.walking.walker import Walker, Wish

_MASS = 75.0  # kg
_ACCELERATION = 3.4  # m/s2
_TURN_STANDING, _TURN_WALKING, _TURN_ACCELERATION = 3.0, 2.05, 20.0  # rad/s at rest and at `_WALKING` m/s; rad/s2
_WALKING, _TURNING, _TURN_GAIN = 0.8, 2.9, 4.0  # m/s; m/s2 across in a bend; 1/s
_SIDESTEP, _SMALL_STEPS, _FACES = 0.35, 0.3, 0.15  # m/s: aside, in any direction, and from where it turns to face
_KNOCKED = 2.0  # m/s, the change of its speed that makes a pedestrian stop
_SIGHT, _SIGHT_AT_ROADS = 10.0, 60.0  # metres


class PedestrianAgent(Agent):
    """A pedestrian.

    Attributes:
        figure: Its proportions.
        look: Desired direction of view, degrees to the left of its heading.
        pace: Desired speed, m/s.
        aim: The direction in which it would walk if nobody were in its way, a unit vector; None if it stands.
        crossing: The segment across a road, from kerb to kerb (x, y, x, y, metres), that it is on, or is about to enter
            with the right of way.
        follower: The companion that walks alongside and follows it.
    """

    def __init__(self, world: World, actor: ActorPlan, control_dt: float, surroundings: Surroundings) -> None:
        radius = 0.13 * actor.shape["height"]
        super().__init__(world, actor, world.add_pedestrian(actor, radius, _MASS), control_dt)
        self.look = self.pace = 0.0
        self.aim: tuple[float, float] | None = None
        self.crossing: tuple[float, float, float, float] | None = None
        self.follower: PedestrianAgent | None = None
        self._walker, self._wish = Walker(actor, surroundings), Wish()
        self.sight = _SIGHT
        self.figure = Figure.of(actor.shape)
        self._footsteps = self._steady_footsteps()
        self.z, self._head_yaw = self._footsteps.height, 0.0

    @property
    def mass(self) -> float:
        """Kilograms."""
        return _MASS

    def collide(self, other: Agent | None, impulse: float, seconds: float) -> None:
        """Stop after a hard collision."""
        if impulse / _MASS > _KNOCKED:
            self.stand_still(seconds + STANDSTILL)
            self._wish = Wish()

    def walk_beside(self, leader: PedestrianAgent) -> None:
        """Accompany another pedestrian from now on."""
        self._walker.leader, leader.follower = leader, self

    def decide(self, others: Sequence[Agent], seconds: float) -> None:
        """Choose direction and speed: along the route, across roads when permitted, around others."""
        stands = self.held or seconds < self._stands_until or self.figure.sits
        self._wish = self._walker.decide(self, others, seconds, stands=stands)
        self.waiting, self.crossing, self.look = self._wish.waits, self._wish.crossing, self._wish.look
        self.pace, self.aim = self._wish.speed, self._wish.aim
        self.sight = _SIGHT_AT_ROADS if self._walker.near_road else _SIGHT

    def control(self) -> None:
        """Accelerate and turn within the limits of a person.

        It walks in the direction that it faces. Sidesteps are slow, and so are steps in any direction near the goal.
        """
        wish, (hx, hy), (vx, vy) = self._wish, self.heading, self.velocity
        sine, cosine = hx * wish.uy - hy * wish.ux, hx * wish.ux + hy * wish.uy
        if wish.speed <= _SMALL_STEPS:
            wx, wy = wish.speed * wish.ux, wish.speed * wish.uy
        else:
            ahead = wish.speed * max(0.0, cosine)
            aside = max(-_SIDESTEP, min(_SIDESTEP, wish.speed * sine))
            wx, wy = ahead * hx - aside * hy, ahead * hy + aside * hx
        dx, dy = wx - vx, wy - vy
        size, most = math.sqrt(dx * dx + dy * dy), _ACCELERATION * self._dt
        part = 1.0 if size <= most else most / size
        vx, vy = vx + part * dx, vy + part * dy
        turn = 0.0
        if wish.speed > _FACES:
            fastest = _TURN_STANDING - (_TURN_STANDING - _TURN_WALKING) * min(1.0, abs(self.speed) / _WALKING)
            fastest = min(fastest, _TURNING / max(abs(self.speed), 0.5))
            turn = _TURN_GAIN * sine if cosine > 0.0 else (fastest if sine >= 0.0 else -fastest)
            turn = max(-fastest, min(fastest, turn))
        turn = move_towards(self.yaw_rate, turn, _TURN_ACCELERATION * self._dt)
        if (vx, vy) != self.velocity or turn != self.yaw_rate:
            self._world.set_velocity(self.body, vx, vy, turn)

    def start_moving(self) -> None:
        """Release a held pedestrian, in mid-stride."""
        super().start_moving()
        self._footsteps = self._steady_footsteps()

    def _steady_footsteps(self) -> Footsteps:
        phase = zlib.crc32(self.actor.name.encode()) / 2.0**32
        place, ground = (self.x, self.y), self._world.ground.height
        return Footsteps.steady(Gait(self.figure), phase, self.speed, place, self.heading, ground)

    def read(self, seconds: float) -> None:
        """Read the state of the body from the engine, and turn the head."""
        if self._head_yaw != max(-HEAD_TURN, min(HEAD_TURN, self.look)):
            self._at_rest = False
        super().read(seconds)

    def _follow(self, dx: float, dy: float, seconds: float) -> bool:
        """Move the feet with the body, and follow the ground on which they stand."""
        feet, head = self._footsteps, self._head_yaw
        self._footsteps = feet.moved(
            (self.x, self.y), self.heading, self.velocity, self.yaw_rate, seconds, self._world.ground.height
        )
        self._head_yaw = walk_cycle.turn_head(head, self.look, seconds)
        self.vertical_speed, self.z = (self._footsteps.height - self.z) / seconds, self._footsteps.height
        return self._footsteps is feet and self._head_yaw == head

    def pose_row(self) -> Sequence[float]:
        """Return the state from which its pose is computed."""
        return walk_cycle.row(self._footsteps, (self.x, self.y), self.heading, self._head_yaw)
