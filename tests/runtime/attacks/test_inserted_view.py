"""Other textures on inserted patches have the bytes of a build, and a gradient."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.ir.errors import InputError
from recipe_runtime.attacks.inserted_view import InsertedView
from recipe_runtime.scenario import Scenario

from tests.compiler.modelling import png
from tests.runtime.insertion.images import smooth

RECIPE = """
recipe: inserted
seed: 3
base:
  clock: {{fps: 10, frames: 2}}
  town: {{name: downtown, blocks: [1, 1]}}
  actors:
    car: {{blueprint: vehicle.van.a, speed: 5, start: {{x: -1.6, y: 1}}, goal: {{x: -1.6, y: -30}}}}
  patches:
    poster: {{on: {{town: wall.1, size: {{width: 4, height: 2}}}}, texture: {{image: {poster}.png}}}}
    hood: {{on: {{actor: car, surface: front, at: {{z: 0.9}}, size: {{width: 1.2, height: 0.8}}}},
           texture: {{image: {hood}.png}}}}
  sensors:
    street: {{mount: {{x: 1.5, y: -6, z: 1.6, yaw: 140}}, camera: {{width: 120, height: 90, fov: 70}}, capture: [rgb]}}
    bent:
      mount: {{x: 1.5, y: -6, z: 1.6, yaw: 140}}
      camera: {{width: 80, height: 60, fov: 80, lens_k: 0.2, motion_blur_intensity: 3, bloom_intensity: 4}}
      capture: [rgb]
deltas:
  mode:
    digital: {{patches: {{poster: {{mode: digital}}, hood: {{mode: digital}}}}}}
    transfer:
      patches:
        poster: {{mode: color_transfer}}
        hood: {{mode: color_transfer, color_transfer: {{method: reap}}}}
    mixed: {{patches: {{hood: {{mode: color_transfer, color_transfer: {{method: matrix}}}}}}}}
"""
TEXTURES = {"a": smooth(12, 20, 0, 1), "b": smooth(60, 90, 1, 4), "c": smooth(37, 23, 2, 2), "d": smooth(9, 7, 3, 1)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("inserted")
    for name, texture in TEXTURES.items():
        (path / f"{name}.png").write_bytes(png(texture))
    for name, poster, hood in (("first", "a", "b"), ("second", "c", "d")):
        (path / f"{name}.yaml").write_text(RECIPE.format(poster=poster, hood=hood))
    return path


def scene(folder: Path, name: str, mode: str) -> Scenario:
    return recipe_runtime.open(folder / f"{name}.yaml", f"mode={mode}")


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["digital", "transfer", "mixed"])
def test_a_texture_gives_the_frames_of_a_recipe_with_it(folder: Path, mode: str) -> None:
    """In `mixed` a rendered patch is bloomed and blurred over the placeholder and the chart of an inserted one."""
    first, second = scene(folder, "first", mode), scene(folder, "second", mode)
    others = {"poster": TEXTURES["c"], "hood": TEXTURES["d"]}
    for sensor in ("street", "bent"):
        for frame in (1, 0):
            expected = second.render(frame, sensor)
            np.testing.assert_array_equal(first.render(frame, sensor, textures=others), expected)
            assert (first.render(frame, sensor) != expected).any()
        one = first.render(0, sensor, textures={"hood": TEXTURES["d"]})
        both = first.render(0, sensor, textures={"hood": TEXTURES["d"], "poster": TEXTURES["a"]})
        np.testing.assert_array_equal(one, both)


@pytest.mark.slow
@pytest.mark.parametrize(("patch", "name"), [("poster", "c"), ("hood", "d"), ("hood", "b")])
def test_the_map_of_a_digital_patch_has_the_builds_values(folder: Path, patch: str, name: str) -> None:
    digital, texture = scene(folder, "first", "digital"), TEXTURES[name]
    for sensor in ("street", "bent"):
        view = digital.patch_view(1, patch, sensor, size=(texture.shape[0], texture.shape[1]))
        expected = np.asarray(digital.render(1, sensor, textures={patch: texture}), np.uint8)
        assert isinstance(view, InsertedView) and len(view.pixels) > 20
        np.testing.assert_array_equal(view.render(texture), expected)
        assert np.abs(view.forward(texture) * 255.0 - expected).max() <= 0.5 + 1e-9
        apart = np.abs(view.rounded(texture).astype(int) - expected)
        assert apart.max() <= 1 and apart.sum() <= 0.001 * 3 * len(view.pixels), (
            "except for values at .5, which may round down"
        )


@pytest.mark.slow
def test_the_gradient_of_a_digital_patch_is_its_transpose(folder: Path) -> None:
    """The map is linear, so differences are exact; texels beyond 0 and 1 have no gradient."""
    texture, draw = TEXTURES["b"] / 255.0, np.random.default_rng(1)
    view = scene(folder, "first", "digital").patch_view(0, "hood")
    y, way = draw.normal(size=view.picture.shape), draw.normal(size=texture.shape)
    inside = np.clip(texture, 0.2, 0.8)
    measured = ((view.forward(inside + 0.01 * way) - view.forward(inside - 0.01 * way)) * y).sum() / 0.02
    gradient = view.backward(inside, y)
    assert (gradient * way).sum() == pytest.approx(measured, rel=1e-9)
    assert (view.backward((inside * 255).astype(np.uint8), y) == gradient).all()
    with pytest.raises(InputError, match="float textures are from 0 to 1"):
        view.backward(inside - 1.0, y)
    with pytest.raises(InputError, match="but the picture has the shape"):
        view.backward(inside, y.transpose(2, 0, 1))
    eighths = np.floor(inside * 255.0 + 0.5).astype(np.uint8)
    np.testing.assert_array_equal(view.rounded(inside), view.rounded(eighths))
    np.testing.assert_array_equal(view.render(inside), view.render(eighths))


@pytest.fixture(scope="module")
def dark(folder: Path) -> Scenario:
    """A scene for colour transforms, with little light so that ratios differ from 1."""
    text = RECIPE.format(poster="b", hood="a").replace("  actors:", "  weather: HardRainNoon\n  actors:")
    (folder / "dark.yaml").write_text(text)
    return scene(folder, "dark", "transfer")


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dapricot", "matrix", "armory", "reap"])
def test_the_gradient_through_colour_transforms(dark: Scenario, method: str) -> None:
    """Forward differs from the picture by the methods' rounding; finite differences have the gradient.

    A level of rounding before the matrix is up to six levels after it, in dark colours.
    """
    patches = tuple(p.model_copy(update={"transfer": method}) for p in dark.plan.appearance.patches)
    plan = dark.plan.model_copy(update={"appearance": dark.plan.appearance.model_copy(update={"patches": patches})})
    view, draw = Scenario(plan, dark._scenes).patch_view(1, "poster", "street", size=(60, 90)), np.random.default_rng(1)
    texture = TEXTURES["b"]
    apart = np.abs(view.forward(texture) * 255.0 - view.render(texture)).reshape(-1, 3)[view.pixels]
    rounded = method in ("dapricot", "matrix")
    assert apart.max() <= (6.0 if rounded else 0.5 + 1e-9) and apart.mean() < (0.8 if rounded else 0.3)
    assert (view.rounded(texture) == view.render(texture)).all()
    inside = np.clip(texture / 255.0, 0.02, 0.98)
    for _ in range(3):
        y, way = draw.normal(size=view.picture.shape), draw.normal(size=texture.shape)
        high, low = view.forward(inside + 1e-7 * way), view.forward(inside - 1e-7 * way)
        measured = ((high - low) * y).sum() / 2e-7
        assert (view.backward(inside, y) * way).sum() == pytest.approx(measured, rel=1e-4, abs=1e-5)
        assert abs(measured) > 1e-3


@pytest.mark.slow
def test_a_rendered_patch_beside_an_inserted_one_has_no_gradient(folder: Path) -> None:
    with pytest.raises(InputError, match="poster: there is no gradient in a picture into which the texture of hood is"):
        scene(folder, "first", "mixed").patch_view(0, "poster")
    with pytest.raises(InputError, match=r"\(2, 2, 3\), but the view is of textures of the shape \(12, 20, 3\)"):
        scene(folder, "first", "digital").patch_view(0, "poster").forward(np.zeros((2, 2, 3)))
