"""Files beside a recipe are data: no Python file of the current folder is ever run."""

from __future__ import annotations

import os
import subprocess
import sysconfig
from pathlib import Path

import pytest

RECIPE = """\
recipe: small
seed: 1
base:
  clock: {fps: 10, frames: 1}
  town: {name: plaza, size: [40, 40], storeys: 2, trees: 0}
  weather: ClearNight
  actors:
    walker: {blueprint: walker.pedestrian.*, start: {x: -4, y: 1, yaw: -90}, goal: {x: -4, y: -9}}
  sensors:
    street: {mount: {x: -7, y: -3, z: 1.7, yaw: 40}, camera: {width: 64, height: 48}, capture: [rgb, depth, instance]}
"""
NAMES = ("numpy", "pybullet", "signal", "warp", "json", "PIL", "recipe_runtime", "sitecustomize", "usercustomize")


@pytest.mark.slow
@pytest.mark.parametrize("inherited", [False, True])
def test_no_file_of_the_current_folder_is_run(tmp_path: Path, inherited: bool) -> None:
    """The module search paths of the installed command and of its child processes exclude the current folder."""
    recipe = Path(sysconfig.get_path("scripts")) / "recipe"
    if not recipe.is_file():
        pytest.skip("the recipe command is not installed")
    (tmp_path / "small.yaml").write_text(RECIPE)
    for name in NAMES:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'a').write({name!r})\n")
    environment = {**os.environ, "RECIPE_CACHE": str(tmp_path / "cache")}
    environment.pop("PYTHONPATH", None)
    if inherited:
        environment["PYTHONPATH"] = str(Path(__file__).parents[3])
    commands = [
        ["build", "small.yaml", "--workers", "1"],  # starts every kind of child process
        ["shot", "small.yaml", "--frame", "0"],
        ["verify", "datasets/small", "--frames", "1", "--workers", "1"],
    ]
    for command in commands:
        done = subprocess.run([recipe, *command], cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert not (tmp_path / "ran").exists(), (command, (tmp_path / "ran").read_text())
