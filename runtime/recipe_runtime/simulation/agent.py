"""The base class of agents: a body in the world, a route, and the steps of its control loop.

An agent chooses its motion thirty times a second, from the state of all agents, and sets the velocity of its base
before every physics step. Only plain arithmetic and `sqrt` are used; cross products replace angles where possible.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.body.kinematics import PartPose, Quaternion, forward_kinematics
from recipe_runtime.body.skeleton import is_person, joints_of
from recipe_runtime.simulation.bullet import World


def move_towards(value: float, target: float, max_change: float) -> float:
    """Return the value, moved towards the target by at most `max_change`."""
    return value + max(-max_change, min(max_change, target - value))


class Agent(ABC):
    """An actor's body in the world, and its control."""

    def __init__(self, world: World, actor: ActorPlan, body: int, dt: float) -> None:
        self.actor, self.body = actor, body
        self._joints = joints_of(actor.shape)
        self._world, self._dt = world, dt
        self._route = [(point.x, point.y) for point in actor.route]
        self._next = 0
        self.x = self.y = self.z = 0.0
        self.heading = (1.0, 0.0)
        self.velocity = (0.0, 0.0)
        self.waiting = False  # at a stop line, for the right of way
        self._tilt: tuple[float, float] = (0.0, 0.0)
        self.read_state()

    def read_state(self) -> None:
        """Read position, heading and velocity of the base from the world."""
        (self.x, self.y, self.z), (qx, qy, qz, qw) = self._world.base(self.body)
        hx, hy = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qz * qw)
        length = math.sqrt(hx * hx + hy * hy)
        self.heading = (hx / length, hy / length)
        self._tilt = (2.0 * (qx * qz + qy * qw), 2.0 * (qy * qz - qx * qw))  # horizontal components of its z axis
        (vx, vy, _), _ = self._world.velocity(self.body)
        self.velocity = (vx, vy)

    @property
    def moving(self) -> bool:
        """Whether the agent is faster than 1 m/s."""
        return self.velocity[0] * self.velocity[0] + self.velocity[1] * self.velocity[1] > 1.0

    @property
    def radius(self) -> float:
        """Half the body's width, metres."""
        return 0.13 * self.actor.shape["height"] if is_person(self.actor.shape) else self.actor.shape["width"] / 2

    @property
    def reach(self) -> float:
        """Half the body's length, metres."""
        return self.radius if is_person(self.actor.shape) else self.actor.shape["length"] / 2

    def parts(self) -> list[PartPose]:
        """Position and orientation of every part, the base first."""
        return forward_kinematics(self._base_pose(), self._joints, self._joint_rotations())

    def _base_pose(self) -> PartPose:
        """Position and orientation of the base part."""
        return self._world.base(self.body)

    @abstractmethod
    def _joint_rotations(self) -> Sequence[Quaternion]:
        """Return the rotations of the joints, in their order."""

    @abstractmethod
    def choose_motion(self, others: Sequence[Agent]) -> None:
        """Choose the desired motion, from the state of the other agents."""

    @abstractmethod
    def apply_velocity(self) -> None:
        """Set the velocity of the base for the next step."""

    @abstractmethod
    def update_distance(self) -> None:
        """Add the distance covered in the last step."""
