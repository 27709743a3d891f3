"""A lock after a build renders nothing again; a copied dataset can be verified and built again from its own files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from recipe_runtime.transfer import bundle

from tests.cli.runner import run_here
from tests.cli.test_commands import RECIPE


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recipe that extends another, its dataset, and a lockfile written after the build."""
    root = tmp_path_factory.mktemp("project")
    (root / "parts").mkdir()
    (root / "parts" / "base.yaml").write_text(RECIPE)
    (root / "small.yaml").write_text("recipe: small\nextends: parts/base.yaml\ndescription: '<script>a</script>'\n")
    built = run_here("build", "small.yaml", cwd=root)
    assert built.returncode == 0, built.stderr
    return root


@pytest.mark.slow
def test_a_lock_after_a_build_reuses_its_frames_and_equals_a_lock_without_it(project: Path) -> None:
    locked = run_here("lock", "small.yaml", cwd=project)
    assert locked.returncode == 0, locked.stderr
    assert "4 frames reused from the dataset built here\n" in locked.stdout
    text = (project / "lockfiles/small.lock").read_text()
    (project / "lockfiles/small.lock").unlink()
    shutil.move(project / "datasets", project / "elsewhere")
    try:
        fresh = run_here("lock", "small.yaml", cwd=project)
    finally:
        shutil.move(project / "elsewhere", project / "datasets")
    assert fresh.returncode == 0 and "taken over" not in fresh.stdout
    assert (project / "lockfiles/small.lock").read_text() == text


@pytest.mark.slow
def test_a_copied_dataset_is_verified_and_built_again_from_itself(project: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(project / "datasets/small", tmp_path / "copy")
    assert set(bundle.read(copy / "small.recipe").files) == {"small.yaml", "parts/base.yaml"}
    readme = (copy / "README.md").read_text()
    assert "<script>" not in readme and "recipe build small.recipe" in readme
    verified = run_here("verify", copy, cwd=tmp_path)
    assert verified.returncode == 0 and verified.stdout.startswith("PASS"), verified.stdout + verified.stderr
    built = run_here("build", copy / "small.recipe", "--out", "again", "--json", cwd=tmp_path)
    assert built.returncode == 0, built.stderr
    assert json.loads(built.stdout)["identity"] == json.loads((copy / "manifest.json").read_text())["identity"]
    with (copy / "small.recipe").open("ab") as file:
        file.write(b"changed")
    changed = run_here("verify", copy, "--integrity", cwd=tmp_path)
    assert changed.returncode == 1 and "small.recipe" in changed.stdout
