"""Keys of a camera: the plan that each belongs to, and what `enable_postprocess_effects` turns off."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from recipe_compiler.ir.plan import CameraPlan, CameraResponse, ScenarioPlan
from recipe_compiler.schema.camera import Camera

from tests.compiler.kitchen import compiled, only, small

# Every key with a value that is not its default.
PIXELS = {"width": 640, "height": 400, "fov": 70.0, "near": 0.2, "far": 500.0, "lens_k": 0.1, "lens_kcube": 0.05}
COLOURS: dict[str, Any] = {
    "exposure_mode": "manual",
    "exposure_compensation": 1.0,
    "shutter_speed": 100.0,
    "iso": 400.0,
    "fstop": 8.0,
    "gamma": 2.0,
    "temp": 5000.0,
    "tint": 0.2,
    "noise": 0.5,
    "vignette_intensity": 0.1,
    "lens_circle_multiplier": 1.0,
    "lens_circle_falloff": 2.0,
    "chromatic_aberration_intensity": 1.0,
    "chromatic_aberration_offset": 0.5,
    "bloom_intensity": 0.7,
    "motion_blur_intensity": 1.0,
    "motion_blur_max_distortion": 0.1,
    "antialias": False,
    "supersample": 2,
    "enable_postprocess_effects": False,
}


def having(**camera: Any) -> ScenarioPlan:
    recipe = copy.deepcopy(small())
    sensor = recipe["base"]["sensors"]["street"]
    sensor["camera"] = {**sensor.get("camera", {}), **camera}
    return only(recipe)


def test_every_key_is_tested_here() -> None:
    assert {*PIXELS, *COLOURS} == set(Camera.model_fields)
    assert set(PIXELS) == set(CameraPlan.model_fields)
    assert set(COLOURS) - {"enable_postprocess_effects"} == set(CameraResponse.model_fields)


@pytest.mark.parametrize("key", PIXELS)
def test_keys_that_affect_geometry_belong_to_the_rig(key: str) -> None:
    plain, changed = having(), having(**{key: PIXELS[key]})
    assert plain.rig.digest != changed.rig.digest
    assert (plain.scene.digest, plain.appearance.digest) == (changed.scene.digest, changed.appearance.digest)


@pytest.mark.parametrize("key", COLOURS)
def test_keys_that_affect_only_colour_belong_to_the_appearance(key: str) -> None:
    plain, changed = having(), having(**{key: COLOURS[key]})
    assert plain.appearance.digest != changed.appearance.digest
    assert plain.observation == changed.observation


def test_defaults_of_recipes_and_plans_agree() -> None:
    """An absent key has the same meaning in both."""
    camera, response, pixels = Camera(), CameraResponse(), CameraPlan(width=800, height=600, fov=90)
    assert {k: getattr(camera, k) for k in CameraResponse.model_fields} == response.model_dump()
    assert {k: getattr(camera, k) for k in CameraPlan.model_fields} == pixels.model_dump()


def test_post_processing_can_be_turned_off_as_a_whole() -> None:
    off = having(**{**COLOURS, "enable_postprocess_effects": False}).appearance.responses["street"]
    effects = [k for k in CameraResponse.model_fields if k.endswith(("_intensity", "noise", "_multiplier"))]
    assert [getattr(off, k) for k in effects] == [0.0] * 6
    assert (off.exposure_compensation, off.gamma, off.supersample) == (1.0, 2.0, 2)


@pytest.mark.slow
def test_samples_cost_time() -> None:
    def minutes(**camera: Any) -> float:
        recipe = copy.deepcopy(small(clock={"fps": 10, "frames": 500}))
        sensor = recipe["base"]["sensors"]["street"]
        sensor["camera"] = {**sensor.get("camera", {}), **camera}
        return compiled(recipe).cost.minutes

    assert minutes() < minutes(supersample=2) < minutes(supersample=4)
    assert minutes() < minutes(lens_k=0.2)
