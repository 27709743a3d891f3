"""Pedestrian agents: bodies that walk as `walking.walker` decides, and follow the ground."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.body import walk_cycle
from recipe_runtime.body.kinematics import PartPose, Quaternion
from recipe_runtime.body.skeleton import Figure
from recipe_runtime.simulation.agent import STANDSTILL, Agent, move_towards
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.walking.surroundings import Surroundings
from recipe_runtime.simulation.walking.walker import Walker, Wish

_MASS = 75.0  # kg
_ACCELERATION, _STEP_RATE = 3.4, 0.9  # m/s2, m/s up and down kerbs
_TURN_STANDING, _TURN_WALKING, _TURN_ACCELERATION = 3.0, 2.05, 20.0  # rad/s at rest and at `_WALKING` m/s; rad/s2
_WALKING, _TURNING, _TURN_GAIN = 0.8, 2.9, 4.0  # m/s; m/s2 across in a bend; 1/s
_SIDESTEP, _SMALL_STEPS, _FACES = 0.35, 0.3, 0.15  # m/s: aside, in any direction, and from where it turns to face
_KNOCKED = 2.0  # m/s, the change of its speed that makes a pedestrian stop
_SIGHT, _SIGHT_AT_ROADS = 10.0, 60.0  # metres


class PedestrianAgent(Agent):
    """A pedestrian.

    Attributes:
        look: Degrees to the left of its heading where it wants to look.
        pace: The speed that it wants now, m/s.
        crossing: The way over a road, from kerb to kerb (x, y, x, y, metres), that it is on, or is about to enter with
            the right of way.
        follower: The pedestrian who walks beside it.
    """

    def __init__(self, world: World, actor: ActorPlan, control_dt: float, surroundings: Surroundings) -> None:
        radius = 0.13 * actor.shape["height"]
        super().__init__(world, actor, world.add_pedestrian(actor, radius, _MASS), control_dt)
        self.look = self.pace = 0.0
        self.crossing: tuple[float, float, float, float] | None = None
        self.follower: PedestrianAgent | None = None
        self._walker, self._wish = Walker(actor, surroundings), Wish()
        self.sight = _SIGHT
        self.z = world.ground.height(self.x, self.y)
        self._figure = Figure.of(actor.shape)
        self._phase = zlib.crc32(actor.name.encode()) / 2.0**32
        self._pace = 0.0
        self._pose_cache: tuple[float, float, Sequence[Quaternion]] = (-1.0, 0.0, ())  # phase, pace, joint rotations

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
        """Walk beside another pedestrian from now on."""
        self._walker.leader, leader.follower = leader, self

    def decide(self, others: Sequence[Agent], seconds: float) -> None:
        """Choose direction and speed: along the route, across roads when it may, round others."""
        stands = self.held or seconds < self._stands_until
        self._wish = self._walker.decide(self, others, seconds, stands=stands)
        self.waiting, self.crossing, self.look = self._wish.waits, self._wish.crossing, self._wish.look
        self.pace = self._wish.speed
        self.sight = _SIGHT_AT_ROADS if self._walker.near_road else _SIGHT

    def control(self) -> None:
        """Accelerate and turn as far as legs can.

        It walks the way that it faces. Steps aside, and in any direction where it is nearly there, are slow.
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

    def _follow(self, dx: float, dy: float, seconds: float) -> bool:
        """Advance the walk cycle by the distance covered, and follow the ground."""
        distance = math.sqrt(dx * dx + dy * dy)
        self._pace = math.sqrt(self.velocity[0] * self.velocity[0] + self.velocity[1] * self.velocity[1])
        self._phase += distance / walk_cycle.stride_length(self._figure, self._pace)
        z = move_towards(self.z, self._world.ground.height(self.x, self.y), _STEP_RATE * seconds)
        self.vertical_speed, self.z = (z - self.z) / seconds, z
        return distance == 0.0 and self.vertical_speed == 0.0

    def _base_pose(self) -> PartPose:
        """Return the pose of the base, at the height where the lower sole touches the ground."""
        return (self.x, self.y, self.z - walk_cycle.lowest_sole(self._figure, self._joint_rotations())), self._yaw()

    def _joint_rotations(self) -> Sequence[Quaternion]:
        if self._pose_cache[:2] != (self._phase, self._pace):
            self._pose_cache = self._phase, self._pace, walk_cycle.pose(self._figure, self._phase, self._pace)
        return self._pose_cache[2]
