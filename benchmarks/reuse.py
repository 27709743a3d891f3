"""Saving of each level of temporal reuse: CPU time per frame with the level, and without it.

    python -m benchmarks.reuse --frames 24
    python -m benchmarks.reuse --frames 96 --level pixels

Two renderers render the same frames of the paper's listing alternately, one with every level, and one without the level
and those that depend on it. Times are CPU time of the thread, so other processes matter less, and ratios compare
consecutive frames. The last line of output is a JSON object.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace

import numpy as np
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.meshes import scene_bodies
from recipe_runtime.render.device.reuse import ALL_REUSE, NO_REUSE, TemporalReuse
from recipe_runtime.render.renderer import Renderer

from benchmarks.listing import RECIPE

VARIANTS = {"dry": "weather=sunny", "rainy": "weather=rainy", "foggy": "weather=foggy"}
LEVELS = {
    "all": NO_REUSE,
    "visibility": replace(ALL_REUSE, visibility=False),
    "samples": replace(ALL_REUSE, samples=False, light=False, reflections=False, pixels=False),
    "light": replace(ALL_REUSE, light=False, reflections=False, pixels=False),
    "reflections": replace(ALL_REUSE, reflections=False),
    "pixels": replace(ALL_REUSE, pixels=False),
}
WARM = 3  # frames after which temporal reuse of a static camera is complete


def main() -> None:
    """Measure every level, or those that are named, in every weather, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--level", choices=LEVELS, action="append", help="a level to measure; may be repeated")
    arguments = parser.parse_args()
    variants = {v.variant: v for v in compile_recipe(RECIPE).plan.variants}
    trace = real_engines().simulate(variants[VARIANTS["dry"]].scene)
    found: dict[str, dict[str, list[float]]] = {}
    heads = (f"{name}, ms with and without | increase" for name in VARIANTS)
    print(f"| level switched off | {' | '.join(heads)} |\n|{'---|' * (1 + 2 * len(VARIANTS))}")
    for level in arguments.level or LEVELS:
        weathers = VARIANTS.items()
        found[level] = {name: compare(variants[v], trace, LEVELS[level], arguments.frames) for name, v in weathers}
        cells = [f"{on:.1f}, {off:.1f} | {100 * (off / on - 1):+.0f} %" for on, off in found[level].values()]
        print(f"| {level} | {' | '.join(cells)} |", flush=True)
    print(json.dumps(found))


def compare(variant: ScenarioPlan, trace: Trace, reuse: TemporalReuse, frames: int) -> list[float]:
    """Milliseconds per frame with every level, and with those of `reuse`, of alternately rendered frames."""
    sources = [source(variant, trace, levels) for levels in (ALL_REUSE, reuse)]
    sensor, begin = variant.rig.sensors[0], variant.scene.clock.frames // 3
    seconds = [0.0, 0.0]
    for frame in range(begin, begin + WARM + frames):
        pictures = []
        for place in (0, 1) if frame % 2 else (1, 0):
            start = time.thread_time()
            seen = sources[place].observe(sensor, frame)
            pictures.append(sources[place].shade(seen, variant.appearance, sensor, frame))
            if frame >= begin + WARM:
                seconds[place] += time.thread_time() - start
        if not np.array_equal(pictures[0], pictures[1]):
            raise SystemExit(f"frame {frame} differs without {reuse}")
    return [1000 * s / frames for s in seconds]


def source(variant: ScenarioPlan, trace: Trace, reuse: TemporalReuse) -> SceneSource:
    """Return a frame source whose renderer uses the given levels."""
    engines = real_engines()
    renderer = Renderer(scene_bodies(variant.scene, engines.assets), reuse=reuse)
    return SceneSource(variant.scene, trace, engines=engines, renderer=renderer)


if __name__ == "__main__":
    main()
