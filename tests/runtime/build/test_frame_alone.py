"""A frame rendered alone equals that of the full build, for every sensor and in any order."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.dataset.manifest_types import Manifest

from tests.sources import ROOT

# Sensors on actors and in the world; each has another pose in every frame.
ATTACHED = """
recipe: attached
seed: 3
base:
  clock: {fps: 10, frames: 6}
  town: {name: downtown, blocks: [1, 1], seed: 3}
  weather: MidRainyNoon
  actors:
    car: {blueprint: vehicle.hatchback.*, start: {x: -1.5, y: 12, yaw: -90}, route: [{x: -1.5, y: -20}], speed: 6}
    walker: {blueprint: walker.pedestrian.*, start: {x: -4.4, y: 3}, goal: {x: -4.4, y: -9}, speed: 1.5}
  sensors:
    dash:
      mount: {on: car, x: 0.6, z: 1.2}
      camera: {width: 160, height: 120, fov: 85}
      capture: [rgb, depth, instance, semantic]
      motion: {jitter: {z: 0.02, pitch: 0.5}}
    eyes:
      mount: {on: walker, x: 0.2, z: 1.6}
      camera: {width: 160, height: 120, fov: 90, antialias: false}
      capture: [rgb, instance]
"""

# Runs in a new process: renders each named frame alone, with a new renderer.
_ALONE = """
import json, sys
from pathlib import Path
from recipe_compiler.compile import compile_recipe
from recipe_runtime.annotate.records import label_digest
from recipe_runtime.modalities import pixel_digest
from tests.runtime.frame_source import FrameSource
from recipe_runtime.simulation.process import simulate
recipe, wanted = json.loads(sys.stdin.read())
plans = {v.variant: v for v in compile_recipe(Path(recipe)).plan.variants}
traces, found = {}, []
for variant, sensor, frame in wanted:
    plan = plans[variant]
    if plan.scene.digest not in traces:
        traces[plan.scene.digest] = simulate(plan.scene)
    arrays, labels = FrameSource(plan, traces[plan.scene.digest]).render_labelled(sensor, frame)
    found.append({"labels": label_digest(labels), **{m: pixel_digest(m, a) for m, a in arrays.items()}})
print(json.dumps(found))
"""


@pytest.fixture(scope="module", params=["tiny", "attached"])
def recipe(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    if request.param == "tiny":
        return ROOT / "tests" / "golden" / "tiny.yaml"
    path = tmp_path_factory.mktemp("alone") / "attached.yaml"
    path.write_text(ATTACHED)
    return path


@pytest.fixture(scope="module")
def built(recipe: Path, tmp_path_factory: pytest.TempPathFactory) -> Manifest:
    """Return the manifest of the full dataset, built by this process, which renders the frames in order."""
    folder = tmp_path_factory.mktemp("built")
    return build(
        compile_recipe(recipe).plan, folder / "dataset", BuildOptions(workers=0, cache=folder / "cache")
    ).manifest


@pytest.mark.slow
def test_every_sensor_alone_in_a_new_process(recipe: Path, built: Manifest) -> None:
    variants = built["variants"]
    views = [(v, sensor) for v in reversed(built["order"]) for sensor in reversed(variants[v]["frames"])]
    some = (
        [(3, 0)[n % 4 // 2] for n in range(len(views))] if len(variants) > 1 else [5, 5]
    )  # both sensors at each frame
    wanted = [(*view, frame) for view, frame in zip(views, some, strict=True)]
    wanted += [(*view, 0) for view in views if len(variants) == 1]
    done = subprocess.run(
        [sys.executable, "-c", _ALONE],
        input=json.dumps([str(recipe), wanted]),
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONHASHSEED": "123"},
    )
    assert done.returncode == 0, done.stderr
    for (variant, sensor, frame), digests in zip(wanted, json.loads(done.stdout), strict=True):
        frames = variants[variant]["frames"][sensor]
        assert digests == {m: rows[frame] for m, rows in frames.items()}, f"{variant}, {sensor}, frame {frame}"
    assert len({json.dumps(d) for d in json.loads(done.stdout)}) == len(wanted)  # no two frames are alike
