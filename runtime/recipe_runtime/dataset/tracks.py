"""`tracks.csv`: pose, lean, velocity and body box of every actor at every frame, with a fixed number of decimals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import ScenePlan
from recipe_compiler.ir.plan_types import fixed

from recipe_runtime.annotate.actor_boxes import GroundedBoxes
from recipe_runtime.body.exact_arrays import atan2_deg
from recipe_runtime.core.trace import METRE, UNIT, Trace
from recipe_runtime.core.transforms import Array, part_transforms, transform_points

COLUMNS = (
    "frame,time,actor,instance,present,x,y,z,qx,qy,qz,qw,yaw,vx,vy,vz,wx,wy,wz,"
    "roll,pitch,roll_rate,pitch_rate,box_x,box_y,box_z,length,width,height"
)
_ABSENT = -500.0  # metres: actors outside the scene are below this height
_FRAMES = 16  # frames in a piece of the file


def tracks_csv(scene: ScenePlan, trace: Trace) -> Iterator[bytes]:
    """Yield the file in pieces: one row per frame and actor, for its base part in the world frame.

    Units: positions, and centre and size of the body box, in metres; rotation as a unit quaternion; angles in degrees;
    velocities in metres and radians per second; rates of roll and pitch in degrees per second.
    """
    names = [field(name) for name in trace.actors]
    instances = {actor.name: actor.tag * 1000 + actor.instance for actor in scene.actors}
    heads = [f"{name},{instances[actor]}" for name, actor in zip(names, trace.actors, strict=True)]
    boxes = GroundedBoxes(scene.actors, trace)
    yield COLUMNS.encode() + b"\n"
    for start in range(0, trace.frames, _FRAMES):
        frames = range(start, min(start + _FRAMES, trace.frames))
        present = presence(trace, frames).tolist()
        rows = _values(trace, boxes, frames, scene.clock.fps).tolist()
        lines = [
            f"{frame},{text(frame / scene.clock.fps)},{head},{int(now[n])}," + ",".join(map(text, row[n])) + "\n"
            for frame, now, row in zip(frames, present, rows, strict=True)
            for n, head in enumerate(heads)
        ]
        yield "".join(lines).encode()


def presence(trace: Trace, frames: range) -> NDArray[np.bool_]:
    """Return whether each actor is in the scene at some frames, bool [F, A]: traffic may leave and enter again."""
    bases = [trace.base_part(actor) for actor in trace.actors]
    present: NDArray[np.bool_] = trace.positions[frames.start : frames.stop, bases, 2] > _ABSENT * METRE
    trace.release()
    return present


def field(name: str) -> str:
    """Return a name as a field of a CSV file, quoted as in RFC 4180 where necessary."""
    return '"' + name.replace('"', '""') + '"' if any(mark in name for mark in ',"\r\n') else name


def text(value: float) -> str:
    """Return a number with six decimals."""
    return f"{fixed(value):.6f}"


def _values(trace: Trace, boxes: GroundedBoxes, frames: range, fps: int) -> Array:
    """Return the numbers of the rows of some frames, [F, A, N]."""
    bases = [trace.base_part(actor) for actor in trace.actors]
    wide = range(max(0, frames.start - 1), min(trace.frames, frames.stop + 1))
    inner = slice(frames.start - wide.start, frames.stop - wide.start)
    positions = trace.positions[frames.start : frames.stop, bases] / METRE
    rotations = trace.rotations[wide.start : wide.stop, bases] / UNIT
    angles, present = _angles(rotations), presence(trace, wide)
    motion = np.concatenate([array[frames.start : frames.stop] / METRE for array in (trace.linear, trace.angular)], -1)
    return np.concatenate(
        [
            positions,
            rotations[inner],
            angles[inner, :, 2:],
            motion,
            angles[inner, :, :2],
            _rates(angles[..., :2], present, fps)[inner],
            _boxes(trace, boxes, frames),
        ],
        axis=-1,
    )


def _angles(rotations: Array) -> Array:
    """Return roll, pitch and yaw, degrees, of quaternions x, y, z, w [..., 4]; R = Rz(yaw) Ry(pitch) Rx(roll)."""
    x, y, z, w = (rotations[..., n] for n in range(4))
    forward_x, forward_y, forward_z = 1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y), 2.0 * (x * z - w * y)
    level = np.sqrt(forward_x * forward_x + forward_y * forward_y)
    roll = atan2_deg(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    return np.stack([roll, atan2_deg(-forward_z, level), atan2_deg(forward_y, forward_x)], axis=-1)


def _rates(angles: Array, present: NDArray[np.bool_], fps: int) -> Array:
    """Return the rates of angles [F, A, N], degrees, in degrees per second.

    Rates are central differences; at the ends, and where an actor enters or leaves, one-sided differences.
    """
    before, after = np.zeros_like(angles), np.zeros_like(angles)
    steps = angles[1:] - angles[:-1]
    steps = steps - 360.0 * np.floor(steps / 360.0 + 0.5)
    moved = (present[1:] & present[:-1])[..., None]
    before[1:], after[:-1] = np.where(moved, steps, 0.0), np.where(moved, steps, 0.0)
    count = np.zeros((*present.shape, 1))
    count[1:] += moved
    count[:-1] += moved
    rates: Array = (before + after) * fps / np.maximum(count, 1.0)
    return rates


def _boxes(trace: Trace, boxes: GroundedBoxes, frames: range) -> Array:
    """Return centre and size of the body boxes in the world, [F, A, 6]."""
    parts = part_transforms(trace, slice(frames.start, frames.stop))
    found = np.empty((len(frames), len(trace.actors), 6))
    for number, actor in enumerate(trace.actors):
        base = trace.base_part(actor)
        low, high = boxes.extent(actor, parts, base)
        found[:, number, :3] = transform_points(parts[:, base], ((low + high) / 2.0)[:, None])[:, 0]
        found[:, number, 3:] = high - low
    return found
