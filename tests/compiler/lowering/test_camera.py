"""Keys of a camera: the plan that each belongs to, and what `enable_postprocess_effects` turns off."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from recipe_compiler.ir.plan import CameraPlan, CameraResponse, ScenarioPlan
from recipe_compiler.schema.camera import Camera

from tests.compiler.kitchen import compiled, only, small

PIXELS = list(CameraPlan.model_fields)
COLOURS = [key for key in Camera.model_fields if key not in PIXELS]
LENS = {"exposure_mode": "manual", "lens_k": 0.1, "lens_kcube": 0.05}


def other(key: str) -> Any:
    """Return a value of a key that is not its default: of a number, one nearer to the end of its range."""
    field = Camera.model_fields[key]
    if key == "sensor":
        return "bayer"
    if key in LENS or isinstance(field.default, bool):
        return LENS.get(key, not field.default)
    (most,) = (limit.le for limit in field.metadata if hasattr(limit, "le"))
    return type(field.default)((field.default + most) / 2)


def having(**camera: Any) -> ScenarioPlan:
    recipe = copy.deepcopy(small())
    sensor = recipe["base"]["sensors"]["street"]
    sensor["camera"] = {**sensor.get("camera", {}), **camera}
    return only(recipe)


@pytest.mark.parametrize("key", PIXELS)
def test_keys_that_affect_geometry_belong_to_the_rig(key: str) -> None:
    plain, changed = having(), having(**{key: other(key)})
    assert plain.rig.digest != changed.rig.digest
    assert (plain.scene.digest, plain.appearance.digest) == (changed.scene.digest, changed.appearance.digest)


@pytest.mark.parametrize("key", COLOURS)
def test_keys_that_affect_only_colour_belong_to_the_appearance(key: str) -> None:
    plain, changed = having(), having(**{key: other(key)})
    assert plain.appearance.digest != changed.appearance.digest
    assert plain.observation == changed.observation


def test_defaults_of_recipes_and_plans_agree() -> None:
    """An absent key has the same meaning in both."""
    camera, response, pixels = Camera(), CameraResponse(), CameraPlan(width=800, height=600, fov=90)
    assert {k: getattr(camera, k) for k in CameraResponse.model_fields} == dict(response)
    assert {k: getattr(camera, k) for k in CameraPlan.model_fields} == pixels.model_dump()


def test_a_plan_without_a_sensor_model_has_no_key_for_it() -> None:
    """Plans from before the key existed keep their digests."""
    plain, removed, bayer = having(), having(sensor=None), having(sensor="bayer")
    documents = [v.appearance.model_dump(mode="json")["responses"]["street"] for v in (plain, removed, bayer)]
    assert "sensor" not in documents[0] and documents[0] == documents[1]
    assert documents[2] == {**documents[0], "sensor": "bayer"}
    assert plain.digest == removed.digest != bayer.digest


def test_post_processing_can_be_turned_off_as_a_whole() -> None:
    off = having(**{key: other(key) for key in COLOURS}).appearance.responses["street"]
    effects = [k for k in CameraResponse.model_fields if k.endswith(("_intensity", "noise", "_multiplier"))]
    assert [getattr(off, k) for k in effects] == [0.0] * 6 and off.sensor is None
    kept = ("exposure_compensation", "gamma", "supersample")
    assert [getattr(off, k) for k in kept] == [other(k) for k in kept]


@pytest.mark.slow
def test_samples_cost_time() -> None:
    def minutes(**camera: Any) -> float:
        recipe = copy.deepcopy(small(clock={"fps": 10, "frames": 500}))
        sensor = recipe["base"]["sensors"]["street"]
        sensor["camera"] = {**sensor.get("camera", {}), **camera}
        return compiled(recipe).cost.minutes

    assert minutes() < minutes(supersample=2) < minutes(supersample=4)
    assert minutes() < minutes(lens_k=0.2)
