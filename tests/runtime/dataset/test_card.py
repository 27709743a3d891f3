"""The card of a dataset describes the files of its modalities, and depth and sky as its cameras record them."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.modalities import LABEL_MODALITIES, MODALITIES
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.dataset.card import card

from tests.runtime.fakes import dataset_plan


def with_cameras(plan: DatasetPlan, far: float, capture: tuple[str, ...]) -> DatasetPlan:
    """Return the plan with cameras of the given far limit."""
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
def test_the_card_states_the_depth_of_the_sky(depth: str, far: float, sky: str) -> None:
    """Regression: the card stated a depth of 1000 m for the sky also if the cameras' far limit is 300 m."""
    (line,) = [row for row in text(depth, far, ("rgb", "depth")).splitlines() if row.startswith("- depth:")]
    assert f"The sky is at {sky}." in line


@pytest.mark.parametrize("name", LABEL_MODALITIES)
def test_the_card_describes_the_modalities_that_are_captured(name: str) -> None:
    found = text("carla", 1000.0, ("rgb", name)).splitlines()
    assert [row.split(":")[0] for row in found if row.startswith(tuple(f"- {known}:" for known in MODALITIES))] == [
        f"- {name}"
    ]


def test_the_card_names_the_endings_of_files() -> None:
    for capture, files in (
        (("rgb",), "png`,"),
        (("rgb", "depth"), "png` or `<variant>/<sensor>/<modality>/000000.npy`,"),
    ):
        assert f"- `<variant>/<sensor>/<modality>/000000.{files}" in text("npy", 1000.0, capture)


def text(depth: str, far: float, capture: tuple[str, ...]) -> str:
    """Return the card of a dataset without frames."""
    return card(with_cameras(dataset_plan(forms={"depth": depth}), far, capture), "tiny@sha256:0", [])
