"""Frames per second of a frame stream on a GPU: rgb, depth and instance, without encoding.

`python -m benchmarks.gpu [--device cuda:0] [--recipe recipes/weather_sweep.yaml] [--frames 600] [--lanes 16]`

For a static and for a moving camera, it prints the rate with the pixels in the host's memory. Before that, it compares
some frames with those that the renderer computes one by one on the CPU.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array, part_transforms, sensor_transform
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.render.gpu.frame_stream import FrameBatch, FrameStream
from recipe_runtime.render.renderer import Renderer

_SHIFT = 0.01  # metres a frame that the moving camera goes ahead


def take_of(variant: ScenarioPlan, trace: Trace, count: int, moving: bool) -> FrameBatch:
    """Return frames of the first sensor, back and forth over the clip, with a slow camera motion if requested."""
    clock, sensor = variant.scene.clock, variant.rig.sensors[0]
    there_and_back = np.arange(count) % (2 * clock.frames)
    numbers = np.minimum(there_and_back, 2 * clock.frames - 1 - there_and_back)
    known = np.stack([sensor_transform(sensor, trace, frame) for frame in range(clock.frames)])
    poses: Array = known[numbers]
    if moving:
        poses[:, :, 3] += poses[:, :, 0] * (_SHIFT * numbers)[:, None]
    return FrameBatch(numbers.tolist(), (numbers / clock.fps).tolist(), poses, part_transforms(trace, numbers))


def compare(variant: ScenarioPlan, renderer: Renderer, stream: FrameStream, take: FrameBatch) -> int:
    """Count the pixels of the frames that differ from those that the CPU renders."""
    sensor, differing = variant.rig.sensors[0], 0
    for at, made in enumerate(stream.frames(take)):
        seen = renderer.observe(sensor.camera, take.poses[at], take.parts[at])
        picture = renderer.shade(seen, variant.appearance, sensor.name, made.number, take.times[at])
        ours, theirs = made.observation, seen
        differing += int((ours.depth != theirs.depth).sum() + (ours.instance != theirs.instance).sum())
        differing += int((made.pictures[0] != picture).any(axis=-1).sum()) + int(ours.objects != theirs.objects)
    return differing


def measure(dataset: DatasetPlan, trace_of: Callable[[ScenarioPlan], Trace], options: argparse.Namespace) -> None:
    """Print the rates of the requested variants."""
    for variant in dataset.variants[: options.variants]:
        trace, sensor = trace_of(variant), variant.rig.sensors[0]
        bodies = [*town_bodies(variant.scene.town), *[actor_body(actor) for actor in variant.scene.actors]]
        gpu, cpu = Renderer(bodies, options.device), Renderer(bodies)
        for moving in (False, True):
            stream = gpu.frame_stream(sensor.camera, sensor.name, [variant.appearance], options.lanes)
            few = take_of(variant, trace, options.compare, moving)
            differing = compare(variant, cpu, stream, few)
            many = take_of(variant, trace, options.frames, moving)
            for _ in stream.frames(many):  # once for the shadow maps and the clocks
                pass
            start, busy = time.perf_counter(), time.process_time()
            for _ in stream.frames(many):
                pass
            wall, busy = time.perf_counter() - start, time.process_time() - busy
            camera = "moving" if moving else "still"
            size = f"{sensor.camera.width}x{sensor.camera.height}"
            print(
                f"{variant.variant}, {size}, {camera} camera: {options.frames / wall:.0f} frames/s, "
                f"{1e3 * wall / options.frames:.2f} ms a frame ({1e3 * busy / options.frames:.2f} ms of a core); "
                f"{differing} pixels of {options.compare} frames differ from the CPU's",
                flush=True,
            )


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--recipe", type=Path, default=Path("recipes/weather_sweep.yaml"))
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--compare", type=int, default=4)
    parser.add_argument("--lanes", type=int, default=16)
    parser.add_argument("--variants", type=int, default=1)
    return parser.parse_args()


def main() -> None:
    """Simulate the scenes, and measure."""
    from recipe_runtime.cache.store import Store
    from recipe_runtime.frames.engines import real_engines
    from recipe_runtime.loading import compiled

    options = arguments()
    dataset, store = compiled(options.recipe), Store()
    measure(dataset, lambda v: store.trace(v.scene, lambda: real_engines().simulate(v.scene)), options)


if __name__ == "__main__":
    main()
