"""A build loses no file of the user when it puts a dataset in place of another folder."""

from __future__ import annotations

import subprocess
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan
from recipe_runtime.build.pipeline import BuildOptions, BuildResult, build
from recipe_runtime.core import subprocesses
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames.engines import Engines

from tests.runtime.fakes import ENGINES, dataset_plan, scene_plan, simulate

OLD, NEW = dataset_plan(frames=2, weathers=1), dataset_plan(frames=3, weathers=1)


def made(folder: Path, plan: DatasetPlan = NEW, engines: Engines = ENGINES, **options: Any) -> BuildResult:
    return build(plan, folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=engines, **options))


@pytest.mark.slow
def test_a_replaced_dataset_with_a_file_of_the_user_is_kept(tmp_path: Path) -> None:
    """A file was added to the first dataset, and one of the second was edited."""
    notices = list[str]()
    first = made(tmp_path, OLD, notice=notices.append).path
    (first / "preview" / "notes.txt").write_text("mine")
    second = made(tmp_path, NEW, notice=notices.append)
    assert (tmp_path / "tiny.replaced/preview/notes.txt").read_text() == "mine"
    (second.path / "README.md").write_text("mine")
    made(tmp_path, OLD, notice=notices.append)
    assert (tmp_path / "tiny.replaced.2/README.md").read_text() == "mine"
    assert [notice.rpartition(" ")[2] for notice in notices] == [f"{first}.replaced", f"{first}.replaced.2"]


@pytest.mark.slow
def test_a_folder_that_is_no_dataset_is_replaced_only_on_request(tmp_path: Path) -> None:
    thesis = tmp_path / "tiny" / "thesis.tex"
    thesis.parent.mkdir()
    thesis.write_text("years of work")
    for text, message in ((None, "it has no manifest.json"), ("{}", "its manifest.json cannot be read")):
        if text is not None:
            (tmp_path / "tiny" / "manifest.json").write_text(text)
        with pytest.raises(InputError, match=f"tiny holds files that are not known to be a dataset: {message}"):
            made(tmp_path)
        assert thesis.read_text() == "years of work"
    assert made(tmp_path, replace=True).built
    assert (tmp_path / "tiny.replaced" / "thesis.tex").read_text() == "years of work"


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
