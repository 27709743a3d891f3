"""A build loses no file of the user while it puts a dataset in place of another, wherever it is stopped."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan
from recipe_runtime.build import pipeline, reuse, workspace
from recipe_runtime.build.pipeline import BuildResult, build
from recipe_runtime.core import subprocesses
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames.engines import Engines

from tests.runtime.fakes import ENGINES, dataset_plan, scene_plan, simulate, tree

OLD, NEW = dataset_plan(frames=2, weathers=1), dataset_plan(frames=3, weathers=1)


def made(folder: Path, plan: DatasetPlan = NEW, engines: Engines = ENGINES) -> BuildResult:
    return build(plan, folder / "tiny", workers=0, cache=folder / "cache", engines=engines)


@pytest.mark.slow
def test_a_build_that_is_killed_at_any_change_of_a_folder_is_resumed(tmp_path: Path) -> None:
    """From the move of the old dataset on: afterwards there is one of the two, complete, and nothing else."""
    old, new = tree(made(tmp_path / "old", OLD).path), tree(made(tmp_path / "new").path)
    made(tmp_path / "count", OLD)
    last = _changes(tmp_path / "count", 0)
    found = set[str]()
    for change in (1, 2, 3, 4, last // 2, last - 2, last - 1, last):
        folder = tmp_path / str(change)
        made(folder, OLD)
        assert _changes(folder, change) == change
        workspace.Workspace.settle(folder / "tiny")
        files = tree(folder / "tiny")
        found.add("old" if files == old else "new")
        assert files in (old, new) and tree(made(folder).path) == new
        assert not (folder / ".tiny.partial").exists()
    assert found == {"old", "new"}


def _changes(folder: Path, most: int) -> int:
    """Build in a child process that is killed at the n-th change of a folder, from the move of the old dataset on.

    Returns:
        The number of changes.
    """
    child = os.fork()
    if child == 0:
        count = 0

        def audit(event: str, arguments: tuple[object, ...]) -> None:
            nonlocal count
            moved = event == "os.rename" and str(arguments[0]) == str(folder / "tiny")
            if (count or moved) and event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir"):
                count += 1
                if count == most:
                    os._exit(count)

        sys.addaudithook(audit)
        try:
            made(folder)
            os._exit(count)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.slow
def test_a_file_added_just_before_the_rename_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = made(tmp_path, OLD).path
    rename = Path.rename

    def renamed(path: Path, target: Path) -> Path:
        if path == out:
            (out / "notes.txt").write_text("mine")
        return rename(path, target)

    with monkeypatch.context() as patch, pytest.raises(InputError, match="tiny holds a file that is not the dataset"):
        patch.setattr(Path, "rename", renamed)
        made(tmp_path)
    assert (out / "notes.txt").read_text() == "mine"
    (out / "notes.txt").unlink()
    assert made(tmp_path).made_frames == 0


@pytest.mark.slow
@pytest.mark.parametrize("there", [False, True])
def test_a_dataset_that_arrives_during_the_build_is_not_replaced(tmp_path: Path, there: bool) -> None:
    """Regression: what is at the place was examined before the work only."""
    other = made(tmp_path / "other", dataset_plan(frames=1, weathers=1)).path
    if there:
        made(tmp_path, OLD)

    def simulated(scene: ScenePlan) -> Trace:
        shutil.rmtree(tmp_path / "tiny", ignore_errors=True)
        shutil.copytree(other, tmp_path / "tiny")
        return simulate(scene)

    with pytest.raises(InputError, match="tiny was written by another program during the build"):
        made(tmp_path, engines=replace(ENGINES, simulate=simulated))
    assert tree(tmp_path / "tiny") == tree(other)
    assert made(tmp_path).made_frames == 0  # the work is kept


@pytest.mark.slow
def test_an_interrupt_between_the_renames_leaves_the_old_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = tree(made(tmp_path, OLD).path)

    def interrupted(folder: Path, name: Path) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(workspace, "check_files", interrupted)
        made(tmp_path)
    assert tree(tmp_path / "tiny") == before


@pytest.mark.slow
@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("path", ["notes.txt", "old/notes.txt", "old"])
def test_files_of_others_in_a_work_folder_are_kept(tmp_path: Path, there: bool, path: str) -> None:
    """Regression: they were deleted, or published as the dataset."""
    if there:
        made(tmp_path, OLD)
    partial = tmp_path / ".tiny.partial"
    (partial / path).parent.mkdir(parents=True)
    (partial / "job.json").write_text("{}")
    (partial / path).write_text("mine")
    with pytest.raises(InputError, match=r"\.tiny\.partial.* holds .*; move it away"):
        made(tmp_path)
    assert (partial / path).read_text() == "mine"
    assert (tmp_path / "tiny").exists() == there
    assert not there or not made(tmp_path, OLD).built  # an existing dataset can be used all the same


def test_a_build_that_was_killed_as_it_began_does_not_block_the_next(tmp_path: Path) -> None:
    (tmp_path / ".tiny.partial").mkdir()
    (tmp_path / ".tiny.partial" / ".job.json.123.0.tmp").write_text("{")
    assert made(tmp_path).built
    assert not (tmp_path / ".tiny.partial").exists()


@pytest.mark.slow
def test_a_dataset_that_is_moved_away_at_once_is_reported_as_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:

    def moved(*arguments: object) -> None:
        (tmp_path / "tiny").rename(tmp_path / "moved")
        reuse.remember(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(pipeline, "remember", moved)
    result = made(tmp_path)
    assert result.built and result.identity in (tmp_path / "moved" / "manifest.json").read_text()


@pytest.mark.slow
def test_an_error_ends_running_simulations(tmp_path: Path) -> None:
    """Regression: a build that was stopped waited for them, up to an hour."""
    scenes = {name: scene_plan(2, speed) for name, speed in (("fast", 2.0), ("faster", 3.0), ("fastest", 4.0))}
    others = [OLD.variants[0].model_copy(update={"variant": name, "scene": scene}) for name, scene in scenes.items()]
    variants = *OLD.variants, *others
    fields = {name: getattr(OLD, name) for name in DatasetPlan.model_fields} | {"variants": variants}
    plan, ended, started = DatasetPlan(**fields), list[int](), threading.Event()

    def simulated(scene: ScenePlan) -> Trace:
        if scene.digest == OLD.variants[0].scene.digest:
            started.wait(20)
            raise KeyboardInterrupt
        child = subprocess.Popen(["sleep", "20"])
        with subprocesses.registered(child):
            started.set()
            ended.append(child.wait())
        return simulate(scene)

    with pytest.raises(KeyboardInterrupt):
        made(tmp_path, plan, replace(ENGINES, simulate=simulated))
    assert set(ended) == {-9} and len(ended) < 3  # the last one never started
