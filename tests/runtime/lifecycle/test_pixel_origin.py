"""`recipe why` agrees with the labels, the plan and the patch's own texture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from PIL import Image
from recipe_compiler.compile import compile_recipe
from recipe_runtime.core.documents import decode

from tests.cli.runner import run_here
from tests.sources import ROOT

RECIPE = """
recipe: origin
seed: 3
base:
  clock: {fps: 10, frames: 2}
  town: {name: plaza}
  weather: ClearNoon
  actors:
    near: {blueprint: walker.pedestrian.0004, start: {x: 4, y: 1, yaw: 90}, goal: {x: 4, y: 9}}
  sensors:
    s: {mount: {z: 1.6}, camera: {width: 160, height: 120}, capture: [rgb, depth, instance]}
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("origin")
    (root / "r.yaml").write_text(RECIPE)
    done = run_here("build", "r.yaml", "-o", "ds", cwd=root)
    assert done.returncode == 0, done.stderr
    return root


def why(folder: Path, *arguments: object) -> Any:
    done = run_here("why", *map(str, arguments), "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_the_answer_agrees_with_the_labels_and_the_plan(built: Path) -> None:
    folder = built / "ds" / "base" / "s"
    line = (folder / "labels.jsonl").read_bytes().splitlines()[1]
    (record,) = decode(line, dict[str, Any])["objects"]
    with Image.open(folder / "instance" / "000001.png") as picture:
        y, x = np.argwhere(np.array(picture) == record["instance"])[record["area"] // 2].tolist()
    with Image.open(folder / "rgb" / "000001.png") as picture:
        colour = list(picture.getpixel((x, y)))
    found = why(built, "ds", 1, x, y)
    assert (found["rgb"], found["body"]["name"], found["body"]["kind"]) == (colour, "near", "walker.pedestrian.0004")
    assert found["body"]["instance"] == record["instance"] and found["surface"]["tag"] == 12
    box = record["tight3d_world"]
    assert all(abs(a - b) <= max(box["size"]) / 2 + 0.02 for a, b in zip(found["place"], box["centre"], strict=True))
    document = compile_recipe(built / "r.yaml").plan.variants[0].document()
    for path, value in ((found["body"]["plan"][0], "near"), (found["surface"]["plan"][0], found["surface"]["colour"])):
        part: Any = document
        for key in path.split("."):
            part = part[int(key)] if isinstance(part, list) else part[key]
        assert value == (part["name"] if isinstance(part, dict) else part)


@pytest.mark.slow
def test_sky_and_ground(built: Path) -> None:
    sky = why(built, "r.yaml", 0, 80, 2)
    assert (sky["body"], sky["depth"], sky["patch"]) == (None, None, None) and sky["light"]["sun"]["altitude"] > 0
    ground = why(built, "r.yaml", 0, 3, 118)
    altitude = ground["light"]["sun"]["altitude"]  # the sun meets what is level, here the basin's rim, at this angle
    assert ground["light"]["sun_on_surface"] == pytest.approx(np.sin(np.radians(altitude)), abs=1e-3)


@pytest.mark.slow
def test_the_texel_of_a_patch_follows_from_its_corners() -> None:
    recipe = ROOT / "recipes" / "attacks" / "poster.yaml"
    name = "weather=clear,insertion=rendered"
    with recipe_runtime.open(recipe, name) as scenario:
        (patch,) = scenario.patches(0)["patches"]
    corners = patch["corners"]
    assert corners is not None
    for corner, texel in zip(corners, ([0, 0], [1, 0], [1, 1], [0, 1]), strict=True):
        middle = [sum(c[axis] for c in corners) / 4 for axis in (0, 1)]
        x, y = (round(0.97 * c + 0.03 * m - 0.5) for c, m in zip(corner, middle, strict=True))
        found = why(ROOT, recipe, 0, x, y, "--variant", name)["patch"]
        assert found["name"] == "poster" and found["texel"] == pytest.approx(texel, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["r.yaml", "0", "160", "3"], "outside of the picture"),
        (["r.yaml", "9", "1", "3"], "frame 9 does not exist"),
        (["r.yaml", "0", "1", "3", "--sensor", "t"], "no sensor 't'"),
        (["nowhere", "0", "1", "3"], "nowhere"),
    ],
)
def test_mistakes(built: Path, arguments: list[str], words: str) -> None:
    done = run_here("why", *arguments, cwd=built)
    assert done.returncode == 2 and words in done.stderr
