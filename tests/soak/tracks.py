"""The motion of a Trace as arrays, for the measurements.

F frames, A actors in plan order. All lengths are in metres, speeds in m/s, times in seconds since frame 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.core.trace import METRE, UNIT, ContactEvent, Trace

Array = NDArray[np.float64]
PERSON = 0.2  # radius of a pedestrian
AFTER = 10.0  # seconds after a contact during which its bodies may overlap, brake hard and be moved
_GONE = -100.0  # metres; a body below this height is out of the scene
_JUMP = 10.0  # metres between two frames; a body that moves farther has left and entered again


class Tracks:
    """Positions, headings and velocities of all actors, and their contacts.

    Attributes:
        at: [F, A, 3] positions of the middles.
        ahead: [F, A, 2] headings, unit vectors.
        velocity: [F, A, 2] as the engine has it.
        here: [F, A] whether it is in the scene.
        half: [A, 2] half of length and width.
        touched: [F, A] whether a contact is, or was in the last 10 s.
        pairs: For each pair of actors its contacts, from half a second before to 10 s after.
    """

    def __init__(self, scene: ScenePlan, trace: Trace, events: Sequence[ContactEvent]) -> None:
        self.scene, self.fps = scene, scene.clock.fps
        base = [trace.base_part(actor.name) for actor in scene.actors]
        self.at: Array = trace.positions[:, base].astype(np.float64) / METRE  # [F, A, 3]
        x, y, z, w = np.moveaxis(trace.rotations[:, base].astype(np.float64) / UNIT, -1, 0)
        ahead = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w)], axis=-1)
        self.ahead: Array = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)  # [F, A, 2]
        self.velocity: Array = trace.linear.astype(np.float64)[..., :2] / METRE
        self.speed: Array = np.linalg.norm(self.velocity, axis=-1)
        self.here = self.at[..., 2] > _GONE
        self.half = np.array([_half(actor.category, actor.shape) for actor in scene.actors])
        self.touched = np.zeros((trace.frames, len(scene.actors)), bool)
        index = {actor.name: n for n, actor in enumerate(scene.actors)}
        self.pairs: dict[frozenset[int], list[tuple[float, float]]] = {}
        for event in events:
            start, end = event.start / scene.clock.physics, event.end / scene.clock.physics
            first, last = max(0, int((start - 0.5) * self.fps)), max(0, int((end + AFTER) * self.fps) + 1)
            both = [index[name] for name in (event.first, event.second) if name in index]
            for n in both:
                self.touched[first:last, n] = True
            self.pairs.setdefault(frozenset(both), []).append((start - 0.5, end + AFTER))

    def name(self, n: int) -> str:
        return f"{self.scene.actors[n].name} ({self.scene.actors[n].blueprint})"

    def together(self) -> NDArray[np.bool_]:
        """Return [F, A] whether the motion around a frame, from its predecessor to its successor, is continuous."""
        step = np.linalg.norm(np.diff(self.at, axis=0), axis=-1) < _JUMP
        joined = self.here[1:] & self.here[:-1] & step
        found = np.zeros(self.here.shape, bool)
        found[1:-1] = joined[1:] & joined[:-1]
        return found


def _half(category: str, shape: dict[str, float]) -> tuple[float, float]:
    return (PERSON, PERSON) if category == "pedestrian" else (shape["length"] / 2, shape["width"] / 2)
