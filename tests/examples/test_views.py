"""The digital view and the view with a false gradient, compared with the renderer's. `make test-torch`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.compiler.modelling import png

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")

RECIPE = """
recipe: inserted
seed: 3
base:
  clock: {fps: 10, frames: 2}
  town: {name: downtown, blocks: [1, 1]}
  patches:
    poster: {on: {town: wall.1, size: {width: 3, height: 2}}, texture: {image: texture.png}}
  sensors:
    street:
      mount: {x: -5, y: 2, z: 1.6, yaw: 165}
      camera: {width: 96, height: 64, fov: 70}
      capture: [rgb]
deltas:
  insertion: {rendered: {}, digital: {patches: {poster: {mode: digital}}}}
"""
PLACES = [("insertion=rendered", 1), ("insertion=rendered", 0)]


def image() -> NDArray[np.uint8]:
    return np.random.default_rng(3).integers(40, 200, (8, 12, 3)).astype(np.uint8)


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("views")
    (folder / "texture.png").write_bytes(png(image()))
    path = folder / "inserted.yaml"
    path.write_text(RECIPE)
    return path


@pytest.fixture(scope="module")
def texture() -> Any:
    return torch.tensor(image().transpose(2, 0, 1)[None] / 255, dtype=torch.float32)


@pytest.fixture(scope="module")
def digital(recipe: Path) -> Any:
    import recipe_runtime

    from examples.attacks.views import DigitalView

    return DigitalView({"insertion=rendered": recipe_runtime.open(recipe, "insertion=rendered")}, "poster", PLACES)


def test_a_warped_texture_equals_the_digital_mode_of_recipes(recipe: Path, digital: Any, texture: Any) -> None:
    """They agree within one level on the patch; the texture is magnified there, so it is not reduced first."""
    import recipe_runtime

    from examples.attacks.views import patch_record

    scene = recipe_runtime.open(recipe, "insertion=digital")
    for (_, frame), picture in zip(PLACES, digital.pictures(texture), strict=True):
        expected = np.asarray(scene.render(frame), np.float64)
        found = picture.numpy().transpose(1, 2, 0) * 255
        area = patch_record(scene, "poster", frame)["area"]
        other = np.asarray(recipe_runtime.open(recipe, "insertion=rendered").render(frame))
        changed = (np.round(found) != other).any(axis=2)
        assert area * 0.9 < changed.sum() <= area
        assert np.abs(found - expected)[changed].max() <= 1


def test_a_false_gradient_has_rendered_pictures_and_the_gradient_of_the_warp(
    recipe: Path, digital: Any, texture: Any
) -> None:
    from recipe_runtime.torch import SceneView

    from examples.attacks.views import FalseGradientView

    rendered = SceneView(recipe, "poster", PLACES)
    view = FalseGradientView(rendered, digital)
    torch.testing.assert_close(view.pictures(texture, 1, 1), rendered.pictures(texture, 1, 1))
    weights = torch.linspace(-1, 1, 96 * 64 * 3).reshape(1, 3, 64, 96)
    gradients = []
    for shown in (view, digital, rendered):
        variable = texture.clone().requires_grad_()
        (shown.pictures(variable, 1, 0) * weights).sum().backward()
        gradients.append(variable.grad)
    torch.testing.assert_close(gradients[0], gradients[1])
    assert not torch.allclose(gradients[0], gradients[2], rtol=0.05)


def test_batches_equal_those_of_a_scene_view(digital: Any, texture: Any) -> None:
    every = digital.pictures(texture)
    assert torch.equal(digital.pictures(texture, batch=1, step=1)[0], every[1])
    assert torch.equal(digital.pictures(texture, batch=2, step=3), every)


def test_frames_kept_without_their_renderer_are_those_of_the_renderer(recipe: Path, texture: Any) -> None:
    """Gradients are equal; so are pictures, but for one level in few pixels, for batches that start anywhere."""
    import recipe_runtime
    from recipe_runtime.torch import SceneView

    from examples.attacks.views import RenderedView

    scenarios = {"insertion=rendered": recipe_runtime.open(recipe, "insertion=rendered")}
    found = []
    for view in (RenderedView(scenarios, "poster", PLACES, (8, 12)), SceneView(recipe, "poster", PLACES)):
        given = texture.flip(3).requires_grad_()
        pictures = view.pictures(given, batch=1, step=3)
        weights = torch.linspace(-1, 1, pictures.numel()).reshape(pictures.shape)
        gradient = torch.autograd.grad((pictures * weights).sum(), given)[0]
        found.append((pictures.detach(), gradient, view.pictures(given.detach())))
    for one, other in zip(*[(row[0], row[2]) for row in found], strict=True):
        levels = (one - other).abs() * 255
        assert float(levels.max()) < 1.01 and int((levels > 0).sum()) < 5
    assert torch.equal(found[0][1], found[1][1])
    assert float(found[0][1].abs().max()) > 0
