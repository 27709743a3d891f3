"""Derivatives with respect to weather, sun and camera agree with formulas and with pictures of changed recipes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import recipe_runtime
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_runtime.scenario import Scenario

RECIPE = """
recipe: foggy
seed: 3
base:
  clock: {{fps: 10, frames: 2}}
  town: {{name: downtown, blocks: [1, 1]}}
  weather: {{fog_density: {fog}, fog_distance: 2, precipitation: {rain}}}
  time: "10:00"
  sensors:
    street:
      mount: {{x: 5, y: 3, z: 1.8, yaw: 140}}
      camera: {{width: 64, height: 48, fov: 60, noise: {noise}{lens}}}
      capture: [rgb]
"""


def opened(folder: Path, *, fog: float = 20, rain: float = 0, noise: float = 1, lens: str = "") -> Scenario:
    path = folder / f"foggy-{fog}-{rain}-{noise}.yaml"
    path.write_text(RECIPE.format(fog=fog, rain=rain, noise=noise, lens=lens))
    return recipe_runtime.open(path)


def unrounded(scene: Scenario, frame: int = 0) -> NDArray[np.float64]:
    sensor = scene.plan.rig.sensors[0]
    source, seen = scene._scenes.source(scene.plan.scene), scene._scenes.observe(scene.plan.scene, sensor, frame)
    return source.unrounded(seen, scene.plan.appearance, sensor, frame)


@pytest.mark.parametrize("lens", ["", ", bloom_intensity: 0.7, supersample: 2"])
def test_unrounded_picture_rounds_to_the_bytes_of_the_frame(tmp_path: Path, lens: str) -> None:
    scene = opened(tmp_path, rain=60, lens=lens)
    apart = np.abs(255 * unrounded(scene, 1) - scene.render(1).astype(np.float64))
    assert apart.max() < 1.6  # levels: the renderer rounds light to 4096 levels first, which is coarse in the dark
    assert apart.mean() < 0.3


def test_derivative_by_exposure_is_that_of_the_cameras_curve(tmp_path: Path) -> None:
    """Without noise, a picture is encode(tone(light 2 ** stops)): its slope at 0 follows from the picture itself."""
    scene = opened(tmp_path, noise=0, lens=", antialias: false, vignette_intensity: 0")
    derivative = scene.sensitivity("camera.exposure_compensation", 0, step=0.001)
    value = unrounded(scene)
    level = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    a, b = 2.51 - 2.43 * level, 0.03 - 0.59 * level  # inverse of Narkowicz's curve
    light = (np.sqrt(b * b + 0.56 * a * level) - b) / (2 * a)
    high, low = light * (2.51 * light + 0.03), light * (2.43 * light + 0.59) + 0.14
    tone_slope = ((5.02 * light + 0.03) * low - high * (4.86 * light + 0.59)) / low**2
    encode_slope = np.where(level <= 0.0031308, 12.92, 1.055 / 2.4 * np.maximum(level, 1e-9) ** (1 / 2.4 - 1))
    expected = encode_slope * tone_slope * light * math.log(2)
    inside = (value > 0.02) & (value < 0.98)
    assert inside.mean() > 0.8
    assert np.abs(derivative - expected)[inside].max() < 0.01 * np.abs(expected).max()


@pytest.mark.parametrize("lens", ["", ", bloom_intensity: 0.7"])
def test_derivative_by_fog_predicts_pictures_of_recipes_with_other_fog(tmp_path: Path, lens: str) -> None:
    derivative = opened(tmp_path, lens=lens).sensitivity("weather.fog_density", 1)
    more, less = (opened(tmp_path, fog=fog, lens=lens).render(1).astype(np.float64) for fog in (23, 17))
    change = (more - less) / 255
    assert np.abs(change).max() > 0.03
    assert np.abs(6 * derivative - change).max() < 0.015  # two roundings to 8 bits, and the curvature


def test_random_numbers_are_common_to_both_pictures(tmp_path: Path) -> None:
    """The aperture changes nothing under automatic exposure: every difference would come from random numbers."""
    scene = opened(tmp_path, rain=100, noise=3)
    assert not scene.sensitivity("camera.fstop", 0).any()
    assert scene.sensitivity("weather.precipitation", 0).any()


def test_derivative_is_one_sided_at_a_limit(tmp_path: Path) -> None:
    scene = opened(tmp_path, fog=0)
    expected = (unrounded(opened(tmp_path, fog=0.5)) - unrounded(scene)) / 0.5
    assert np.array_equal(scene.sensitivity("weather.fog_density", 0, step=0.5), expected)
    assert expected.any()


@pytest.mark.parametrize(
    ("parameter", "step", "message"),
    [
        ("weather.fog", None, "there is no parameter 'weather.fog'"),
        ("camera.exposure_mode", None, "there is no parameter"),
        ("sun.altitude", 0.0, "the step is 0.0; give a number above 0"),
        ("sun.altitude", math.nan, "the step is nan"),
        ("camera.iso", 1e-20, "the step is 1e-20, which does not change the value 100; give a larger number"),
    ],
)
def test_wrong_arguments_are_refused(tmp_path: Path, parameter: str, step: float | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        opened(tmp_path).sensitivity(parameter, 0, step=step)


def test_picture_with_an_inserted_texture_is_refused() -> None:
    scene = recipe_runtime.open("recipes/attacks/poster.yaml", "weather=clear,insertion=digital")
    with scene, pytest.raises(InputError, match="a texture is inserted"):
        scene.sensitivity("sun.altitude", 0)
