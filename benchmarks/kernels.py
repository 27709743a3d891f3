"""Time of a frame by stage of the renderer: milliseconds of one thread, in the middle of a clip.

    python -m benchmarks.kernels RECIPE VARIANT --frames 16

Times are CPU time of the thread, so other processes matter little. The last line of output is a JSON object.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from recipe_compiler.compile import compile_recipe
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.render.renderer import Renderer

WARM = 3  # frames: for a static camera, temporal reuse is complete after two


def main() -> None:
    """Render consecutive frames, and print the time by stage."""
    parser = argparse.ArgumentParser()
    parser.add_argument("recipe", type=Path)
    parser.add_argument("variant")
    parser.add_argument("--frames", type=int, default=16)
    arguments = parser.parse_args()
    variant = next(v for v in compile_recipe(arguments.recipe).plan.variants if v.variant == arguments.variant)
    trace = real_engines().simulate(variant.scene)
    source, sensor = SceneSource(variant.scene, trace), variant.rig.sensors[0]
    timings = source.renderer.timings if isinstance(source.renderer, Renderer) else None
    if timings is None:
        raise SystemExit("this renderer has no timings")
    timings.clock = time.thread_time
    begin = variant.scene.clock.frames // 3
    for frame in range(begin, begin + WARM + arguments.frames):
        if frame == begin + WARM:
            timings.seconds.clear()
        source.shade(source.observe(sensor, frame), variant.appearance, sensor, frame)
    if "static shadows" in timings.seconds:  # they are drawn within that stage
        timings.seconds["shadows"] -= timings.seconds["static shadows"]
    print(json.dumps({stage: 1000 * s / arguments.frames for stage, s in timings.seconds.items()}))


if __name__ == "__main__":
    main()
