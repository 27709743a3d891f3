"""The base class of agents: a body in the world, a route, and the steps of its control loop.

An agent decides ten times a second, from the state of the agents near it, on its desired motion. Thirty times a second
it reads the state of its body back from the engine and changes the velocity by at most what its legs, or its engine,
brakes and tyres, can achieve in that time; so the effect of a collision persists. Only plain arithmetic and `sqrt` are
used; cross products replace angles where possible.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

from recipe_compiler.ir.plan import ActorPlan, Pose

from recipe_runtime.body.kinematics import Quaternion, Vector
from recipe_runtime.body.skeleton import is_person
from recipe_runtime.simulation.bullet import World, orientation

STANDSTILL = 8.0  # seconds for which an agent stops after a hard collision


def move_towards(value: float, target: float, max_change: float) -> float:
    """Return the value, moved towards the target by at most `max_change`."""
    if abs(target - value) <= max_change:
        return target
    return value + max_change if target > value else value - max_change


class Agent(ABC):
    """An actor's body in the world, and its control.

    Attributes:
        x, y: Position of its origin, metres in the world frame.
        z: Height of its origin.
        heading: Unit vector.
        velocity: m/s in the world frame, as the engine has it.
        speed: Along its heading, m/s.
        yaw_rate: rad/s.
        waiting: Whether it waits at a stop line.
        held: Whether it waits for frame 0.
        present: Whether it is in the scene; if not, its body lies far below the ground.
        radius: Half its width, metres.
        reach: Half its length, metres.
        sight: Metres within which it sees other agents.
    """

    sight = 40.0

    def __init__(self, world: World, actor: ActorPlan, body: int, control_dt: float) -> None:
        self.actor, self.body = actor, body
        self._world, self._dt = world, control_dt
        self.waiting, self.present = False, True
        self.held = actor.held
        self.z = self.vertical_speed = 0.0
        self._stands_until = -math.inf
        self._at_rest = False
        self.x, self.y, hx, hy, vx, vy, self.yaw_rate = world.state(body)
        self.heading, self.velocity = (hx, hy), (vx, vy)
        self.speed = vx * hx + vy * hy
        shape, person = actor.shape, is_person(actor.shape)
        self.radius = 0.13 * shape["height"] if person else shape["width"] / 2
        self.reach = self.radius if person else shape["length"] / 2

    def read(self, seconds: float) -> None:
        """Read the state of the body from the engine, and update what follows from it.

        It rebinds attributes and mutates nothing, so that a shallow copy of an agent may read without changing it.

        Args:
            seconds: Time since the last call.
        """
        if not self.present:
            return
        before = self.x, self.y, self.heading
        x, y, hx, hy, vx, vy, self.yaw_rate = self._world.state(self.body)
        self.velocity, self.speed = (vx, vy), vx * hx + vy * hy
        if before == (x, y, (hx, hy)) and self._at_rest:
            return
        self.x, self.y, self.heading = x, y, (hx, hy)
        self._at_rest = self._follow(x - before[0], y - before[1], seconds)

    @property
    def moving(self) -> bool:
        """Whether the agent is faster than 1 m/s."""
        return self.velocity[0] * self.velocity[0] + self.velocity[1] * self.velocity[1] > 1.0

    def start_moving(self) -> None:
        """Release a held agent, at its speed if it has a route."""
        self.held = False
        self.speed = self.actor.speed if self.actor.route else 0.0
        self.velocity = (self.speed * self.heading[0], self.speed * self.heading[1])
        self._world.set_velocity(self.body, *self.velocity, 0.0)

    def leave(self) -> None:
        """Remove the body from the scene."""
        self.present = self.waiting = False
        self.x, self.y, self.z = self._world.remove(self.body)
        self.heading, self.velocity = (1.0, 0.0), (0.0, 0.0)
        self.speed = self.yaw_rate = self.vertical_speed = 0.0

    def enter(self, pose: Pose, speed: float) -> None:
        """Return the body to the scene, moving along its heading at a speed in m/s."""
        self._world.place(self.body, pose.x, pose.y, orientation(Pose(yaw=pose.yaw)))
        self.present = True
        self.x, self.y, hx, hy, _, _, self.yaw_rate = self._world.state(self.body)
        self.heading, self.velocity, self.speed = (hx, hy), (speed * hx, speed * hy), speed
        self._world.set_velocity(self.body, *self.velocity, 0.0)

    def stand_still(self, until: float) -> None:
        """Stop until a time (seconds since frame 0), as after a collision."""
        self._stands_until = until

    def velocities(self) -> tuple[Vector, Vector]:
        """Linear and angular velocity of the base, m/s and rad/s in the world frame."""
        return (*self.velocity, self.vertical_speed), (0.0, 0.0, self.yaw_rate)

    def _yaw(self) -> Quaternion:
        """The rotation about the vertical that corresponds to its heading."""
        hx, hy = self.heading
        cosine = math.sqrt(max(0.0, 0.5 * (1.0 + hx)))
        if cosine > 0.1:
            return 0.0, 0.0, hy / (2.0 * cosine), cosine
        sine = math.sqrt(0.5 * (1.0 - hx))
        return 0.0, 0.0, sine, hy / (2.0 * sine)

    @abstractmethod
    def pose_row(self) -> Sequence[float]:
        """Return the state from which the poses of its parts are computed, see `recording`."""

    @property
    @abstractmethod
    def mass(self) -> float:
        """Kilograms."""

    @abstractmethod
    def collide(self, other: Agent | None, impulse: float, seconds: float) -> None:
        """React to a collision.

        Args:
            other: The other agent; None for an obstacle.
            impulse: N s.
            seconds: Time since frame 0.
        """

    @abstractmethod
    def decide(self, others: Sequence[Agent], seconds: float) -> None:
        """Choose the desired motion from the state of the other agents in sight.

        Args:
            others: Those in sight.
            seconds: Time since frame 0.
        """

    @abstractmethod
    def control(self) -> None:
        """Change the velocity of the body towards the desired motion, by what is possible until the next call."""

    @abstractmethod
    def _follow(self, dx: float, dy: float, seconds: float) -> bool:
        """Update height and joints after a displacement (metres) that took some seconds.

        Returns:
            Whether another call without a displacement would change nothing.
        """
