"""A recipe opened in Python gives the files of a build, in any order of frames and in any process."""

from __future__ import annotations

import json
import os
import pickle
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np
import pytest
import recipe_runtime
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.frames.engines import Engines, SceneRenderer
from recipe_runtime.loading import compiled
from recipe_runtime.modalities import declared
from recipe_runtime.scenario import Scenario, Scenes

from tests.runtime.fakes import ENGINES, dataset_plan
from tests.sources import ROOT

TINY = ROOT / "tests" / "golden" / "tiny.yaml"
RAIN = "weather=rain"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the smallest dataset made by the real engines."""
    return build(compiled(TINY), tmp_path_factory.mktemp("built") / "tiny", BuildOptions(workers=0)).path


def _read(path: Path) -> NDArray[np.generic]:
    """Read a PNG with Pillow, an independent reader."""
    with Image.open(path) as picture:
        return np.array(picture)


@pytest.mark.slow
def test_rendered_on_demand_equals_the_built_files(built: Path) -> None:
    scenario = recipe_runtime.open(TINY, RAIN)
    assert (len(scenario), scenario.sensors) == (4, ("street", "dash"))
    for frame in (3, 0, 2):  # not in the build's order
        for sensor in reversed(scenario.sensors):
            for modality in reversed(scenario.modalities(sensor)):
                ours = scenario.render(frame, sensor, modality)
                file = _read(built / layout.frame_file(RAIN, sensor, modality, frame, {}))
                ours = declared(modality).files["png"].store(ours)
                np.testing.assert_array_equal(ours, file, err_msg=f"{frame} {sensor} {modality}")


@pytest.mark.slow
def test_labels_on_demand_equal_the_built_ones(built: Path) -> None:
    lines = (built / layout.labels_file(RAIN, "street")).read_text().splitlines()
    scenario = recipe_runtime.open(TINY, RAIN)
    assert scenario[2].labels("street") == json.loads(lines[2])["objects"]
    assert scenario[2].calibration("street") == json.loads(lines[2])["calibration"]


@pytest.mark.slow
@pytest.mark.parametrize("use_streams", [False, True])
def test_a_stream_equals_frames_rendered_one_by_one(use_streams: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """This includes the frame stream for GPUs, run on the CPU here."""
    scenario, again = recipe_runtime.open(TINY, RAIN), recipe_runtime.open(TINY, RAIN)
    monkeypatch.setattr(scenario._scenes.source(scenario.plan.scene), "use_streams", use_streams)
    for sensor in scenario.sensors:
        seen = []
        for number, arrays in scenario.stream(sensor, [2, 0, -1]):
            seen.append(number)
            assert tuple(sorted(arrays)) == tuple(sorted(scenario.modalities(sensor)))
            for modality, array in arrays.items():
                np.testing.assert_array_equal(array, again.render(number, sensor, modality))
        assert seen == [2, 0, 3]


@pytest.mark.slow
@pytest.mark.parametrize("use_streams", [False, True])
def test_two_streams_at_once_do_not_mix(use_streams: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Optical flow reads pairs of consecutive frames, for example."""
    scenario = recipe_runtime.open(TINY, RAIN)
    monkeypatch.setattr(scenario._scenes.source(scenario.plan.scene), "use_streams", use_streams)
    for (n, one), (m, other) in zip(scenario.stream(frames=range(3)), scenario.stream(frames=range(1, 4)), strict=True):
        assert (n + 1, m) == (m, n + 1)
        np.testing.assert_array_equal(one["rgb"], scenario.render(n))
        np.testing.assert_array_equal(other["rgb"], scenario.render(m))


def _fake(disk_cache: Path | None = None) -> Scenario:
    plan = dataset_plan(frames=6)
    return Scenario(plan.variants[0], Scenes(engines=ENGINES), disk_cache)


def test_frames_are_a_sequence() -> None:
    scenario = _fake()
    assert [f.number for f in scenario] == list(range(6)) == [f.number for f in scenario[:]]
    assert scenario[-1].number == 5
    assert scenario[3].time == 3 / scenario.plan.scene.clock.fps
    for wrong in (6, -7):
        with pytest.raises(IndexError, match="has frames 0 to 5"):
            scenario[wrong]
    np.testing.assert_array_equal(scenario.render(cast(int, np.int64(2))), scenario.render(2))
    for value in (1.5, "2", True, None):
        with pytest.raises(TypeError, match=f"a frame is a whole number, not {value!r}"):
            scenario.render(value)  # type: ignore[arg-type]


def test_errors_for_unknown_names_list_the_valid_ones() -> None:
    scenario = _fake()
    with pytest.raises(InputError, match="no sensor 'roof'; it has street"):
        scenario.render(0, "roof")
    with pytest.raises(InputError, match=r"does not capture 'thermal'"):
        scenario.render(0, "street", "thermal")
    with pytest.raises(InputError, match="no variant 'weather=rains'; did you mean 'weather=rain'"):
        recipe_runtime.open(TINY, "weather=rains")


def test_the_caller_can_change_returned_arrays() -> None:
    scenario = _fake()
    first = scenario.render(1, modality="instance")
    before = first.copy()
    first[:] = 7
    np.testing.assert_array_equal(scenario.render(1, modality="instance"), before)


def test_a_scenario_can_be_pickled() -> None:
    scenario = _fake()
    expected = scenario.render(2)
    sent: Scenario = pickle.loads(pickle.dumps(scenario))
    np.testing.assert_array_equal(sent.render(2), expected)


def test_a_forked_process_creates_its_own_engines(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []

    def renderer(scene: ScenePlan, device: str) -> SceneRenderer:
        made.append(os.getpid())
        return ENGINES.renderer(scene, device)

    scenario = Scenario(
        dataset_plan(frames=6).variants[0], Scenes(engines=Engines(ENGINES.simulate, ENGINES.actors, renderer))
    )
    scenario.render(0)
    scenario.render(1)
    assert len(made) == 1
    monkeypatch.setattr(os, "getpid", lambda: -1)  # as after a fork
    scenario.render(2)
    assert made[1:] == [-1]


def test_threads_take_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: one thread overwrote the buffers of another, and a sixth of the pictures were wrong."""
    busy, expected = threading.Lock(), [_fake().render(frame) for frame in range(6)]

    def alone(call: Callable[..., Any]) -> Callable[..., Any]:
        def called(*arguments: Any, **named: Any) -> Any:
            assert busy.acquire(blocking=False), "two threads render"
            try:
                time.sleep(0.002)
                return call(*arguments, **named)
            finally:
                busy.release()

        return called

    def renderer(scene: ScenePlan, device: str) -> SceneRenderer:
        made = ENGINES.renderer(scene, device)
        for name in ("observe", "shade"):
            monkeypatch.setattr(made, name, alone(getattr(made, name)))
        return made

    engines = Engines(ENGINES.simulate, ENGINES.actors, renderer)
    scenario = Scenario(dataset_plan(frames=6).variants[0], Scenes(engines=engines))
    with ThreadPoolExecutor(3) as threads:
        streamed = threads.submit(lambda: [arrays["rgb"].copy() for _, arrays in scenario.stream()])
        labels = threads.submit(lambda: [scenario.labels(frame) for frame in range(6)])
        rendered = list(threads.map(scenario.render, range(6)))
    np.testing.assert_array_equal(rendered, expected)
    np.testing.assert_array_equal(streamed.result(), expected)
    assert all(labels.result())


def test_a_forked_process_does_not_wait_for_a_thread_of_its_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = _fake()
    expected = scenario.render(1)
    with scenario._scenes.exclusive(), ThreadPoolExecutor(1) as child:
        monkeypatch.setattr(os, "getpid", lambda: -1)  # as after a fork, when another thread held the lock
        np.testing.assert_array_equal(child.submit(scenario.render, 1).result(timeout=20), expected)


def test_a_view_of_a_frame_does_not_keep_its_scene_in_memory() -> None:
    """It keeps the lock, which must not refer to the renderers, or to the lease of the cache."""
    scenes = Scenes(engines=ENGINES)
    gone, _lock = weakref.ref(scenes), scenes.exclusive
    del scenes
    assert gone() is None


def test_the_disk_cache_is_used_except_for_damaged_entries(tmp_path: Path) -> None:
    expected = _fake().render(3)
    _fake(disk_cache=tmp_path).render(3)
    (entry,) = tmp_path.glob("pixels/*/*")
    body = entry.read_bytes()

    def nothing(*_: object) -> NoReturn:
        raise AssertionError("rendered again")

    cached = Scenario(
        dataset_plan(frames=6).variants[0], Scenes(engines=Engines(nothing, ENGINES.actors, nothing)), tmp_path
    )
    np.testing.assert_array_equal(cached.render(3), expected)
    entry.write_bytes(body[:-1] + bytes([body[-1] ^ 1]))
    np.testing.assert_array_equal(_fake(disk_cache=tmp_path).render(3), expected)
    assert entry.read_bytes() == body


def test_the_disk_cache_separates_weathers_and_shares_labels(tmp_path: Path) -> None:
    plan = dataset_plan(frames=6, weathers=2)
    first, second = (Scenario(v, Scenes(engines=ENGINES), tmp_path) for v in (plan.variants[0], plan.variants[2]))
    for scenario in (first, second):
        scenario.render(0, modality="rgb")
        scenario.render(0, modality="depth")
    assert len(list(tmp_path.glob("pixels/*/*"))) == 3
    assert (first.render(0) != second.render(0)).any()


@pytest.fixture(scope="module")
def wanted() -> list[NDArray[np.generic]]:
    """Return the frames of a scenario without interruption."""
    with recipe_runtime.open(TINY, variant=RAIN) as fresh:
        return [fresh.render(frame) for frame in range(4)]


@pytest.mark.slow
@pytest.mark.parametrize("before", [4, 16, 28, 40])
def test_an_interrupted_frame_discards_its_renderer(
    wanted: list[NDArray[np.generic]], before: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The renderer's caches may then be incomplete, so it must not be used again."""
    from recipe_runtime.render.device.setup import wp

    launch, launches = wp.launch, 0

    def stops(*arguments: Any, **named: Any) -> None:
        nonlocal launches
        launches += 1
        if launches == before:
            raise KeyboardInterrupt
        launch(*arguments, **named)

    with recipe_runtime.open(TINY, variant=RAIN) as scenario:
        scenario.render(0)
        stopped = scenario._scenes.source(scenario.plan.scene).renderer
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(wp, "launch", stops)
            for frame in (1, 2, 3):
                scenario.render(frame)
        for frame in (2, 3, 1, 0):
            assert (scenario.render(frame) == wanted[frame]).all()
        assert scenario._scenes.source(scenario.plan.scene).renderer is not stopped
