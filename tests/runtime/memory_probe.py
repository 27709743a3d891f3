"""Use a Trace in a new process as the parent of a simulation, a worker and the end of a build do.

Arguments: a folder and a number of frames. Prints the most memory that the process ever held, in KiB.
"""

from __future__ import annotations

import gc
import sys
from pathlib import Path

import numpy as np
from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.cache.store import Store
from recipe_runtime.core.trace import METRE, UNIT, Trace, TraceWriter, frame_bytes
from recipe_runtime.dataset.digests import body_motions
from recipe_runtime.dataset.tracks import tracks_csv
from recipe_runtime.frames.source import SceneSource

from tests.runtime.fakes import ENGINES, scene_plan, sensor_plan

ACTORS = 400


def peak() -> int:
    """Return the peak memory of this process in KiB; `ru_maxrss` would include that of its parent before the fork."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0])


def crowd(frames: int) -> ScenePlan:
    """Return a scene whose actors' motion takes 80 MiB in 2,400 frames."""
    one = scene_plan(frames).actors[0]
    actors = [one.model_copy(update={"name": f"a{n}", "instance": n + 1}) for n in range(ACTORS)]
    return scene_plan(frames).model_copy(update={"actors": tuple(actors)})


def simulated(scene: ScenePlan) -> Trace:
    """Return the actors' motion, written frame by frame as in `simulate`."""
    names = [actor.name for actor in scene.actors]
    writer = TraceWriter(names, [f"{name}/base" for name in names], scene.clock.frames)
    positions, rotations = np.zeros((ACTORS, 3), np.int64), np.zeros((ACTORS, 4), np.int32)
    positions[:, 0], rotations[:, 3] = 4 * METRE, UNIT
    for frame in range(scene.clock.frames):
        positions[:, 1] = frame * np.arange(ACTORS)
        writer.write(frame, frame_bytes(positions, rotations, positions, positions))
    trace = writer.trace()
    writer.close()
    return trace


def main(folder: Path, frames: int) -> None:
    """Use a Trace as each process of a build does."""
    scene = crowd(frames)
    store, sensor = Store(folder), sensor_plan()
    trace = store.trace(scene, lambda: simulated(scene))
    trace = store.trace(scene, lambda: simulated(scene))
    source = SceneSource(scene, trace, engines=ENGINES)
    for frame in range(0, frames, max(1, frames // 20)):
        source.labels(source.observe(sensor, frame), sensor, frame)
    body_motions(trace)
    for _ in tracks_csv(scene, trace):
        break
    gc.collect()
    print(peak())


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
