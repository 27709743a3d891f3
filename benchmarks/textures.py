"""CPU time on one core of a frame with another texture, compared with a frame of the plain script.

    python -m benchmarks.textures --updates 100 --frames 4

The frame is one of recipes/attacks/poster.yaml, 800x600, in two weathers. `update` is `Scenario.render` with another
texture of 384x288, from the texture to the picture; `forward` and `backward` are those of `SceneView`, where PyTorch is
installed; `frame` is another frame, and `recording` another frame with all that its texture updates and its gradient
need. The plain script (benchmarks/baseline.py) and the updates take turns. The last line of output is a JSON object.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import recipe_runtime
from numpy.typing import NDArray
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.scenario import Scenario

from benchmarks.listing import ROOT, baseline
from benchmarks.stage import write_stage
from benchmarks.table import textures_table

RECIPE = ROOT / "recipes" / "attacks" / "poster.yaml"
WEATHERS = ("clear", "rainy")
PATCH, FRAME, HEIGHT, WIDTH = "poster", 3, 288, 384
PLAIN = {"TinyRenderer, shadows": "1", "TinyRenderer, default": "default"}
TURNS = 3
NEW_FRAMES = range(4, 12)
PASSES = 20  # forward and backward
WARM = 2  # omitted measurements

Result = dict[str, Any]


def main() -> None:
    """Measure, and print tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--updates", type=int, default=100, help="textures in a turn (default: 100)")
    parser.add_argument("--frames", type=int, default=4, help="of the plain script in a turn (default: 4)")
    arguments = parser.parse_args()
    found = measured(arguments.updates, arguments.frames)
    print("\n".join(textures_table(found)))
    print(json.dumps(found))


def measured(updates: int, frames: int) -> Result:
    """Return milliseconds of CPU time by weather, and of the plain script by renderer and turn."""
    scenes = {w: recipe_runtime.open(RECIPE, f"weather={w},insertion=rendered") for w in WEATHERS}
    seeded = np.random.default_rng(1)
    textures = [seeded.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(updates)]
    found: Result = {"plain": {name: [] for name in PLAIN}, "weathers": {w: {"update": []} for w in WEATHERS}}
    with tempfile.TemporaryDirectory(prefix="recipe-bench-") as folder:
        stage = Path(folder)
        plan = scenes[WEATHERS[0]].plan
        write_stage(plan, real_engines().simulate(plan.scene), stage)
        for _ in range(TURNS):
            for name, shadow in PLAIN.items():
                result = baseline(stage, stage / "pictures", "tiny", shadow, frames)
                assert result is not None
                found["plain"][name].append(1000 * result["cpu"] / frames)
            for weather, scene in scenes.items():
                found["weathers"][weather]["update"].append(update(scene, textures))
    for weather, scene in scenes.items():
        found["weathers"][weather] |= recording(scene) | gradient(scene)
    return found


def update(scene: Scenario, textures: Sequence[NDArray[np.uint8]]) -> float:
    """Mean time of the frame with another texture."""
    scene.render(FRAME, textures={PATCH: textures[-1]})  # recorded
    spent = cpu(lambda texture: scene.render(FRAME, textures={PATCH: texture}), textures)
    return sum(spent) / len(spent)


def recording(scene: Scenario) -> Result:
    """Time of new frames, and of the recordings of the same."""
    other = recipe_runtime.open(RECIPE, scene.variant)  # with a renderer of its own
    frames: dict[str, list[float]] = {"frame": [], "recording": []}
    for number in NEW_FRAMES:
        frames["frame"] += cpu(scene.render, [number])
        frames["recording"] += cpu(lambda k: other.patch_view(k, PATCH), [number])
    return {name: median(values[WARM:]) for name, values in frames.items()}


def gradient(scene: Scenario) -> Result:
    """Time of `SceneView`; empty if PyTorch is not installed."""
    if importlib.util.find_spec("torch") is None:
        return {}
    import torch
    from recipe_runtime.torch import SceneView

    torch.set_num_threads(1)
    view = SceneView(scene, PATCH, [FRAME])
    texture = torch.rand((1, 3, HEIGHT, WIDTH), generator=torch.Generator().manual_seed(1), requires_grad=True)
    upstream = torch.ones_like(view.pictures(texture))
    passes = range(WARM + PASSES)
    forward = cpu(lambda _: view.pictures(texture), passes)
    both = cpu(lambda _: torch.autograd.grad(view.pictures(texture), texture, upstream), passes)
    return {"forward": median(forward[WARM:]), "forward and backward": median(both[WARM:])}


def cpu(task: Callable[[Any], object], values: Iterable[Any]) -> list[float]:
    """Return the milliseconds of CPU time of a task for each value."""
    spent = []
    for value in values:
        start = time.process_time()
        task(value)
        spent.append(1000 * (time.process_time() - start))
    return spent


if __name__ == "__main__":
    main()
