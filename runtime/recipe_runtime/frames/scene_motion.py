"""Poses of everything that moves in a scene: the actors' parts, from the Trace, and the lamps of its traffic lights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import signals
from recipe_compiler.ir.plan import Element, ScenePlan

from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.core.transforms import Array, compose, from_pose, part_transforms

_FASTEST = 150.0  # m/s: an actor that is faster between two frames has left the scene or entered it
LAMP_RETREAT = 0.1  # metres by which a lens that is not lit lies behind its place, within the housing
_BACK = {"walk": (0.0, 1.0, 0.0), "dont_walk": (0.0, 1.0, 0.0)}  # the pedestrian signal faces -y, the others +x


class SceneMotion:
    """The transforms of a scene's moving parts, in the order of the renderer's bodies (`meshes.scene_bodies`)."""

    def __init__(self, scene: ScenePlan, trace: Trace) -> None:
        self._trace, self._fps = trace, scene.clock.fps
        self._signals = [element for element in scene.town.elements if element.kind == "traffic_light"]
        self._lamps = [_lamp_transforms(element) for element in self._signals]

    def parts(self, frame: int) -> Array:
        """Return the world-from-part transforms of a frame, [P, 3, 4]."""
        parts: Array = self.many(np.array([frame]))[0]
        return parts

    def many(self, frames: NDArray[np.intp]) -> Array:
        """Return the world-from-part transforms of several frames, [F, P, 3, 4]."""
        parts = part_transforms(self._trace, frames)
        if not self._signals:
            return parts
        lamps = np.stack([np.concatenate(self._lamps_at(int(frame))) for frame in frames])
        return np.concatenate([parts, lamps], axis=1)

    def neighbour(self, frame: int, other: int) -> Array:
        """Return the transforms of a neighbouring frame, [P, 3, 4], for the motion between the two.

        Those of an actor that leaves the scene or enters it in between follow from its velocity: its poses in `frame`,
        one interval earlier.
        """
        parts = self.parts(other)
        trace, bases = self._trace, [self._trace.base_part(actor) for actor in self._trace.actors]
        ways = np.abs(trace.positions[frame, bases] - trace.positions[other, bases]).max(axis=1, initial=0)
        jumps = np.flatnonzero(ways / METRE * self._fps > _FASTEST)
        now = self.parts(frame) if jumps.size else parts
        for number in jumps.tolist():
            rows = trace.actor_parts(trace.actors[number])
            parts[rows] = now[rows]
            parts[rows, :, 3] -= trace.linear[frame, number] / METRE / self._fps
        trace.release()
        return parts

    def _lamps_at(self, frame: int) -> list[Array]:
        seconds = frame / self._fps
        return [
            np.where(np.array(signals.lit(element.shape, seconds))[:, None, None], lamps[0], lamps[1])
            for element, lamps in zip(self._signals, self._lamps, strict=True)
        ]


def _lamp_transforms(element: Element) -> tuple[Array, Array]:
    """Return the transforms of a signal's lenses where they are lit, and where they are not, [5, 3, 4] each."""
    pose = from_pose(element.pose)
    lit = np.stack([pose] * len(signals.LAMPS))
    dark = []
    for lamp in signals.LAMPS:
        shift = np.eye(3, 4)
        shift[:, 3] = [LAMP_RETREAT * axis for axis in _BACK.get(lamp, (-1.0, 0.0, 0.0))]
        dark.append(compose(pose, shift))
    return lit, np.stack(dark)
