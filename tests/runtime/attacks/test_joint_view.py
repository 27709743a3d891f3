"""Several patches in a frame: the frame's bytes, and one gradient for each texture, also where patches overlap."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import recipe_runtime
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_runtime.attacks.joint_view import JointView
from recipe_runtime.scenario import Scenario

from tests.compiler.modelling import png
from tests.runtime.insertion.images import smooth

Pixels = NDArray[np.uint8]

# The sticker overlaps the poster, and the wet road reflects the wall and shows the paint of the road.
RECIPE = """
recipe: joint
seed: 3
base:
  clock: {{fps: 10, frames: 2}}
  town: {{name: downtown, blocks: [1, 1]}}
  weather: HardRainNoon
  actors:
    car: {{blueprint: vehicle.van.a, speed: 5, start: {{x: -1.6, y: 1}}, goal: {{x: -1.6, y: -30}}}}
  patches:
    poster: {{on: {{town: wall.1, at: {{x: 0, z: 1.4}}, size: {{width: 4, height: 2}}}},
             texture: {{image: {poster}.png}}}}
    sticker:
      on: {{town: wall.1, at: {{x: 1, z: 1.4}}, size: {{width: 3, height: 1}}}}
      texture: {{image: {sticker}.png}}
    paint: {{on: {{actor: car}}, texture: {{image: {paint}.png}}, gloss: 0.4}}
    logo:
      on: {{actor: car, surface: front, at: {{z: 0.9}}, size: {{width: 1.2, height: 0.8}}}}
      texture: {{color: "#ffcc00"}}
      emission: 2
  sensors:
    street: {{mount: {{x: 1.5, y: -6, z: 1.6, yaw: 140}}, camera: {{width: 120, height: 90, fov: 70}}, capture: [rgb]}}
    bent:
      mount: {{x: 1.5, y: -6, z: 1.6, yaw: 140}}
      camera: {{width: 80, height: 60, fov: 80, lens_k: 0.2, motion_blur_intensity: 3, bloom_intensity: 4}}
      capture: [rgb]
deltas:
  mode:
    rendered: {{}}
    digital:
      patches: {{poster: {{mode: digital}}, sticker: {{mode: digital}}, paint: null, logo: {{mode: digital}}}}
    transfer:
      patches: {{poster: {{mode: color_transfer}}, sticker: {{mode: digital}}, paint: null}}
"""
IMAGES = {"a": smooth(12, 20, 0, 1), "b": smooth(60, 90, 1, 4), "c": smooth(37, 23, 2, 2)}
OTHERS = {"d": smooth(9, 7, 3, 1), "e": smooth(16, 33, 5, 2), "f": smooth(24, 24, 7, 3)}
TEXTURES = dict(zip(("poster", "sticker", "paint"), OTHERS.values(), strict=True))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("joint")
    for name, texture in {**IMAGES, **OTHERS}.items():
        (path / f"{name}.png").write_bytes(png(texture))
    for name, poster, sticker, paint in (("first", *"abc"), ("second", *"def")):
        (path / f"{name}.yaml").write_text(RECIPE.format(poster=poster, sticker=sticker, paint=paint))
    return path


def scene(folder: Path, name: str = "first", mode: str = "rendered") -> Scenario:
    return recipe_runtime.open(folder / f"{name}.yaml", f"mode={mode}")


def view_of(folder: Path, mode: str, sensor: str) -> tuple[JointView, dict[str, Pixels]]:
    textures = {name: image for name, image in TEXTURES.items() if mode == "rendered" or name != "paint"}
    sizes = {name: (image.shape[0], image.shape[1]) for name, image in textures.items()}
    return JointView(scene(folder, mode=mode).retextured(1, sensor), sizes), textures


CASES = [("rendered", "street"), ("rendered", "bent"), ("digital", "street"), ("transfer", "street")]


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "sensor"), CASES)
def test_all_patches_have_the_bytes_of_a_recipe_with_the_textures(folder: Path, mode: str, sensor: str) -> None:
    view, textures = view_of(folder, mode, sensor)
    expected = scene(folder, "second", mode).render(1, sensor)
    np.testing.assert_array_equal(view.render(textures), expected)
    assert np.abs(view.forward(textures) * 255 - expected.astype(float)).max() < 1.6
    assert (view.picture != expected).any()


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "sensor"), CASES)
def test_finite_differences_in_all_textures_at_once_agree(folder: Path, mode: str, sensor: str) -> None:
    view, textures = view_of(folder, mode, sensor)
    draw, step = np.random.default_rng(4), 1e-7
    at = {name: np.clip(image / 255.0, 0.02, 0.98) for name, image in textures.items()}
    y = draw.normal(size=view.picture.shape)
    gradients = view.backward(at, y)
    for moved in [{name} for name in at] + [set(at)]:
        way = {name: draw.normal(size=values.shape) * (name in moved) for name, values in at.items()}
        high = {name: values + step * way[name] for name, values in at.items()}
        low = {name: values - step * way[name] for name, values in at.items()}
        measured = float(((view.forward(high) - view.forward(low)) * y).sum()) / (2 * step)
        found = sum((gradients[name] * way[name]).sum() for name in at)
        assert found == pytest.approx(measured, rel=1e-4, abs=1e-5) and abs(found) > 1e-3


def test_one_patch_of_a_joint_view_is_its_patch_view(folder: Path) -> None:
    with scene(folder) as street:
        joint, single = JointView(street.retextured(1), {"poster": (9, 7)}), street.patch_view(1, "poster", size=(9, 7))
        y = np.random.default_rng(1).normal(size=single.picture.shape)
        texture = OTHERS["d"]
        np.testing.assert_array_equal(joint.forward({"poster": texture}), single.forward(texture))
        np.testing.assert_array_equal(joint.backward({"poster": texture}, y)["poster"], single.backward(texture, y))


def test_missing_patches_and_textures_are_named(folder: Path) -> None:
    with scene(folder) as street:
        with pytest.raises(InputError, match="names none"):
            JointView(street.retextured(0), {})
        with pytest.raises(InputError, match="patch logo: its texture is a colour"):
            JointView(street.retextured(0), {"poster": None, "logo": None})
        with pytest.raises(InputError, match="no patch 'roof'"):
            JointView(street.retextured(0), {"poster": None, "roof": None})
        view = JointView(street.retextured(0), {"poster": None, "sticker": None})
        with pytest.raises(InputError, match="the view is of poster, sticker, and the texture of sticker is missing"):
            view.forward({"poster": IMAGES["a"]})
