"""What all actors have: a body in the world, a route, and the others to look out for.

An actor decides thirty times a second, from where everyone is, and acts at every step by giving its base a velocity.
Plain arithmetic and `sqrt` only; no angle is measured where a cross product will do.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.body.kinematics import Placed, Quaternion, place
from recipe_runtime.body.skeleton import is_person, joints_of
from recipe_runtime.simulation.bullet import World


def towards(value: float, target: float, most: float) -> float:
    """The value, moved towards the target by at most so much."""
    return value + max(-most, min(most, target - value))


class Mover(ABC):
    """An actor's body in the world, and what drives it."""

    def __init__(self, world: World, actor: ActorPlan, body: int, dt: float) -> None:
        self.actor, self.body = actor, body
        self._joints = joints_of(actor.shape)
        self._world, self._dt = world, dt
        self._route = [(point.x, point.y) for point in actor.route]
        self._next = 0
        self.x = self.y = self.z = 0.0
        self.heading = (1.0, 0.0)
        self.velocity = (0.0, 0.0)
        self.waiting = False  # at a stop line, for its turn
        self._upright: tuple[float, float] = (0.0, 0.0)
        self.sense()

    def sense(self) -> None:
        """Read where the base is, which way it looks and how it moves."""
        (self.x, self.y, self.z), (qx, qy, qz, qw) = self._world.base(self.body)
        hx, hy = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qz * qw)
        length = math.sqrt(hx * hx + hy * hy)
        self.heading = (hx / length, hy / length)
        self._upright = (2.0 * (qx * qz + qy * qw), 2.0 * (qy * qz - qx * qw))  # where its z axis leans to
        (vx, vy, _), _ = self._world.velocity(self.body)
        self.velocity = (vx, vy)

    @property
    def moving(self) -> bool:
        """Whether it goes faster than 1 m/s."""
        return self.velocity[0] * self.velocity[0] + self.velocity[1] * self.velocity[1] > 1.0

    @property
    def radius(self) -> float:
        """Half its width, metres."""
        return 0.13 * self.actor.shape["height"] if is_person(self.actor.shape) else self.actor.shape["width"] / 2

    @property
    def reach(self) -> float:
        """Half its length, metres."""
        return self.radius if is_person(self.actor.shape) else self.actor.shape["length"] / 2

    def parts(self) -> list[Placed]:
        """Position and orientation of every part, the base first."""
        return place(self._stance(), self._joints, self._turns())

    def _stance(self) -> Placed:
        """Position and orientation of the base part."""
        return self._world.base(self.body)

    @abstractmethod
    def _turns(self) -> Sequence[Quaternion]:
        """How the joints are turned now."""

    @abstractmethod
    def decide(self, others: Sequence[Mover]) -> None:
        """Choose what to do, from where the others are."""

    @abstractmethod
    def act(self) -> None:
        """Give the base its velocity for the next step."""

    @abstractmethod
    def advance(self) -> None:
        """Count the distance covered in the last step."""
