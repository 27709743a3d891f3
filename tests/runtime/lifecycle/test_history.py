"""`recipe bisect` names the commit at which a frame changed, and why, from the lockfiles of a real git repository."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from recipe_compiler.ir.lockfile import Lockfile
from recipe_runtime.lifecycle.history import Pixel, changes
from recipe_runtime.verify.locking import lock

from tests.cli.runner import run_here
from tests.runtime import fakes
from tests.runtime.fakes import quiet

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")

PLAN = fakes.dataset_plan(frames=3, weathers=2)
VARIANT = PLAN.variants[0].variant
SENSOR = PLAN.variants[0].rig.sensors[0].name


def git(folder: Path, *arguments: str) -> str:
    who = ["-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false"]
    done = subprocess.run(["git", *who, *arguments], cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def commit(folder: Path, found: Lockfile, subject: str) -> str:
    (folder / "tiny.lock").write_text(found.dumps())
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "--allow-empty", "-m", subject)
    return git(folder, "rev-parse", "HEAD")


@pytest.fixture(scope="module")
def locked() -> Lockfile:
    return lock(PLAN, "tiny.yaml", {"tiny.yaml": "a" * 64}, workers=0, progress=quiet, engines=fakes.ENGINES)


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    git(tmp_path, "init", "-q")
    return tmp_path


def with_frame(found: Lockfile, frame: int, digest: str) -> Lockfile:
    key = found.variants[VARIANT].frame_key("rgb"), SENSOR, "rgb", frame
    return replace(found, frames={**found.frames, key: digest * 64})


def test_the_commits_and_causes_of_changes(repository: Path, locked: Lockfile) -> None:
    first = commit(repository, locked, "Lock")
    commit(repository, replace(locked, files={"tiny.yaml": "b" * 64}), "Add a comment")
    other = commit(repository, with_frame(locked, 1, "c"), "Change another frame")
    code = commit(repository, with_frame(with_frame(locked, 1, "c"), 2, "d"), "Change the renderer")
    trace = dict.fromkeys(locked.traces, "e" * 64)
    moved = commit(repository, replace(with_frame(locked, 2, "e"), traces=trace), "Change the motion")
    found = list(changes(repository / "tiny.lock", Pixel(VARIANT, SENSOR, "rgb", 2)))
    assert [(c.commit, c.subject) for c in found] == [
        (first, "Lock"),
        (code, "Change the renderer"),
        (moved, "Change the motion"),
    ]
    assert [c.cause for c in found] == [
        "it was added",
        "the code changed, and plan and motion did not",
        "the motion changed, and the plan did not",
    ]
    since = list(changes(repository / "tiny.lock", Pixel(VARIANT, SENSOR, "rgb", 2), start=other))
    assert [c.commit for c in since] == [code, moved]


def test_a_change_of_the_plan_names_its_part_and_the_files(repository: Path, locked: Lockfile) -> None:
    commit(repository, locked, "Lock")
    rows = {name: replace(row, appearance="f" * 64) for name, row in locked.variants.items()}
    key = rows[VARIANT].frame_key("rgb"), SENSOR, "rgb", 0
    changed = replace(locked, variants=rows, frames={**locked.frames, key: "1" * 64}, files={"tiny.yaml": "b" * 64})
    commit(repository, changed, "Change the weather")
    *_, last = changes(repository / "tiny.lock", Pixel(VARIANT, SENSOR, "rgb", 0))
    assert last.cause == "the plan changed: appearance (files: tiny.yaml)"


def test_a_lockfile_of_an_unknown_format_is_passed_over(repository: Path, locked: Lockfile) -> None:
    (repository / "tiny.lock").write_text("recipe-lock 0\n")
    git(repository, "add", "-A")
    git(repository, "commit", "-q", "-m", "An old format")
    first = commit(repository, locked, "Lock")
    assert [c.commit for c in changes(repository / "tiny.lock", Pixel(VARIANT, SENSOR, "rgb", 0))] == [first]


def test_the_command(repository: Path, locked: Lockfile) -> None:
    first = commit(repository, locked, "Lock")
    done = run_here("bisect", "tiny.lock", "--variant", VARIANT, "--json", cwd=repository)
    assert [c["commit"] for c in json.loads(done.stdout)["changes"]] == [first]
    assert "no commit changed it since" in run_here("bisect", "tiny.lock", "--since", "HEAD", cwd=repository).stdout
    for arguments, words in (
        (["--frame", "99"], "has no frame 99"),
        (["--variant", "x"], "has no frame 0 of rgb"),
        (["--since", "nowhere"], "nowhere"),
        (["--since=--output=x"], "is not a revision"),
    ):
        refused = run_here("bisect", "tiny.lock", *arguments, cwd=repository)
        assert refused.returncode == 2 and words in refused.stderr, refused.stderr
    assert not (repository / "x").exists()


def test_outside_of_a_repository(tmp_path: Path, locked: Lockfile) -> None:
    (tmp_path / "tiny.lock").write_text(locked.dumps())
    done = run_here("bisect", "tiny.lock", cwd=tmp_path, GIT_CEILING_DIRECTORIES=str(tmp_path.parent))
    assert done.returncode == 2 and "name a lockfile in a git repository" in done.stderr
