"""A build after a change of the recipe renders only changed frames, and equals a new build byte for byte."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, DatasetPlan, RigPlan
from recipe_runtime.build import reuse as reuse_module
from recipe_runtime.build.pipeline import BuildOptions, BuildResult, build
from recipe_runtime.core.transforms import Array
from recipe_runtime.frames.engines import Engines

from tests.runtime.fakes import ENGINES, Renderer, Seen, dataset_plan, sensor_plan, tree

Calls = list[tuple[str, float | None]]
Explain = Callable[[list[str]], None]


def counting(calls: Calls) -> Engines:
    """Return engines that record their calls, in this process only."""

    class Counted(Renderer):
        def observe(
            self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32] | None = None
        ) -> Seen:
            calls.append(("observe", None))
            return super().observe(camera, world_from_sensor, parts)

        def picture(self, obs: Seen, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
            calls.append(("shade", appearance.weather.cloudiness))
            return super().picture(obs, appearance, frame)

    return replace(ENGINES, renderer=lambda scene, device: Counted(scene))


def _build(folder: Path, plan: DatasetPlan, calls: Calls | None = None, explain: Explain | None = None) -> BuildResult:
    calls = calls if calls is not None else []
    calls.clear()
    engines = counting(calls)
    return build(
        plan, folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=engines, explain=explain)
    )


def _fresh(folder: Path, plan: DatasetPlan) -> dict[str, bytes]:
    return tree(_build(folder, plan).path)


def _changed(plan: DatasetPlan, **update: object) -> DatasetPlan:
    """Return the plan with other values and without cached digests."""
    return DatasetPlan.model_validate_json(plan.model_copy(update=update).model_dump_json())


@pytest.mark.slow
def test_one_changed_weather_renders_one_appearance(tmp_path: Path) -> None:
    calls: Calls = []
    first, second = dataset_plan(frames=6, weathers=2), dataset_plan(frames=6, weathers=3)
    _build(tmp_path / "a", first, calls)
    assert {c for what, c in calls if what == "shade"} == {0.0, 10.0}
    changed = _build(tmp_path / "a", second, calls)
    assert {c for what, c in calls if what == "shade"} == {20.0}
    assert sum(what == "shade" for what, _ in calls) == 3 * 6  # street still, street shaky, side
    assert tree(changed.path) == _fresh(tmp_path / "b", second)


@pytest.mark.slow
def test_a_removed_value_and_a_renamed_variant_render_nothing(tmp_path: Path) -> None:
    calls: Calls = []
    _build(tmp_path / "a", dataset_plan(frames=6, weathers=3))
    less = dataset_plan(frames=6, weathers=1)
    renamed = tuple(v.model_copy(update={"variant": v.variant.replace("w0", "dry")}) for v in less.variants)
    changed_plan = _changed(less, variants=renamed)
    changed = _build(tmp_path / "a", changed_plan, calls)
    assert calls == []
    assert tree(changed.path) == _fresh(tmp_path / "b", changed_plan)


@pytest.mark.slow
def test_a_new_sensor_does_not_render_the_others_again(tmp_path: Path) -> None:
    calls: Calls = []
    plan = dataset_plan(frames=6, weathers=1)
    _build(tmp_path / "a", plan)
    side = sensor_plan("side", capture=("rgb",), frames=6)
    moved = []
    for variant in plan.variants:
        kept = next(s for s in variant.rig.sensors if s.name == "street")
        moved.append(variant.model_copy(update={"rig": RigPlan(sensors=(kept, side))}))
    changed_plan = _changed(plan, variants=tuple(moved))
    changed = _build(tmp_path / "a", changed_plan, calls)
    assert sum(what == "observe" for what, _ in calls) == 6  # the new sensor, once for both rigs
    assert tree(changed.path) == _fresh(tmp_path / "b", changed_plan)


@pytest.mark.slow
@pytest.mark.parametrize("path", ["street/rgb/000003.png", "street/depth/000002.png", "side/labels.jsonl"])
def test_a_damaged_file_is_not_reused(tmp_path: Path, path: str) -> None:
    first, second = dataset_plan(frames=6, weathers=1), dataset_plan(frames=6, weathers=2)
    old = _build(tmp_path / "a", first).path / "weather=w0,jitter=still" / path
    body = old.read_bytes()
    old.unlink()  # (it may have hard links)
    old.write_bytes(body[:-9] + bytes([body[-9] ^ 1]) + body[-8:])
    assert tree(_build(tmp_path / "a", second).path) == _fresh(tmp_path / "b", second)


@pytest.mark.slow
@pytest.mark.parametrize("other", ["host", "version"])
def test_an_untrusted_dataset_is_not_reused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, other: str) -> None:
    calls: Calls = []
    _build(tmp_path / "a", dataset_plan(frames=6, weathers=1))
    if other == "version":
        monkeypatch.setattr(reuse_module, "builder_identity", lambda: "another")
    else:
        (tmp_path / "a" / "cache").rename(tmp_path / "a" / "gone")  # so the dataset is not known to be of this host
    _build(tmp_path / "a", dataset_plan(frames=6, weathers=2), calls)
    assert {c for what, c in calls if what == "shade"} == {0.0, 10.0}


@pytest.mark.slow
def test_other_outputs_are_written_again(tmp_path: Path) -> None:
    plan = dataset_plan(frames=6, weathers=1)
    _build(tmp_path / "a", plan)
    changed_plan = _changed(plan, forms={"depth": "npy"})
    assert tree(_build(tmp_path / "a", changed_plan).path) == _fresh(tmp_path / "b", changed_plan)


@pytest.mark.slow
def test_each_stage_reports_why_it_runs(tmp_path: Path) -> None:
    reported: list[str] = []
    _build(tmp_path, dataset_plan(frames=6, weathers=1), explain=reported.extend)
    assert reported[0] == "simulate 1 of 1 scene: their motion is not in the cache"
    assert reported[1].startswith(
        "observe, label and shade street, 6 frames of weather=w0,jitter=still: there is no earlier"
    )
    reported.clear()
    _build(tmp_path, dataset_plan(frames=6, weathers=2), explain=reported.extend)
    assert reported[0] == "simulate nothing: the motion of 1 scene is in the cache"
    assert reported[1] == "reuse street, 6 frames of weather=w0,jitter=still: nothing of them changed"
    assert reported[2] == (
        "shade street, 6 frames of weather=w1,jitter=still: an appearance that the earlier dataset has not"
    )
