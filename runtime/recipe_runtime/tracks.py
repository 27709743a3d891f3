"""`tracks.csv`: where every actor is at every frame, and how fast, as text with fixed decimals."""

from __future__ import annotations

from recipe_compiler import exact
from recipe_compiler.plan import ScenePlan, fixed

from recipe_runtime.trace import METRE, UNIT, Trace

_COLUMNS = "frame,time,actor,instance,x,y,z,qx,qy,qz,qw,yaw,vx,vy,vz,wx,wy,wz"


def tracks_csv(scene: ScenePlan, trace: Trace) -> str:
    """A row for every frame and actor, of its base part in the world frame.

    Metres, a quaternion, yaw in degrees, metres and radians a second.
    """
    bases = [trace.base_part(actor) for actor in trace.actors]
    instances = {actor.name: actor.tag * 1000 + actor.instance for actor in scene.actors}
    lines = [_COLUMNS]
    for frame in range(trace.frames):
        head = f"{frame},{_text(frame / scene.clock.fps)}"
        for number, (actor, base) in enumerate(zip(trace.actors, bases, strict=True)):
            position = [int(v) / METRE for v in trace.positions[frame, base]]
            x, y, z, w = (int(v) / UNIT for v in trace.rotations[frame, base])
            yaw = exact.atan2_deg(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            linear = [int(v) / METRE for v in trace.linear[frame, number]]
            angular = [int(v) / METRE for v in trace.angular[frame, number]]
            values = [*position, x, y, z, w, yaw, *linear, *angular]
            lines.append(f"{head},{actor},{instances[actor]}," + ",".join(_text(v) for v in values))
    return "\n".join(lines) + "\n"


def _text(value: float) -> str:
    return f"{fixed(value):.6f}"
