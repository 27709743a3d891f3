"""The state of all agents as frames of a Trace."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import RunError

from recipe_runtime.body.poses import Poses
from recipe_runtime.body.riding import Riders
from recipe_runtime.body.skeleton import Bike, Figure, has_rider, is_person, joints_of
from recipe_runtime.body.walk_cycle import Walkers
from recipe_runtime.body.wheels import Cars
from recipe_runtime.core.trace import METRE, UNIT, frame_bytes
from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.terrain import Ground

_ROWS = 1024  # poses of actors that are computed at once: enough that numpy's cost of a call counts little

Rows = Sequence[Sequence[Sequence[float]]]  # for each frame the state of each actor


class FrameRecorder:
    """Computes frames of a Trace.

    The poses of all agents of a kind are computed for several frames at once. Their bits do not depend on the number of
    frames.
    """

    def __init__(self, agents: Sequence[Agent], ground: Ground) -> None:
        """Group the agents of a scene.

        Args:
            agents: In plan order.
            ground: On which they move.
        """
        shapes = [agent.actor.shape for agent in agents]
        self._starts = np.cumsum([0, *(1 + len(joints_of(shape)) for shape in shapes)])
        self._groups: list[tuple[list[int], Callable[[Rows], Poses]]] = []  # numbers of agents, and their poses
        if people := [k for k, shape in enumerate(shapes) if is_person(shape)]:
            walkers = Walkers([Figure.of(shapes[k]) for k in people])
            self._groups.append((people, lambda rows: walkers.pose(rows, ground.height)))
        if cars := [k for k, shape in enumerate(shapes) if not is_person(shape) and not has_rider(shape)]:
            self._groups.append((cars, Cars([shapes[k] for k in cars]).pose))
        bikes = [(k, Bike.of(shape)) for k, shape in enumerate(shapes) if has_rider(shape)]
        for motor in (False, True):
            if alike := [(k, bike) for k, bike in bikes if bike.motor == motor]:
                self._groups.append(([k for k, _ in alike], Riders([bike for _, bike in alike]).pose))
        self._rows: list[list[Sequence[float]]] = []
        self._velocities: list[list[Sequence[Sequence[float]]]] = []
        self._made = 0
        self._most = max(1, _ROWS // max(1, len(agents)))

    @property
    def full(self) -> bool:
        """Whether `frames` should be called before another frame is added."""
        return len(self._rows) >= self._most

    def add(self, agents: Sequence[Agent]) -> None:
        """Add a frame with the state of the agents of the scene, in plan order."""
        self._rows.append([agent.pose_row() for agent in agents])
        self._velocities.append([agent.velocities() for agent in agents])

    def frames(self) -> Iterator[tuple[int, bytes]]:
        """Yield the frames that were added since the last call: frame number and bytes.

        A rotation corresponds to two quaternions; the one whose w is positive is stored. If w is 0, the last component
        that is not 0 is positive.
        """
        rows, self._rows = self._rows, []
        velocities = np.array(self._velocities, np.float64).reshape(len(rows), len(self._starts) - 1, 2, 3)
        self._velocities = []
        positions, rotations = np.empty((len(rows), self._starts[-1], 3)), np.empty((len(rows), self._starts[-1], 4))
        for group, pose in self._groups:
            poses = pose([[frame[k] for k in group] for frame in rows])
            parts = self._starts[group] + np.arange(poses.positions.shape[1])[:, None]
            positions[:, parts] = poses.positions.transpose(2, 1, 3, 0)
            rotations[:, parts] = poses.rotations.transpose(2, 1, 3, 0)
        snapped = snap(rotations, UNIT)
        key = np.zeros(snapped.shape[:-1], np.int64)
        for axis in (0, 1, 2, 3):  # the sign of w, or of the last component before it that is not 0
            key = np.where(snapped[..., axis] != 0, snapped[..., axis], key)
        turned = np.where(key[..., None] < 0, -snapped, snapped).astype(np.int32)
        places, speeds = snap(positions, METRE), snap(velocities, METRE)
        for place, turn, speed in zip(places, turned, speeds, strict=True):
            yield self._made, frame_bytes(positions=place, rotations=turn, linear=speed[:, 0], angular=speed[:, 1])
            self._made += 1


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
