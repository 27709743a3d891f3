"""Assets on the command line: listed, used in builds, and reported if missing."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.runner import run_here

GOOD = Path(__file__).parents[1] / "cases/good/assets"


def run(*arguments: str, cwd: Path, code: int = 0, in_process: bool = True) -> str:
    if in_process:
        done = run_here(*arguments, cwd=cwd)
    else:
        command = [sys.executable, "-m", "recipe_cli", *arguments]
        done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_a_plan_lists_assets_with_digests_and_sizes(tmp_path: Path) -> None:
    reported = " ".join(run("plan", str(GOOD / "recipe.yaml"), cwd=tmp_path).split())
    assert " poster d56e3d74 101 bytes, 4 x 3 pixels, files/poster.png" in reported
    assert " wedge 23b275f4 88 bytes, 8 triangles in body, files/tetrahedron.obj" in reported
    document = json.loads(run("plan", str(GOOD / "recipe.yaml"), "--json", cwd=tmp_path))
    assert [asset["name"] for asset in document["assets"]] == ["poster", "wedge", "part", "skinned"]
    assert all(len(asset["sha256"]) == 64 for asset in document["assets"])


@pytest.mark.slow
def test_a_dataset_with_assets_passes_verification_alone_and_with_its_recipe(tmp_path: Path) -> None:
    shutil.copytree(GOOD, tmp_path / "recipe")
    run("build", "recipe/recipe.yaml", "--out", "set", "--workers", "1", cwd=tmp_path)
    shutil.move(tmp_path / "recipe", tmp_path / "away")
    alone = run("verify", "set", "--frames", "2", "--workers", "1", cwd=tmp_path)
    assert alone.startswith("PASS")
    shutil.move(tmp_path / "away", tmp_path / "recipe")
    held = run("verify", "recipe/recipe.yaml", "--against", "set", "--frames", "2", "--workers", "1", cwd=tmp_path)
    assert held.startswith("PASS")
    (tmp_path / "recipe/files/tetrahedron.obj").write_bytes(b"v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n")
    other = run("verify", "recipe/recipe.yaml", "--against", "set", "--frames", "2", cwd=tmp_path, code=1)
    assert other.startswith("FAIL")


@pytest.mark.slow
def test_a_pack_contains_its_assets(tmp_path: Path) -> None:
    """Without the recipe's folder, the pack has the same plan and pixels."""
    shutil.copytree(GOOD, tmp_path / "here")
    run("pack", "here/recipe.yaml", "-o", "away.recipe", cwd=tmp_path)
    shot = ("--variant", "poster=on_mesh,wedge=there", "--frame", "1", "--json")
    expected = [json.loads(run("plan", "here/recipe.yaml", "--json", cwd=tmp_path))["digest"]]
    expected.append(json.loads(run("shot", "here/recipe.yaml", *shot, "-o", "a.png", cwd=tmp_path))["digest"])
    shutil.rmtree(tmp_path / "here")
    found = [json.loads(run("plan", "away.recipe", "--json", cwd=tmp_path))["digest"]]
    found.append(json.loads(run("shot", "away.recipe", *shot, "-o", "b.png", cwd=tmp_path))["digest"])
    assert found == expected
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "content", "words"),
    [
        ("a.obj", b"mtllib /etc/passwd\n", "`mtllib` names another file"),
        ("a.glb", b"glTF\2\0\0\0\xff\xff\xff\x7f" + b"\0" * 8, "its header states 2147483647 bytes"),
        ("../../etc/passwd.obj", b"", "`..` is refused: a recipe reads only files of its own folder"),
        ("gone.stl", b"", "there is no such file"),
    ],
)
def test_an_invalid_asset_in_a_pack_is_refused_with_its_place(
    path: str, content: bytes, words: str, tmp_path: Path
) -> None:
    from recipe_runtime.transfer.bundle import Pack

    text = (GOOD / "recipe.yaml").read_text().replace("files/tetrahedron.obj, up: z", path)
    files = {file.relative_to(GOOD).as_posix(): file.read_bytes() for file in sorted(GOOD.rglob("*.*"))}
    del files["files/tetrahedron.obj"]  # (the recipe no longer names it, and a pack may have no unused file)
    files |= {"recipe.yaml": text.encode(), **({path: content} if content else {})}
    (tmp_path / "evil.recipe").write_bytes(Pack("recipe.yaml", files).dumps())
    reported = run("build", "evil.recipe", "--out", "set", cwd=tmp_path, code=2)
    assert "\n --> evil.recipe/recipe.yaml:5:" in reported and words in reported
    assert [file.name for file in tmp_path.iterdir()] == ["evil.recipe"]
