"""Cost of lamp shadows: CPU time per night frame with them, and without.

    python -m benchmarks.lamp_shadows --frames 12

Two renderers render the same frames alternately, one of them without shadow maps for lamps. Times are CPU time of the
thread, so other processes matter less. The last line of output is a JSON object.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.render.lighting import lights
from recipe_runtime.render.shadows.lamp_shadow_maps import LampShadowMaps, MapMemory, no_maps
from recipe_runtime.render.shadows.lamp_slots import SLOTS, LampSlots, assign_slots

from benchmarks.reuse import WARM

ROOT = Path(__file__).parents[1]
NO_CHANGE: dict[str, str] = {}
SCENES = {  # recipe, variant, and what is replaced in its text
    "static camera": ("recipes/weather_sweep.yaml", "weather=sunny,jitter=still,time_of_day=night", NO_CHANGE),
    "crowded junction": (
        "recipes/towns/downtown.yaml",
        "hour=night",
        {"frames: 11": "frames: 41", "width: 480, height: 320": "width: 800, height: 600"},
    ),
    "moving camera": (
        "benchmarks/town.yaml",
        "weather=clear",
        {"ClearNoon": "ClearNight", "frames: 120": "frames: 60"},
    ),
}


def main() -> None:
    """Measure the scenes, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=12)
    frames = parser.parse_args().frames
    print("| night | ms with shadows of lamps | without | ratio |\n|---|---|---|---|")
    found = {}
    for name in SCENES:
        found[name] = shadowed, plain = compare(night(name), frames)
        print(f"| {name} | {shadowed:.0f} | {plain:.0f} | {shadowed / plain:.2f} |", flush=True)
    print(json.dumps(found))


def night(name: str) -> ScenarioPlan:
    """Return the plan of a scene."""
    recipe, variant, changes = SCENES[name]
    text = (ROOT / recipe).read_text()
    for old, new in changes.items():
        if old not in text:
            raise SystemExit(f"{recipe} has no {old!r}")
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "night.yaml"
        path.write_text(text)
        return next(v for v in compile_recipe(path).plan.variants if v.variant == variant)


def compare(variant: ScenarioPlan, frames: int) -> tuple[float, float]:
    """Return milliseconds per frame with the shadows of lamps, and without."""
    engines = real_engines()
    trace = engines.simulate(variant.scene)
    sources = [SceneSource(variant.scene, trace, engines=engines) for _ in range(2)]
    sensor, begin, seconds = variant.rig.sensors[0], variant.scene.clock.frames // 3, [0.0, 0.0]
    for frame in range(begin, begin + WARM + frames):
        pictures: list[Any] = [None, None]
        for place in (0, 1) if frame % 2 else (1, 0):
            with without_shadows() if place else mock.MagicMock():
                start = time.thread_time()
                seen = sources[place].observe(sensor, frame)
                pictures[place] = sources[place].shade(seen, variant.appearance, sensor, frame).copy()
            if frame >= begin + WARM:
                seconds[place] += time.thread_time() - start
    if np.array_equal(pictures[0], pictures[1]):
        raise SystemExit(f"{variant.variant}: no lamp casts a shadow in the last frame")
    return 1000 * seconds[0] / frames, 1000 * seconds[1] / frames


@contextmanager
def without_shadows() -> Iterator[None]:
    """Disable shadow maps of lamps."""

    def no_slots(*arguments: Any) -> LampSlots:
        slots = assign_slots(*arguments)
        columns = tuple(np.zeros_like(column) for column in slots.columns)
        return replace(slots, weights=np.zeros_like(slots.weights), columns=columns)

    memory = MapMemory(SLOTS, "cpu")
    nothing_drawn = mock.patch.object(LampShadowMaps, "draw", lambda *_: (no_maps("cpu"), memory))
    with mock.patch.object(lights, "assign_slots", no_slots), nothing_drawn:
        yield


if __name__ == "__main__":
    main()
