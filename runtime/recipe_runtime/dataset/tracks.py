"""`tracks.csv`: position and velocity of every actor at every frame, with a fixed number of decimals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ScenePlan
from recipe_compiler.ir.plan_types import fixed

from recipe_runtime.core.trace import METRE, UNIT, Trace

_COLUMNS = "frame,time,actor,instance,x,y,z,qx,qy,qz,qw,yaw,vx,vy,vz,wx,wy,wz"


def tracks_csv(scene: ScenePlan, trace: Trace) -> Iterator[bytes]:
    """Yield the file in pieces: one row per frame and actor, for its base part in the world frame.

    Positions in metres, a quaternion, yaw in degrees, velocities in metres and radians per second.
    """
    bases = [trace.base_part(actor) for actor in trace.actors]
    instances = {actor.name: actor.tag * 1000 + actor.instance for actor in scene.actors}
    yield _COLUMNS.encode() + b"\n"
    for frame in range(trace.frames):
        positions, rotations = trace.positions[frame, bases].tolist(), trace.rotations[frame, bases].tolist()
        motions = np.concatenate([trace.linear[frame], trace.angular[frame]], axis=1).tolist()
        trace.release()
        head, lines = f"{frame},{_text(frame / scene.clock.fps)}", []
        for actor, position, rotation, motion in zip(trace.actors, positions, rotations, motions, strict=True):
            x, y, z, w = (v / UNIT for v in rotation)
            yaw = exact.atan2_deg(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            values = [*(v / METRE for v in position), x, y, z, w, yaw, *(v / METRE for v in motion)]
            lines.append(f"{head},{actor},{instances[actor]}," + ",".join(_text(v) for v in values) + "\n")
        yield "".join(lines).encode()


def _text(value: float) -> str:
    return f"{fixed(value):.6f}"
