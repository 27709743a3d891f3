"""`SceneView`: the frames' bytes, the exact gradient, and the interface that attacks expect. `make test-torch`."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.ir.errors import InputError

from tests.runtime.attacks.test_textures import RENDERED, SECOND, recipe_with
from tests.sources import ROOT

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")
CLEAR = "weather=clear,insertion=rendered"
PLACES = [(RENDERED, 0), (CLEAR, 2), (RENDERED, 1)]


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recipe_with(tmp_path_factory.mktemp("scene_view"), "first")


@pytest.fixture(scope="module")
def view(recipe: Path) -> Any:
    from recipe_runtime.torch import SceneView

    return SceneView(recipe, "poster", PLACES)


def texture_of(image: Any, **options: Any) -> Any:
    return torch.tensor(image.transpose(2, 0, 1)[None] / 255.0, dtype=torch.float32, **options)


def test_pictures_are_the_frames_bytes(view: Any, recipe: Path) -> None:
    texture = texture_of(SECOND)
    pictures, targets = view(texture)
    assert pictures.shape == (3, 3, 64, 96) and pictures.dtype == torch.float32
    for (variant, frame), shown, target in zip(PLACES, pictures, targets, strict=True):
        scene = recipe_runtime.open(recipe, variant)
        expected = scene.render(frame, textures={"poster": texture})
        assert torch.equal(shown, torch.from_numpy(expected.transpose(2, 0, 1)) / 255)
        assert len(target["boxes"]) == len(scene.labels(frame)) and target["labels"].dtype == torch.int64


def test_batches_follow_each_other(view: Any) -> None:
    texture, whole = texture_of(SECOND), view(texture_of(SECOND))[0]
    assert torch.equal(view(texture, batch=2, step=0)[0], whole[[0, 1]])
    assert torch.equal(view(texture, batch=2, step=1)[0], whole[[2, 0]])
    assert torch.equal(view.pictures(texture, batch=1, step=5), whole[[2]])


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda view: pickle.loads(pickle.dumps(view))])
def test_a_used_view_can_be_copied_and_saved(view: Any, copied: Any) -> None:
    """Models are copied for averages of weights, and stored with `torch.save`, after the first step too."""
    texture = texture_of(SECOND)
    whole = view.pictures(texture)
    assert torch.equal(copied(view).pictures(texture), whole)


def test_an_unknown_sensor_is_an_error_when_the_view_is_made(recipe: Path) -> None:
    from recipe_runtime.torch import SceneView

    with pytest.raises(InputError, match="no sensor 'roof'"):
        SceneView(recipe, "poster", PLACES, sensor="roof")


def test_the_gradient_is_that_of_the_views(view: Any, recipe: Path) -> None:
    texture = texture_of(SECOND, requires_grad=True)
    pictures, _ = view(texture)
    weights = torch.linspace(-1, 1, pictures.numel()).reshape(pictures.shape)
    (pictures * weights).sum().backward()
    expected = np.zeros(SECOND.shape)
    for (variant, frame), weight in zip(PLACES, weights, strict=True):
        part = recipe_runtime.open(recipe, variant).patch_view(frame, "poster", size=(7, 9))
        expected += part.backward(texture.detach().numpy()[0].transpose(1, 2, 0), weight.numpy().transpose(1, 2, 0))
    np.testing.assert_allclose(texture.grad.numpy()[0].transpose(1, 2, 0), expected, rtol=1e-6, atol=1e-6)
    assert np.abs(expected).max() > 0.01


@pytest.mark.parametrize("quantise", [True, False])
def test_values_outside_0_to_1_are_clipped_and_have_no_gradient(recipe: Path, quantise: bool) -> None:
    """Attacks step outside the range, which patch views refuse."""
    from recipe_runtime.torch import SceneView

    view = SceneView(recipe, "poster", PLACES[:1], quantise=quantise)
    values = torch.full((1, 3, 9, 7), 0.5)
    values[..., 0], values[..., 1] = -0.25, 1.25
    texture = values.requires_grad_()
    pictures = view.pictures(texture)
    assert torch.equal(pictures, view.pictures(texture.detach().clamp(0, 1)))
    pictures.sum().backward()
    assert not texture.grad[..., :2].any() and texture.grad[..., 2:].any()


GRADIENT = """
import sys
from hashlib import sha256
import torch
from recipe_runtime.torch import SceneView
from tests.runtime.attacks.test_scene_view import PLACES

view = SceneView(sys.argv[1], "poster", PLACES)
texture = (torch.arange(3 * 40 * 56).reshape(1, 3, 40, 56) % 97 / 96).requires_grad_()
pictures = view.pictures(texture)
weights = torch.arange(pictures.numel()).reshape(pictures.shape) % 89 / 88 - 0.4
(gradient,) = torch.autograd.grad(pictures, texture, weights)
assert gradient.abs().max() > 0.01
print(torch.get_num_threads(), *(sha256(t.detach().numpy().tobytes()).hexdigest() for t in (pictures, gradient)))
"""


def test_pictures_and_gradients_have_equal_bytes_with_any_number_of_threads(recipe: Path) -> None:
    """Compared in two processes, one with one thread and one with two."""
    lines = []
    for threads in ("1", "2"):
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        command = [sys.executable, "-c", GRADIENT, str(recipe)]
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        lines.append(done.stdout.splitlines()[-1].split())
    (one, *expected), (two, *found) = lines
    assert (one, two) == ("1", "2")
    assert found == expected


def test_the_memory_of_cached_views_is_bounded(recipe: Path) -> None:
    """Pictures are the same when evicted views are created again."""
    from recipe_runtime.torch import SceneView

    texture = texture_of(SECOND)
    all_kept, one_kept = SceneView(recipe, "poster", PLACES), SceneView(recipe, "poster", PLACES, memory=1)
    for _ in range(2):
        assert torch.equal(all_kept.pictures(texture), one_kept.pictures(texture))
    assert (len(all_kept._views), len(one_kept._views)) == (3, 1)


def test_frames_through_a_lens_and_of_inserted_patches(recipe: Path) -> None:
    """Quantised pictures are the frames' bytes there too, and one gradient includes rendered and inserted patches."""
    from recipe_runtime.torch import SceneView

    path, digital = recipe.with_name("lens.yaml"), "weather=rainy,insertion=digital"
    text = recipe.read_text().replace("fov: 70}", "fov: 70, lens_k: 0.1, motion_blur_intensity: 4, bloom_intensity: 2}")
    path.write_text(text.replace("insertion: {", "insertion: {digital: {patches: {poster: {mode: digital}}}, "))
    view, texture = SceneView(path, "poster", [(RENDERED, 1), (digital, 1)]), texture_of(SECOND, requires_grad=True)
    pictures = view.pictures(texture)
    for variant, shown in zip((RENDERED, digital), pictures.detach(), strict=True):
        expected = recipe_runtime.open(path, variant).render(1, textures={"poster": SECOND})
        np.testing.assert_array_equal((shown * 255).round().to(torch.uint8).numpy().transpose(1, 2, 0), expected)
    first, second = (torch.autograd.grad(p.sum(), texture, retain_graph=True)[0] for p in pictures)
    (both,) = torch.autograd.grad(pictures.sum(), texture)
    assert first.abs().max() > 0.01 and second.abs().max() > 0.01 and torch.allclose(first + second, both, atol=1e-4)


def test_gradcheck_of_torch_passes(recipe: Path) -> None:
    from recipe_runtime.torch import SceneView

    smooth = SceneView(recipe, "poster", [(RENDERED, 0)], quantise=False)
    texture = torch.tensor(np.random.default_rng(0).uniform(0.1, 0.9, (1, 3, 2, 2)), requires_grad=True)

    def means(t: Any) -> Any:
        return smooth.pictures(t)[..., 20:40, 30:60].mean(dim=(2, 3))

    assert torch.autograd.gradcheck(means, texture, atol=1e-5)


def test_gradient_descent_converges(view: Any) -> None:
    """Gradient descent recovers a texture that produces the same picture as another texture."""
    goal = view.pictures(texture_of(SECOND), batch=1).detach()
    texture = torch.full((1, 3, 7, 9), 0.5, requires_grad=True)
    optimiser, losses = torch.optim.Adam([texture], lr=0.05), []
    for _ in range(25):
        loss = ((view.pictures(texture.clamp(0, 1), batch=1) - goal) ** 2).sum()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < 0.3 * losses[0]


def test_unknown_names_are_refused(recipe: Path) -> None:
    from recipe_runtime.torch import SceneView

    with pytest.raises(InputError, match="no variant 'weather=snow'"):
        SceneView(recipe, "poster", [("weather=snow", 0)])
    with pytest.raises(InputError, match="no patch 'sticker'"):
        SceneView(recipe, "sticker", [(RENDERED, 0)])


@pytest.mark.parametrize(
    ("texture", "match"),
    [
        (torch.full((1, 3, 4, 4), 200, dtype=torch.uint8), "is torch.uint8 of the shape .*divided by 255"),
        (np.full((4, 4, 3), 0.5), "is ndarray; give a tensor"),
        (torch.full((9,), 0.5), "of the shape"),
    ],
)
def test_textures_of_other_types_are_refused(view: Any, texture: object, match: str) -> None:
    """Regression: bytes were taken for floats and clipped to 1, and the pictures, rounded down to bytes, were black."""
    with pytest.raises(InputError, match=match):
        view.pictures(texture, batch=1)


def test_the_gradient_has_no_derivative(view: Any) -> None:
    """Regression: a penalty on the gradient lost its share of the derivative without a message."""
    texture = texture_of(SECOND, requires_grad=True)
    loss = (view.pictures(texture, batch=1) ** 2).sum()
    (gradient,) = torch.autograd.grad(loss, texture, create_graph=True)
    assert torch.equal(gradient, torch.autograd.grad((view.pictures(texture, batch=1) ** 2).sum(), texture)[0])
    with pytest.raises(InputError, match="cannot be differentiated again"):
        torch.autograd.grad((gradient**2).sum() + texture.sum(), texture)


def test_bfloat16_is_accepted(view: Any, recipe: Path) -> None:
    """Regression: NumPy has no such type, so a TypeError of PyTorch came out."""
    texture = texture_of(SECOND).to(torch.bfloat16)
    assert torch.equal(
        view.pictures(texture, batch=1).float(), view.pictures(texture.float(), batch=1).to(torch.bfloat16).float()
    )
    with recipe_runtime.open(recipe, RENDERED) as scene:
        shown = scene.render(0, textures={"poster": texture})
        np.testing.assert_array_equal(shown, scene.render(0, textures={"poster": texture.float()}))
        one = scene.patch_view(0, "poster", size=(len(SECOND), len(SECOND[0])))
        ones = torch.ones((3, 64, 96))
        np.testing.assert_array_equal(
            one.backward(texture, ones.to(torch.bfloat16)), one.backward(texture.float(), ones)
        )


def test_frames_and_batches_are_checked(view: Any, recipe: Path) -> None:
    from recipe_runtime.torch import SceneView

    assert SceneView(recipe, "poster", np.arange(2)).frames == SceneView(recipe, "poster", [0, 1]).frames  # type: ignore[arg-type]
    with pytest.raises(InputError, match="has none"):
        SceneView(recipe, "poster", [])
    with pytest.raises(InputError, match="a batch has one picture or more, and not 0"):
        view(texture_of(SECOND), batch=0)


@pytest.mark.gpu
@pytest.mark.parametrize("quantise", [True, False])
def test_a_gpu_gives_the_same_pictures_and_gradients(recipe: Path, quantise: bool) -> None:
    """Also on another stream of PyTorch, with other work before and after it."""
    from recipe_runtime.torch import SceneView

    texture = texture_of(SECOND)
    found = {}
    for device in ("cpu", "cuda:0", "cuda:0 on a stream"):
        place, _, own_stream = device.partition(" ")
        view = SceneView(recipe, "poster", PLACES, quantise=quantise, device=place)
        with torch.cuda.stream(torch.cuda.Stream() if own_stream else torch.cuda.default_stream()):
            for _ in range(3):
                shown = texture.to(place).requires_grad_()
                pictures = view.pictures(shown)
                weights = torch.linspace(-1, 1, pictures.numel(), dtype=torch.float64).reshape(pictures.shape).to(place)
                (gradient,) = torch.autograd.grad(pictures, shown, weights.to(pictures.dtype))
                assert pictures.device == gradient.device == shown.device
            found[device] = pictures.detach().cpu(), gradient.cpu()
    for pictures, gradient in list(found.values())[1:]:
        assert torch.equal(pictures, found["cpu"][0]) and torch.equal(gradient, found["cpu"][1])
