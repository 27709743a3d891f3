"""`recipe stats`: the numbers of a dataset, and those of a recipe that are known before a build."""

from __future__ import annotations

import json
from pathlib import Path

from recipe_compiler.ir.plan import CameraPlan
from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.report.statistics import misfit

from tests.cli.runner import run_here

RECIPE = """\
recipe: counted
base:
  clock: {fps: 10, frames: 6}
  town: {name: downtown, blocks: [1, 1]}
  actors:
    walker: {blueprint: walker.pedestrian.*, start: {x: -4, y: 1, yaw: -90}, goal: {x: -4, y: -9}}
  sensors:
    street: {mount: {x: -7, y: -3, z: 1.7, yaw: 40}, camera: {width: 64, height: 48}, capture: [rgb, depth]}
    slow: {mount: {x: -7, y: -3, z: 1.7, yaw: 40}, camera: {width: 32, height: 24}, tick: 0.2, capture: [rgb]}
deltas:
  weather: {dry: {}, wet: {weather: HardRainNoon}}
"""


def test_numbers_of_a_recipe_are_those_of_its_dataset(tmp_path: Path) -> None:
    """What follows from the plans is equal before and after the build; labels are counted after it."""
    (tmp_path / "counted.yaml").write_text(RECIPE)
    before = json.loads(run_here("stats", "counted.yaml", "--json", cwd=tmp_path).stdout)
    assert (before["variants"], before["scenes"], before["frames"]) == (2, 1, 18)
    assert before["pictures"] == {"rgb": 18, "depth": 12}
    assert before["pixels"] == 12 * 64 * 48 + 6 * 32 * 24 and before["actors"] == {"Pedestrian": 1}
    assert "labels" not in before
    assert run_here("build", "counted.yaml", cwd=tmp_path).returncode == 0
    root = tmp_path / "datasets" / "counted"
    ran = run_here("stats", root, "--json", cwd=tmp_path)
    after = json.loads(ran.stdout)
    assert {key: after[key] for key in before if key not in ("errors", "warnings")} == {
        key: before[key] for key in before if key not in ("errors", "warnings")
    }
    rows = [json.loads(line) for path in root.glob("*/*/labels.jsonl") for line in path.read_text().splitlines()]
    assert after["labels"]["annotations"] == sum(len(row["objects"]) for row in rows) > 0
    text = run_here("stats", root, cwd=tmp_path).stdout
    assert f"annotations: {after['labels']['annotations']} in 18 frames" in text and after["identity"] in text
    _check_misfit(rows, after["labels"]["classes"]["Pedestrian"]["histograms"]["misfit"])
    labels = next(root.glob("*/street/labels.jsonl"))
    labels.write_text(labels.read_text().replace('"area":', '"area":1'))
    damaged = run_here("stats", root, cwd=tmp_path)
    assert damaged.returncode == 2 and "labels.jsonl" in damaged.stderr


def _check_misfit(rows: list[LabelledFrame], counts: list[int]) -> None:
    """True labels agree with their 3-D boxes; one that is moved by its own width does not."""
    assert counts[0] > 0 and sum(counts[1:]) == 0
    item = max((item for row in rows for item in row["objects"]), key=lambda item: item["area"])
    camera = CameraPlan(width=64, height=48, fov=90)
    assert misfit(item, camera) == 0.0
    x, y, w, h = item["bbox"]
    assert misfit({**item, "bbox": [x + w, y, w, h]}, camera) > 0.3


def test_what_is_neither_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert run_here("stats", "empty", cwd=tmp_path).returncode == 2
    assert run_here("stats", "nothing.yaml", cwd=tmp_path).returncode == 2
