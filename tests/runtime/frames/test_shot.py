"""`recipe shot` has the pixels of the full build, and simulates only up to its frame."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.cache.store import Store
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames import engines
from recipe_runtime.frames.shot import shot
from recipe_runtime.meshes.mesh import Mesh

from tests.cli.test_commands import RECIPE
from tests.runtime.fakes import ENGINES, dataset_plan, simulate
from tests.runtime.frame_source import FrameSource

Parts = tuple[tuple[str, Mesh], ...]
FRAMES = 12
SCENARIO = dataset_plan(frames=FRAMES, weathers=1).variants[
    1
]  # the shaky one: its sensor has another pose in each frame


class Counting:
    """Engines that record how many frames each simulation has."""

    def __init__(self) -> None:
        self.simulated: list[int] = []
        self.engines = replace(ENGINES, simulate=self._simulate)

    def _simulate(self, scene: ScenePlan) -> Trace:
        self.simulated.append(scene.clock.frames)
        return simulate(scene)


@pytest.mark.slow
@given(frame=st.integers(0, FRAMES - 1), modality=st.sampled_from(["rgb", "depth", "instance", "semantic"]))
@settings(max_examples=20, deadline=None)
def test_a_shot_equals_the_frame_of_the_build_and_simulates_no_further(frame: int, modality: str) -> None:
    counting = Counting()
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        made = [shot(SCENARIO, "street", frame, modality, engines=counting.engines, store=store) for _ in range(2)]
    whole = FrameSource(SCENARIO, simulate(SCENARIO.scene), engines=ENGINES).render("street", frame)[modality]
    assert all(np.array_equal(one.pixels, whole) for one in made)
    assert counting.simulated == [max(frame, 1) + 1]  # the second shot used the stored Trace


def test_a_stored_full_trace_is_used_and_a_shorter_one_is_not_stored_as_full(tmp_path: Path) -> None:
    counting, store = Counting(), Store(tmp_path)
    shot(SCENARIO, frame=4, engines=counting.engines, store=store)
    assert not store.has_trace(SCENARIO.scene)
    store.trace(SCENARIO.scene, lambda: simulate(SCENARIO.scene))
    shot(SCENARIO, frame=7, engines=counting.engines, store=store)
    assert counting.simulated == [5]


@given(frames=st.integers(1, 2 * FRAMES))
def test_the_first_frames_of_a_scene_have_their_own_digest(frames: int) -> None:
    scene = SCENARIO.scene
    part = scene.first(frames)
    assert part.clock.frames == min(frames, FRAMES)
    assert (part.digest == scene.digest) is (frames >= FRAMES)
    assert part.model_dump(exclude={"clock"}) == scene.model_dump(exclude={"clock"})


@pytest.mark.parametrize("as_json", [False, True])
def test_the_command_shows_progress_except_with_json(
    as_json: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: a shot of a late frame printed nothing during the simulation."""
    from click.testing import CliRunner
    from recipe_cli.commands import shot as module
    from recipe_cli.progress import Progress

    stages: list[tuple[str, bool]] = []

    class Noting(Progress):
        def __init__(self, quiet: bool = False) -> None:
            super().__init__(quiet)
            self._quiet = quiet

        def __call__(self, stage: str, done: int, total: int) -> None:
            stages.append((stage, self._quiet))

    def engines_for(compiled: object, simulated: Callable[[int, int], None]) -> engines.Engines:
        def simulating(scene: ScenePlan) -> Trace:
            simulated(1, 2)
            return simulate(scene)

        return replace(ENGINES, simulate=simulating)

    (tmp_path / "small.yaml").write_text(RECIPE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(module, "Progress", Noting)
    monkeypatch.setattr(module, "engines_for", engines_for)
    done = CliRunner().invoke(module.command, ["small.yaml", *(["--json"] if as_json else [])], catch_exceptions=False)
    assert done.exit_code == 0
    assert stages == [("simulate", as_json), ("render", as_json), ("render", as_json)]


def test_an_error_while_loading_the_scene_is_the_error_of_the_shot(tmp_path: Path) -> None:
    def broken(scene: ScenePlan, device: str) -> NoReturn:
        raise ArithmeticError("the scene has no ground")

    with pytest.raises(ArithmeticError, match="no ground"):
        shot(SCENARIO, engines=replace(ENGINES, renderer=broken), store=Store(tmp_path))
