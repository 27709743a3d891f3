"""Textures in `Scenario.render` and `Scenario.patch_view`: bytes equal to a build's, and errors with a remedy."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as StillRunningError
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.ir.errors import InputError
from recipe_runtime import scenes
from recipe_runtime.attacks.textures import as_gradient
from recipe_runtime.attacks.truth import patch_truth
from recipe_runtime.scenario import Scenario

from tests.compiler.modelling import picture, png

RECIPE = """
recipe: textured
seed: 3
base:
  clock: {{fps: 10, frames: 3}}
  town: {{name: downtown, blocks: [1, 1]}}
  actors:
    car: {{blueprint: vehicle.van.a, speed: 5, start: {{x: -1.6, y: 1}}, goal: {{x: -1.6, y: -30}}}}
  patches:
    poster: {{on: {{town: wall.1, size: {{width: 4, height: 2}}}}, texture: {{image: {image}}}}}
    paint: {{on: {{actor: car}}, texture: {{color: "#ff00ff"}}}}
  sensors:
    street:
      mount: {{x: 1.5, y: -6, z: 1.6, yaw: 140}}
      camera: {{width: 96, height: 64, fov: 70}}
      capture: [rgb, instance]
deltas:
  weather: {{clear: {{}}, rainy: {{weather: HardRainNoon}}}}
  insertion: {{rendered: {{}}, green: {{patches: {{poster: {{mode: green}}}}}}}}
"""
RENDERED = "weather=rainy,insertion=rendered"
FIRST, SECOND = picture(), picture(9, 7)[..., ::-1].copy()


def recipe_with(folder: Path, image: str) -> Path:
    (folder / "first.png").write_bytes(png(FIRST))
    (folder / "second.png").write_bytes(png(SECOND))
    path = folder / f"{image}.yaml"
    path.write_text(RECIPE.format(image=f"{image}.png"))
    return path


@pytest.fixture(scope="module")
def recipes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("textured")
    return recipe_with(folder, "first"), recipe_with(folder, "second")


@pytest.fixture(scope="module")
def scene(recipes: tuple[Path, Path]) -> Scenario:
    return recipe_runtime.open(recipes[0], RENDERED)


@pytest.mark.slow
def test_a_texture_gives_the_frames_of_a_recipe_with_it(recipes: tuple[Path, Path], scene: Scenario) -> None:
    other = recipe_runtime.open(recipes[1], RENDERED)
    for frame in (2, 0, 1):
        np.testing.assert_array_equal(scene.render(frame, textures={"poster": SECOND}), other.render(frame))
    as_shares = SECOND.astype(np.float32) / np.float32(255)
    np.testing.assert_array_equal(scene.render(0, textures={"poster": as_shares}), other.render(0))
    painted = scene.render(0, textures={"poster": SECOND, "paint": np.full((1, 1, 3), [255, 0, 255], np.uint8)})
    np.testing.assert_array_equal(painted, other.render(0))
    assert (scene.render(0, textures={"paint": SECOND}) != scene.render(0)).any()
    labels = scene.render(1, "street", "instance", textures={"poster": SECOND})
    np.testing.assert_array_equal(labels, other.render(1, "street", "instance"))


def test_a_patch_view_renders_the_same(scene: Scenario) -> None:
    view = scene.patch_view(1, "poster")
    assert view.shape == FIRST.shape
    np.testing.assert_array_equal(view.render(FIRST), scene.render(1))
    small = scene.patch_view(1, "poster", size=(np.int8(7), np.int8(9)))  # type: ignore[arg-type]
    np.testing.assert_array_equal(small.render(SECOND), scene.render(1, textures={"poster": SECOND}))
    np.testing.assert_allclose(small.forward(SECOND) * 255, small.render(SECOND), atol=1.6)
    gradient = scene.patch_view(0, "paint", size=(16, 16)).backward(np.full((16, 16, 3), 0.5), np.ones((64, 96, 3)))
    assert gradient.shape == (16, 16, 3) and (gradient > 0).any()


@pytest.mark.slow
@pytest.mark.parametrize("captured", ["rgb", "instance"])
def test_a_stream_gives_the_pictures_and_the_truth_of_single_frames(
    scene: Scenario, captured: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also without pictures: a stream's observation has no visibility buffer from which to find the patches."""
    source, sensor, appearance = (
        scene._scenes.source(scene.plan.scene),
        scene.plan.rig.sensors[0],
        scene.plan.appearance,
    )
    monkeypatch.setattr(source, "use_streams", True)
    wanted = [appearance] if captured == "rgb" else []
    for made in source.make(sensor, wanted, range(3), patched=[appearance]):
        (shown,) = made.patch_maps
        truth = patch_truth(source, appearance, sensor, made.seen, made.number, shown)
        assert truth == scene.patches(made.number) and any(record["area"] for record in truth["patches"])
        for drawn in made.pictures:
            np.testing.assert_array_equal(drawn, scene.render(made.number))
    assert source._stream[1] is not None, "it was a stream"


def test_invalid_textures_are_refused(recipes: tuple[Path, Path], scene: Scenario) -> None:
    image = np.zeros((4, 4, 3), np.uint8)
    with pytest.raises(InputError, match="no patch 'sticker'; it has poster, paint"):
        scene.render(0, textures={"sticker": image})
    with pytest.raises(InputError, match="its mode is green, so it shows no texture; choose a variant"):
        recipe_runtime.open(recipes[0], "weather=clear,insertion=green").patch_view(0, "poster")
    with pytest.raises(InputError, match=r"shape \(4, 4\); give an array \[height, width, 3\]"):
        scene.render(0, textures={"poster": image[..., 0]})
    with pytest.raises(InputError, match="is of int64; give uint8, or floats"):
        scene.render(0, textures={"poster": image.astype(np.int64)})
    with pytest.raises(InputError, match="not finite"):
        scene.render(0, textures={"poster": np.full((4, 4, 3), np.nan)})
    with pytest.raises(InputError, match="at most 8192 per side"):
        scene.patch_view(0, "poster", size=(9000, 4))
    with pytest.raises(InputError, match="the textures are a list; give a dictionary"):
        scene.render(0, textures=[])  # type: ignore[arg-type]
    with pytest.raises(InputError, match="a colour, which has no size; give the texture's size"):
        scene.patch_view(0, "paint")
    with pytest.raises(InputError, match="no sensor 'roof'"):
        scene.patch_view(0, "poster", "roof")
    with pytest.raises(IndexError):
        scene.render(3, textures={"poster": image})


@pytest.mark.parametrize("given", [np.full((9, 7, 3), 255.0), np.full((9, 7, 3), -0.01), np.full((9, 7, 3), 1.001)])
def test_floats_outside_0_to_1_are_refused(scene: Scenario, given: Any) -> None:
    """Regression: floats from 0 to 255 gave a white patch without an error."""
    view = scene.patch_view(0, "poster", size=(9, 7))
    calls: list[Callable[[], object]] = [
        lambda: scene.render(0, textures={"poster": given}),
        lambda: view.forward(given),
        lambda: view.backward(given, np.ones((64, 96, 3))),
        lambda: view.render(given),
        lambda: view.rounded(given),
    ]
    for call in calls:
        with pytest.raises(InputError, match="float textures are from 0 to 1: divide 8-bit values by 255"):
            call()


def test_a_gradient_of_another_shape_is_refused(scene: Scenario) -> None:
    """Regression: a gradient with the channels first, PyTorch's order, gave a wrong gradient without an error."""
    view = scene.patch_view(0, "poster", size=(9, 7))
    texture, gradient = np.full((9, 7, 3), 0.5), np.random.default_rng(2).random((64, 96, 3))
    for wrong in (gradient.transpose(2, 0, 1), gradient.transpose(1, 0, 2), gradient[..., :1], gradient[:9, :7], 0.0):
        with pytest.raises(
            InputError, match=r"but the picture has the shape \(64, 96, 3\); give an array \[height, wi"
        ):
            view.backward(texture, wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="gradient of the picture that shows poster is of complex128; give floats"):
        view.backward(texture, gradient.astype(complex))


def test_a_gradient_may_be_a_tensor() -> None:
    """A texture may be a tensor, channels first, and so may the gradient of the picture; infinite values are kept."""

    class Tensor:
        def __init__(self, values: Any) -> None:
            self.values = values

        def detach(self) -> Tensor:
            return self

        def cpu(self) -> Tensor:
            return self

        def numpy(self) -> Any:
            return self.values

    expected = np.arange(24.0).reshape(2, 4, 3)
    expected[0, 0, 0] = np.inf
    for values in (expected.transpose(2, 0, 1), expected.transpose(2, 0, 1)[None].astype(np.float32)):
        np.testing.assert_array_equal(as_gradient("poster", Tensor(values), (2, 4, 3)), expected)


@pytest.mark.torch
def test_errors_print_the_shape_that_was_given(scene: Scenario) -> None:
    """Regression: they printed that of the array, with the channels last."""
    torch, view = pytest.importorskip("torch"), scene.patch_view(0, "poster", size=(9, 7))
    for texture, shape in ((torch.zeros(2, 3, 5, 4), r"\(2, 3, 5, 4\)"), (torch.zeros(5, 4), r"\(5, 4\)")):
        for call in (lambda t=texture: scene.render(0, textures={"poster": t}), lambda t=texture: view.forward(t)):
            with pytest.raises(InputError, match=f"the texture of poster has the shape {shape}; give an array"):
                call()
    with pytest.raises(
        InputError, match=r"poster has the shape \(1, 3, 5, 4\), but the view is of .* \(9, 7, 3\): hei"
    ):
        view.forward(torch.zeros(1, 3, 5, 4))
    with pytest.raises(InputError, match=r"poster has the shape \(3, 5, 4\), but the picture has the shape"):
        view.backward(torch.zeros(3, 9, 7), torch.zeros(3, 5, 4))


def test_a_view_rounds_floats_as_a_frame_does(scene: Scenario) -> None:
    """Regression: `rounded` raised IndexError for inputs that `forward` accepts."""
    view = scene.patch_view(1, "poster", size=(9, 7))
    floats = np.random.default_rng(3).random((9, 7, 3))
    expected = scene.render(1, textures={"poster": floats})
    np.testing.assert_array_equal(view.render(floats), expected)
    np.testing.assert_array_equal(view.rounded(floats), view.rounded(np.floor(floats * 255 + 0.5).astype(np.uint8)))
    assert np.abs(view.rounded(floats).astype(int) - expected).max() <= 1


@pytest.mark.parametrize("method", ["forward", "rounded"])
def test_a_texture_of_another_size_is_refused_with_the_right_call(scene: Scenario, method: str) -> None:
    with pytest.raises(InputError, match=r"the view is of textures of the shape \(9, 7, 3\)") as caught:
        getattr(scene.patch_view(0, "poster", size=(9, 7)), method)(np.zeros((5, 4, 3)))
    assert caught.value.problems[0].help == "make the view with patch_view(frame, 'poster', size=(5, 4))"


@pytest.mark.slow
def test_the_memory_of_cached_frames_is_bounded(scene: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame of 4096 x 4096 whose pixels all show a patch takes 5 GB."""
    frames = [scene._scenes.patched_frame(scene.plan, scene.plan.rig.sensors[0], frame) for frame in range(3)]
    assert all(frame.memory >= 96 * 64 * 3 for frame in frames)
    monkeypatch.setattr(scenes, "PATCHED_FRAME_CACHE_BYTES", min(frame.memory for frame in frames) - 1)
    scene.close()
    shown = [scene.render(frame, textures={"poster": SECOND}) for frame in (0, 1, 2)]
    assert len(scene._scenes._patched) == 1
    np.testing.assert_array_equal(scene.render(0, textures={"poster": SECOND}), shown[0])


@pytest.mark.parametrize(
    "given",
    [[[1], [1, 2]], np.full((9, 7, 3), np.nan), np.zeros((9, 7, 3), np.int32)],
    ids=["ragged", "not a number", "int32"],
)
def test_a_view_refuses_arrays_that_are_no_image(scene: Scenario, given: Any) -> None:
    with pytest.raises(InputError, match="the texture of poster"):
        scene.patch_view(0, "poster", size=(9, 7)).forward(given)


@pytest.mark.parametrize("size", [(1.5, 2), ("a", "b"), (True, 1), (0, 1), (1 << 40, 1)])
def test_sizes_of_textures_are_whole_numbers_within_limits(scene: Scenario, size: Any) -> None:
    with pytest.raises(InputError, match="the texture of poster"):
        scene.patch_view(0, "poster", size=size)


def test_a_view_waits_for_threads_that_use_its_scene(scene: Scenario) -> None:
    """Its frame shares tables and buffers with the renderer."""
    view = scene.patch_view(0, "poster", size=(9, 7))
    expected = view.render(SECOND)
    with ThreadPoolExecutor(1) as other:
        with scene._scenes.exclusive():
            rendered = other.submit(view.render, SECOND)
            with pytest.raises(StillRunningError):
                rendered.result(timeout=0.2)
        np.testing.assert_array_equal(rendered.result(timeout=20), expected)


@pytest.mark.parametrize("size", [(5,), 5, (4, 5, 3)])
def test_a_size_is_a_pair(scene: Scenario, size: Any) -> None:
    with pytest.raises(InputError, match="give height and width"):
        scene.patch_view(0, "poster", size=size)


def test_textures_are_named(scene: Scenario) -> None:
    with pytest.raises(InputError, match="the textures are a list; give a dictionary"):
        scene.render(0, textures=[SECOND])  # type: ignore[arg-type]
