"""Which lamps of vehicles are lit in a frame, from the motion before and after it.

A vehicle brakes if it becomes slower, and while it stands in traffic. It signals a turn or a change of lane that lies
ahead on its path, also while it waits for it. A frame depends on the Trace and its number alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.body.skeleton import is_person
from recipe_runtime.core.interfaces import LampState
from recipe_runtime.core.trace import METRE, UNIT, Trace
from recipe_runtime.core.transforms import Array

_BRAKING = 0.7  # m/s^2, minimum deceleration; less is that of the engine
_SPAN = 0.2  # seconds over which it is measured
_STANDING, _REVERSING = 0.15, 0.3  # m/s
_LOOK, _STEP = 16.0, 0.25  # seconds of the path ahead, and between its points
_AHEAD, _HEADWAY = 18.0, 3.0  # metres, or seconds if that is farther, before a manoeuvre at which a driver signals it
_TURN = 0.4  # chord of the change of direction (0.4 is 23 degrees) from which a bend is a turn
_RADIUS = 40.0  # metres, largest mean radius of a turn
_SHIFT, _BEND = 1.2, 1.2  # metres to the side of a change of lane; largest chord times the way, metres, of its end
_BLINKS = 1.5  # per second


class VehicleLamps:
    """The lamps of a scene's vehicles."""

    def __init__(self, scene: ScenePlan, trace: Trace) -> None:
        self._trace, self._fps = trace, scene.clock.fps
        driven = [n for n, actor in enumerate(scene.actors) if actor.route and not is_person(actor.shape)]
        self._driven = np.array(driven, np.int64)
        self._bases = np.array([trace.base_part(scene.actors[n].name) for n in driven], np.int64)
        self._phases = np.array([scene.actors[n].instance * 5 % 8 for n in driven], np.int64)

    def many(self, frames: NDArray[np.intp]) -> NDArray[np.int32]:
        """Return a mask of `LampState` for each actor in some frames, int32 [F, A]; 0 for parked vehicles."""
        masks = np.zeros((len(frames), len(self._trace.actors)), np.int32)
        if len(self._driven):
            for row, frame in zip(masks, frames.tolist(), strict=True):
                row[self._driven] = self._at(frame)
            self._trace.release()
        return masks

    def _at(self, frame: int) -> NDArray[np.int32]:
        """Return the masks of the driven vehicles."""
        ahead = self._heading(frame)
        braking, reversing = self._slowing(frame, ahead)
        left, right = self._signalled(frame, ahead)
        # Eighths of a period, so that not all vehicles blink at once.
        on = (int(8.0 * _BLINKS * frame / self._fps) + self._phases) % 8 < 4
        lamps = (braking, LampState.BRAKE), (left & on, LampState.LEFT), (right & on, LampState.RIGHT)
        masks = [np.where(lit, int(state), 0) for lit, state in (*lamps, (reversing, LampState.REVERSE))]
        total: NDArray[np.int32] = np.add.reduce(masks).astype(np.int32)
        return total

    def _slowing(self, frame: int, ahead: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which vehicles brake, and which reverse."""
        last, reach = self._trace.frames - 1, max(1, int(_SPAN * self._fps / 2.0))
        first, end = max(frame - reach, 0), min(frame + reach, last)
        before, now, after = (self._trace.linear[n, self._driven, :2] / METRE for n in (first, frame, end))
        slower = (_length(before) - _length(after)) * self._fps > _BRAKING * max(end - first, 1)
        along = now[:, 0] * ahead[:, 0] + now[:, 1] * ahead[:, 1]
        return slower | (_length(now) < _STANDING), along < -_REVERSING

    def _signalled(self, frame: int, ahead: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which vehicles are about to turn or to change lanes, to the left and to the right."""
        stride = max(1, int(_STEP * self._fps + 0.5))
        count = int(_LOOK / _STEP)
        numbers = [min(frame + stride * n, self._trace.frames - 1) for n in range(count + 1)]
        numbers = sorted(set(numbers))
        places = np.stack([self._trace.positions[n, self._bases, :2] / METRE for n in numbers])
        headings = np.stack([self._heading(n) for n in numbers])
        steps = places[1:] - places[:-1]
        travelled = np.concatenate([np.zeros((1, len(ahead))), np.add.accumulate(_length(steps), axis=0)])
        near = np.maximum(_AHEAD, _HEADWAY * _length(self._trace.linear[frame, self._driven, :2] / METRE))
        jumps = np.concatenate([np.zeros((1, len(ahead)), bool), _length(steps) > 60.0 * stride / self._fps])
        seen = (travelled <= near) & ~np.logical_or.accumulate(jumps, axis=0)  # a vehicle that leaves, enters elsewhere
        aside = ahead[:, 0] * headings[..., 1] - ahead[:, 1] * headings[..., 0]
        chord = np.where(aside < 0.0, -1.0, 1.0) * _length(headings - ahead)
        offset = places - places[0]
        shift = ahead[:, 0] * offset[..., 1] - ahead[:, 1] * offset[..., 0] - 0.5 * chord * travelled
        turning = seen & (np.abs(chord) > _TURN) & (np.abs(chord) * _RADIUS > travelled)
        moving = (
            seen
            & (np.abs(chord) * travelled < _BEND)
            & (np.abs(shift) > _SHIFT)
            & ~np.logical_or.accumulate(turning, axis=0)
        )
        left = (turning & (chord > 0.0)) | (moving & (shift > 0.0))
        right = (turning & (chord < 0.0)) | (moving & (shift < 0.0))
        # The first manoeuvre counts.
        either, ways = left | right, np.argmax(left | right, axis=0)
        first = np.arange(len(ahead))
        some = either[ways, first]
        return some & left[ways, first], some & ~left[ways, first]

    def _heading(self, frame: int) -> Array:
        """Return the direction of travel of the vehicles in the plane, unit vectors [V, 2]."""
        x, y, z, w = (self._trace.rotations[frame, self._bases, n] / UNIT for n in range(4))
        ahead = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w)], axis=-1)
        unit: Array = ahead / np.maximum(_length(ahead), 1e-6)[:, None]
        return unit


def _length(v: Array) -> Array:
    """Return the lengths of vectors [..., 2]."""
    length: Array = np.sqrt(v[..., 0] * v[..., 0] + v[..., 1] * v[..., 1])
    return length
