"""The card of a dataset says of depth and sky what holds for its cameras."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.dataset.card import card

from tests.runtime.fakes import dataset_plan


def with_cameras(plan: DatasetPlan, far: float, capture: tuple[str, ...]) -> DatasetPlan:
    """The plan with cameras that see so far."""
    variants = []
    for variant in plan.variants:
        sensors = [
            sensor.model_copy(update={"camera": sensor.camera.model_copy(update={"far": far}), "capture": capture})
            for sensor in variant.rig.sensors
        ]
        rig = variant.rig.model_copy(update={"sensors": tuple(sensors)})
        variants.append(variant.model_copy(update={"rig": rig}))
    return plan.model_copy(update={"variants": tuple(variants)})


@pytest.mark.parametrize(
    ("depth", "far", "sky"),
    [("carla", 1000.0, "1000 m"), ("carla", 300.0, "300 m"), ("carla", 5000.0, "1000 m"), ("npy", 5000.0, "5000 m")],
)
def test_the_sky_is_where_the_pictures_have_it(depth: str, far: float, sky: str) -> None:
    """`1000 m and more, sky included, are 1000 m` was said of cameras that see 300 m far, too."""
    (line,) = [row for row in text(depth, far, ("rgb", "depth")).splitlines() if row.startswith("- depth:")]
    assert f"The sky is at {sky}." in line


def test_depth_that_is_not_there_is_not_described() -> None:
    assert "depth:" not in text("carla", 1000.0, ("rgb",)) and "1000 m" not in text("carla", 1000.0, ("rgb",))


def text(depth: str, far: float, capture: tuple[str, ...]) -> str:
    """The card of a dataset without frames."""
    return card(with_cameras(dataset_plan(depth=depth), far, capture), "tiny@sha256:0", [])
