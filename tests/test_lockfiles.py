"""Each lockfile has the plan of its recipe, and the recipes of the paper and of attacks have lockfiles."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir import lockfile
from recipe_runtime.verify.compare import compare_plans, compare_rows

from tests.compiler.test_cases import assert_consistent
from tests.sources import ROOT

LOCKFILES = sorted((ROOT / "lockfiles").glob("*.lock"))


def commands(target: str) -> list[list[str]]:
    """Return the `recipe` commands of a make target, as words, without running them."""
    plain = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    done = subprocess.run(
        ["make", "-n", target, "PYTHON=python3"],  # given, so that make does not search for one
        cwd=ROOT,
        env=plain,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return [line.split() for line in done.stdout.splitlines() if line.split()[:1] == [".venv/bin/recipe"]]


@pytest.fixture(scope="module")
def locked() -> list[Path]:
    """Return the recipes of `make lock`."""
    (command,) = commands("lock")
    assert command[1:3] == ["lock", "--update"]
    return [ROOT / word for word in command[3:]]


def test_studies_and_attacks_are_locked(locked: list[Path]) -> None:
    """Only wall.yaml, the scene that studies extend, has none."""
    studies = {path for folder in ("paper", "attacks") for path in (ROOT / "recipes" / folder).glob("*.yaml")}
    assert studies - {ROOT / "recipes/paper/wall.yaml"} <= set(locked)
    assert len(set(locked)) == len(locked)


def test_exactly_the_locked_recipes_have_a_lockfile(locked: list[Path]) -> None:
    names = {path.stem for path in LOCKFILES}
    assert names <= {path.stem for path in locked}
    missing = [path for path in locked if path.stem not in names]
    assert not missing, "run `make lock`"


def test_every_lockfile_is_verified(locked: list[Path]) -> None:
    """`make verify` verifies all lockfiles; `make test` those of two recipes and some of patches."""
    (whole,) = commands("verify")
    assert [ROOT / word for word in whole[2:]] == locked
    drawn = {Path(word).stem for command in commands("test") for word in command if word.endswith((".yaml", ".lock"))}
    assert {"weather_sweep", "two_pedestrians"} <= drawn <= {path.stem for path in locked}
    assert {"insertion", "painted_car"} & {path.stem for path in LOCKFILES} <= drawn


@pytest.mark.slow
@pytest.mark.parametrize("path", LOCKFILES, ids=lambda path: path.stem)
def test_a_lockfile_has_the_plan_and_the_rows_of_its_recipe(path: Path, locked: list[Path]) -> None:
    """After a change of a recipe or of its plan, run `make lock`; this test renders no frames."""
    recipe = (path.parent / lockfile.read_source(path)).resolve()
    assert recipe in locked
    compiled = compile_recipe(recipe)
    assert_consistent(compiled)
    plan = compiled.plan
    lock = lockfile.read(path)
    assert path.stem == plan.recipe == lock.recipe
    assert compare_plans(plan, lock) + compare_rows(plan, lock) == []
