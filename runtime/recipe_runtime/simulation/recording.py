"""The state of all agents as a frame of a Trace."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import RunError

from recipe_runtime.body.poses import Components3, Components4, Poses, SkeletonGroup
from recipe_runtime.body.skeleton import Figure, joints_of
from recipe_runtime.body.walk_cycle import Walkers
from recipe_runtime.body.wheels import Cars
from recipe_runtime.core.trace import METRE, UNIT, frame_bytes
from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.pedestrian import PedestrianAgent
from recipe_runtime.simulation.terrain import Ground
from recipe_runtime.simulation.vehicle import TwoWheeler, VehicleAgent


class FrameRecorder:
    """Computes the poses of all agents of a scene, those of one kind at once, and makes frames of them."""

    def __init__(self, agents: Sequence[Agent], ground: Ground) -> None:
        """Group the agents of a scene.

        Args:
            agents: In plan order.
            ground: On which they move.
        """
        self._height = ground.height
        skeletons = [joints_of(agent.actor.shape) for agent in agents]
        self._starts = np.cumsum([0, *(1 + len(joints) for joints in skeletons)])
        self._people = [k for k, agent in enumerate(agents) if isinstance(agent, PedestrianAgent)]
        self._cars = [k for k, agent in enumerate(agents) if isinstance(agent, VehicleAgent)]
        self._cars = [k for k in self._cars if not isinstance(agents[k], TwoWheeler)]
        riders = [k for k, agent in enumerate(agents) if isinstance(agent, TwoWheeler)]
        self._riders = []
        for count in sorted({len(skeletons[k]) for k in riders}):  # bicycles have cranks
            group = [k for k in riders if len(skeletons[k]) == count]
            self._riders.append((group, SkeletonGroup([skeletons[k] for k in group])))
        shapes = [agent.actor.shape for agent in agents]
        self._walkers = Walkers([Figure.of(shapes[k]) for k in self._people]) if self._people else None
        self._wheels = Cars([shapes[k] for k in self._cars]) if self._cars else None

    def record(self, agents: Sequence[Agent]) -> bytes:
        """Return the state of the agents as the bytes of a Trace frame.

        A rotation corresponds to two quaternions; the one whose w is positive is stored. If w is 0, the last component
        that is not 0 is positive.

        Args:
            agents: Those of the scene, in plan order.
        """
        positions, rotations = np.empty((self._starts[-1], 3)), np.empty((self._starts[-1], 4))
        for group, poses in self._poses(agents):
            starts = self._starts[group]
            rows = starts + np.arange(poses.positions.shape[1])[:, None]
            positions[rows], rotations[rows] = poses.positions.transpose(1, 2, 0), poses.rotations.transpose(1, 2, 0)
        velocities = [agent.velocities() for agent in agents]
        snapped = snap(rotations, UNIT)
        key = np.zeros(snapped.shape[:-1], np.int64)
        for axis in (0, 1, 2, 3):  # the sign of w, or of the last component before it that is not 0
            key = np.where(snapped[..., axis] != 0, snapped[..., axis], key)
        return frame_bytes(
            positions=snap(positions, METRE),
            rotations=np.where(key[..., None] < 0, -snapped, snapped).astype(np.int32),
            linear=snap(_rows([linear for linear, _ in velocities], 3), METRE),
            angular=snap(_rows([angular for _, angular in velocities], 3), METRE),
        )

    def _poses(self, agents: Sequence[Agent]) -> Iterator[tuple[Sequence[int], Poses]]:
        """Yield groups of agents, by their numbers, and the poses of their parts."""
        if self._walkers is not None:
            people = [agent for agent in (agents[k] for k in self._people) if isinstance(agent, PedestrianAgent)]
            yield self._people, self._walkers.pose([person.walk_row() for person in people], self._height)
        if self._wheels is not None:
            cars = [agent for agent in (agents[k] for k in self._cars) if isinstance(agent, VehicleAgent)]
            rolled, curvature = np.array([(car.rolled, car.curvature) for car in cars]).T
            yield self._cars, self._wheels.pose(*_bases(cars), rolled, curvature)
        for group, skeletons in self._riders:
            riders = [agent for agent in (agents[k] for k in group) if isinstance(agent, TwoWheeler)]
            joints = np.array([rider.joint_rotations() for rider in riders]).transpose(2, 1, 0)
            yield group, skeletons.forward_kinematics(*_bases(riders), joints)


def _bases(vehicles: Sequence[VehicleAgent]) -> tuple[Components3, Components4]:
    x, y, z, a, b, c, w = np.array([(*place, *turn) for place, turn in (v.base_pose() for v in vehicles)]).T
    return (x, y, z), (a, b, c, w)


def _rows(values: Sequence[Sequence[float]], width: int) -> NDArray[np.float64]:
    return np.array(values, np.float64).reshape(-1, width)


def snap(values: NDArray[np.float64], grid: int) -> NDArray[np.int64]:
    """Return values in units of 1/grid, rounded to the nearest.

    Raises:
        RunError: A value is not finite.
    """
    if not np.isfinite(values).all():
        raise RunError(
            "the simulation diverged: a position or velocity is not a finite number; separate overlapping bodies"
        )
    return np.floor(values * grid + 0.5).astype(np.int64)
