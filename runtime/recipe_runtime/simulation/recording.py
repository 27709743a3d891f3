"""The state of all agents as a frame of a Trace."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import RunError

from recipe_runtime.core.trace import METRE, UNIT, frame_bytes

if TYPE_CHECKING:
    from recipe_runtime.simulation.agent import Agent


def record_frame(agents: Sequence[Agent]) -> bytes:
    """Return the current state as the bytes of a Trace frame.

    A rotation corresponds to two quaternions; the one whose w is positive is stored. If w is 0, the last component
    that is not 0 is positive.
    """
    poses = [pose for agent in agents for pose in agent.parts()]
    velocities = [agent.velocities() for agent in agents]
    rotations = snap(_rows([rotation for _, rotation in poses], 4), UNIT)
    key = np.zeros(rotations.shape[:-1], np.int64)
    for axis in (0, 1, 2, 3):  # the sign of w, or of the last component before it that is not 0
        key = np.where(rotations[..., axis] != 0, rotations[..., axis], key)
    return frame_bytes(
        positions=snap(_rows([position for position, _ in poses], 3), METRE),
        rotations=np.where(key[..., None] < 0, -rotations, rotations).astype(np.int32),
        linear=snap(_rows([linear for linear, _ in velocities], 3), METRE),
        angular=snap(_rows([angular for _, angular in velocities], 3), METRE),
    )


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
