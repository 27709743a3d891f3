"""Pedestrian agents: they walk to their goals, avoid other agents, wait for vehicles and follow the ground."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.body import walk_cycle
from recipe_runtime.body.kinematics import PartPose, Quaternion
from recipe_runtime.body.skeleton import Figure, is_person
from recipe_runtime.simulation.agent import STANDSTILL, Agent, move_towards
from recipe_runtime.simulation.bullet import World

_MASS = 75.0  # kg
_WALK_ACCELERATION, _TURN_RATE, _STEP_RATE = 3.5, 6.0, 0.9  # m/s2, rad/s, m/s up and down kerbs
_TURN_ACCELERATION = 40.0  # rad/s2
_KNOCKED = 2.0  # m/s, the change of its speed that makes a pedestrian stop
_SIDESTEP, _ROOM, _FORESIGHT = 0.55, 0.78, 2.5  # m/s, metres between two walkers' middles, seconds


class PedestrianAgent(Agent):
    """A pedestrian."""

    def __init__(self, world: World, actor: ActorPlan, control_dt: float) -> None:
        radius = 0.13 * actor.shape["height"]
        super().__init__(world, actor, world.add_pedestrian(actor, radius, _MASS), control_dt)
        self._route = [(point.x, point.y) for point in actor.route]
        self._next = 0
        self.z = world.ground.height(self.x, self.y)
        self._figure = Figure.of(actor.shape)
        self._phase = zlib.crc32(actor.name.encode()) / 2.0**32
        self._desired = (0.0, 0.0)
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
            self._desired = (0.0, 0.0)

    def decide(self, others: Sequence[Agent], seconds: float) -> None:
        """Walk towards the next waypoint, slow down before the goal, and step aside to avoid others."""
        wish = self._velocity_to_goal()
        if wish == (0.0, 0.0) or self.held or seconds < self._stands_until:
            wish = (0.0, 0.0)
            self._desired = wish
            return
        if self._must_wait(wish, others):
            self._desired = (0.0, 0.0)
            return
        speed = math.sqrt(wish[0] * wish[0] + wish[1] * wish[1])
        ahead = (wish[0] / speed, wish[1] / speed)
        aside, slow = 0.0, 1.0
        for other in others:
            step, pace = self._avoid(other, ahead, speed)
            aside = step if abs(step) > abs(aside) else aside
            slow = min(slow, pace)
        right = (ahead[1], -ahead[0])
        self._desired = (slow * wish[0] + aside * right[0], slow * wish[1] + aside * right[1])

    def _must_wait(self, wish: tuple[float, float], others: Sequence[Agent]) -> bool:
        """Return whether it stands on a sidewalk and would walk into the path of a moving vehicle."""
        if self._world.ground.height(self.x, self.y) < 0.1:
            return False
        for other in others:
            dx, dy = self.x - other.x, self.y - other.y
            if is_person(other.actor.shape) or abs(dx) > 30.0 or abs(dy) > 30.0 or not other.moving:
                continue
            hx, hy = other.heading
            for k in range(1, 6):
                t = 0.5 * k
                px, py = dx + (wish[0] - other.velocity[0]) * t, dy + (wish[1] - other.velocity[1]) * t
                if abs(px * hx + py * hy) < other.reach + 0.8 and abs(py * hx - px * hy) < other.radius + 0.5:
                    return True
        return False

    def _velocity_to_goal(self) -> tuple[float, float]:
        """Return the velocity towards the next waypoint, in m/s, after skipping waypoints that have been reached."""
        while self._next < len(self._route):
            dx, dy = self._route[self._next][0] - self.x, self._route[self._next][1] - self.y
            distance = math.sqrt(dx * dx + dy * dy)
            last = self._next == len(self._route) - 1
            if distance > (0.02 if last else 0.5):
                speed = self.actor.speed
                if last:
                    speed = min(speed, 2.5 * distance, math.sqrt(2.0 * 1.8 * distance))
                return dx / distance * speed, dy / distance * speed
            self._next += 1
        return 0.0, 0.0

    def _avoid(self, other: Agent, ahead: tuple[float, float], speed: float) -> tuple[float, float]:
        """Return the lateral speed to the right in m/s (negative: to the left), and a factor for the speed."""
        dx, dy = other.x - self.x, other.y - self.y
        if abs(dx) > 12.0 or abs(dy) > 12.0:
            return 0.0, 1.0
        gap = dx * ahead[0] + dy * ahead[1]
        side = dx * ahead[1] - dy * ahead[0]  # lateral offset, positive to the right
        ux, uy = ahead[0] * speed - other.velocity[0], ahead[1] * speed - other.velocity[1]
        closing = ux * ahead[0] + uy * ahead[1]
        room = _ROOM + other.radius - 0.23
        if gap < -0.3 or closing < 0.05 or gap > max(2.5, _FORESIGHT * closing):
            return 0.0, 1.0
        time = max(gap, 0.0) / closing
        miss = side - (ux * ahead[1] - uy * ahead[0]) * time
        if abs(miss) >= room:
            return 0.0, 1.0
        left = miss > 0.12 and is_person(other.actor.shape)
        need = (room - abs(miss)) * (0.5 if is_person(other.actor.shape) else 1.0)
        step = min(_SIDESTEP, need / max(time - 0.3, 0.35))
        near = gap < 0.7 and abs(side) < 0.45
        return (-step if left else step), (0.35 if near else 1.0)

    def control(self) -> None:
        """Accelerate and turn as far as legs can, and face the way that it goes."""
        max_change = _WALK_ACCELERATION * self._dt
        dx, dy = self._desired[0] - self.velocity[0], self._desired[1] - self.velocity[1]
        size = math.sqrt(dx * dx + dy * dy)
        part = 1.0 if size <= max_change else max_change / size
        vx, vy = self.velocity[0] + part * dx, self.velocity[1] + part * dy
        speed = math.sqrt(vx * vx + vy * vy)
        turn = 0.0
        if speed > 0.15:
            sine = (self.heading[0] * vy - self.heading[1] * vx) / speed
            cosine = (self.heading[0] * vx + self.heading[1] * vy) / speed
            turn = 7.0 * (sine if cosine > 0 else (1.0 if sine >= 0 else -1.0))
            turn = max(-_TURN_RATE, min(_TURN_RATE, turn))
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
