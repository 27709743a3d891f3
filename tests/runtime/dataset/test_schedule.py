"""Views group equal observations, and finding them takes time in proportion to the sensors."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.plan import DatasetPlan, RigPlan, ScenarioPlan, SensorPlan
from recipe_runtime.dataset import schedule

from tests.runtime.fakes import appearance_plan, dataset_plan, scene_plan, sensor_plan


def test_views_are_grouped_by_scene_and_hold_the_variants_that_share_them() -> None:
    found = schedule.views(dataset_plan(weathers=2))
    assert [(view.sensor.name, view.variants) for view in found] == [
        ("street", (0, 2)),  # still
        ("side", (0, 1, 2, 3)),  # it does not move in either rig
        ("street", (1, 3)),  # shaky
    ]


def test_a_scene_keeps_its_place_where_its_views_are_found_later() -> None:
    scenes, rig = (scene_plan(2), scene_plan(3)), RigPlan(sensors=(sensor_plan(),))
    other = RigPlan(sensors=(sensor_plan("side"),))
    parts = ((scenes[0], rig), (scenes[1], rig), (scenes[0], other))
    variants = tuple(
        ScenarioPlan(variant=f"v{n}", scene=scene, rig=rig, appearance=appearance_plan())
        for n, (scene, rig) in enumerate(parts)
    )
    found = schedule.views(DatasetPlan(recipe="tiny", description="", variants=variants, annotations=()))
    assert [(view.scene, view.sensor.name) for view in found] == [
        (scenes[0], "street"),
        (scenes[0], "side"),
        (scenes[1], "street"),
    ]


def test_a_sensor_is_digested_once_for_all_variants_with_its_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    """A digest covers all poses: one for each pair of 400 sensors took longer than their build."""
    counted: list[str] = []
    view_key = schedule._view_key

    def counting(scene: str, sensor: SensorPlan) -> str:
        counted.append(sensor.name)
        return view_key(scene, sensor)

    monkeypatch.setattr(schedule, "_view_key", counting)
    assert len(schedule.views(dataset_plan(weathers=5))) == 3
    assert sorted(counted) == ["side", "side", "street", "street"]  # of two rigs
