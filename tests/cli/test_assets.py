"""Assets on the command line: listed, built with, and missed where they are not at hand."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

GOOD = Path(__file__).parents[1] / "cases/good/assets"


def run(*arguments: str, cwd: Path, code: int = 0) -> str:
    command = [sys.executable, "-m", "recipe_cli", *arguments]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout + done.stderr


def test_a_plan_lists_assets_with_digests_and_sizes(tmp_path: Path) -> None:
    told = " ".join(run("plan", str(GOOD / "recipe.yaml"), cwd=tmp_path).split())
    assert " poster d56e3d74 101 bytes, 4 x 3 pixels, files/poster.png" in told
    assert " wedge 23b275f4 88 bytes, 8 triangles in body, files/tetrahedron.obj" in told
    document = json.loads(run("plan", str(GOOD / "recipe.yaml"), "--json", cwd=tmp_path))
    assert [asset["name"] for asset in document["assets"]] == ["poster", "wedge", "part", "skinned"]
    assert all(len(asset["sha256"]) == 64 for asset in document["assets"])


@pytest.mark.slow
def test_a_dataset_alone_is_inconclusive_and_with_its_recipe_verified(tmp_path: Path) -> None:
    shutil.copytree(GOOD, tmp_path / "recipe")
    run("build", "recipe/recipe.yaml", "--out", "set", "--workers", "2", cwd=tmp_path)
    alone = run("verify", "set", "--frames", "2", "--workers", "1", cwd=tmp_path, code=3)
    assert alone.startswith("INCONCLUSIVE at observation") and "is not at hand; name the recipe" in alone
    held = run("verify", "recipe/recipe.yaml", "--against", "set", "--frames", "2", "--workers", "1", cwd=tmp_path)
    assert held.startswith("PASS")
    (tmp_path / "recipe/files/tetrahedron.obj").write_bytes(b"v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n")
    other = run("verify", "recipe/recipe.yaml", "--against", "set", "--frames", "2", cwd=tmp_path, code=1)
    assert other.startswith("FAIL")
