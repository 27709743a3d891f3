"""Protocols of other agents: the attributes that drivers read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeGuard

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.simulation.path import Path

if TYPE_CHECKING:
    from recipe_runtime.simulation.traffic.driver import Driver


class Body(Protocol):
    """A pedestrian or a vehicle."""

    @property
    def actor(self) -> ActorPlan:
        """Its plan."""

    @property
    def x(self) -> float:
        """Position of its middle in the world frame, metres."""

    @property
    def y(self) -> float:
        """Position of its middle in the world frame, metres."""

    @property
    def heading(self) -> tuple[float, float]:
        """Unit vector forwards."""

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity in the world frame, m/s."""

    @property
    def speed(self) -> float:
        """Velocity along its heading, m/s."""

    @property
    def radius(self) -> float:
        """Half its width, metres."""

    @property
    def reach(self) -> float:
        """Half its length, metres."""

    @property
    def present(self) -> bool:
        """Whether it is in the scene."""


class Vehicle(Body, Protocol):
    """A vehicle with a driver."""

    @property
    def path(self) -> Path:
        """The path that it follows."""

    @property
    def progress(self) -> float:
        """Arc length of its middle on its path, metres."""

    @property
    def offset(self) -> float:
        """Metres to the left of its path."""

    @property
    def halted(self) -> bool:
        """Whether it is stopped because of a collision."""

    @property
    def driver(self) -> Driver:
        """Its driver."""


def is_vehicle(body: object) -> TypeGuard[Vehicle]:
    """Return whether a body has a driver; pedestrians and props have none."""
    return getattr(body, "driver", None) is not None
