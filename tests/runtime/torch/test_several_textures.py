"""Views of several patches, sensors, towns and textures: the bytes of a build, and the exact gradient."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from PIL import Image
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.loading import opened

from tests.compiler.modelling import png
from tests.runtime.torch.scenes import IMAGES, square, street

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")
PAINTED = "paint: {on: {actor: car}, texture: {frames: film}}"
CLEAR, RAINY = "weather=clear", "weather=rainy"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("views")


@pytest.fixture(scope="module")
def recipe(folder: Path) -> Path:
    return street(folder, "a", "a", "a")


def texture_of(*images: str) -> Any:
    return torch.tensor(np.stack([IMAGES[name].transpose(2, 0, 1) / 255.0 for name in images]), dtype=torch.float32)


def built(recipe: Path, variant: str | None, frame: int, sensor: str) -> Any:
    """Return a frame of a recipe, which `recipe build` writes too, as a picture [3, H, W], 0 to 1."""
    with recipe_runtime.open(recipe, variant) as scene:
        return torch.from_numpy(np.array(scene.render(frame, sensor).transpose(2, 0, 1))) / 255


def test_several_patches_and_sensors(recipe: Path, folder: Path) -> None:
    """Each sensor takes each frame; targets are those of the sensor."""
    from recipe_runtime.torch import SceneView

    view = SceneView(recipe, {"wall": "poster", "over": "sticker"}, [(RAINY, 1), (CLEAR, 2)], sensor=["left", "right"])
    pictures, targets = view({"over": texture_of("c"), "wall": texture_of("b")})
    expected = street(folder, "b", "c", "a")
    assert [(*shot.place, shot.sensor) for shot in view.shots] == [
        (RAINY, 1, "left"),
        (RAINY, 1, "right"),
        (CLEAR, 2, "left"),
        (CLEAR, 2, "right"),
    ]
    for shot, shown, target in zip(view.shots, pictures, targets, strict=True):
        assert torch.equal(shown, built(expected, shot.variant, shot.frame, shot.sensor))
        labels = shot.scenario.labels(shot.frame, shot.sensor)
        assert target["area"].tolist() == [record["area"] for record in labels]
    assert not torch.equal(pictures[0], pictures[1])


def test_pictures_are_those_of_a_built_dataset(recipe: Path, tmp_path: Path) -> None:
    """Of several patches, sensors and variants at once, with another texture in each frame."""
    from recipe_runtime.torch import SceneView

    film = [IMAGES["b"], IMAGES["b"][::-1], IMAGES["b"][:, ::-1]]
    path = street(tmp_path, "a", "c", "b")
    (tmp_path / "film").mkdir()
    for k, image in enumerate(film):
        (tmp_path / f"film/{k}.png").write_bytes(png(np.ascontiguousarray(image)))
    path.write_text(path.read_text().replace("paint: {on: {actor: car}, texture: {image: b.png}}", PAINTED))
    plan, engines = opened(path)
    build(plan, tmp_path / "out", BuildOptions(engines=engines, cache=tmp_path / "cache", workers=0))

    view = SceneView(recipe, {"over": "sticker", "film": "paint"}, sensor=["left", "right"])
    frames = torch.tensor(np.stack(film).transpose(0, 3, 1, 2) / 255.0, dtype=torch.float32)
    pictures = view.pictures({"over": texture_of("c"), "film": frames[[shot.frame for shot in view.shots]]})
    assert len(pictures) == 12
    for shot, shown in zip(view.shots, pictures, strict=True):
        file = tmp_path / "out" / layout.modality_file(shot.variant, shot.sensor, "rgb", shot.frame, "png")
        assert torch.equal(
            (shown * 255).round().to(torch.uint8), torch.from_numpy(np.array(Image.open(file))).permute(2, 0, 1)
        )


def test_one_texture_on_patches_actors_and_towns(recipe: Path, folder: Path) -> None:
    """A universal patch: its gradient is the sum of those of all patches that show it."""
    from recipe_runtime.torch import SceneView

    here = SceneView(recipe, {"logo": ["poster", "paint"]}, [(RAINY, 0)], sensor="left")
    view = here + SceneView(square(folder, "a"), {"logo": "road"})
    texture = texture_of("b").requires_grad_()
    pictures = view.pictures(texture)
    assert view.textures == ("logo",) and view.frames == [(RAINY, 0), ("base", 0)]
    assert torch.equal(pictures[0], built(street(folder, "b", "a", "b"), RAINY, 0, "left"))
    assert torch.equal(pictures[1], built(square(folder, "b"), None, 0, "roof"))
    (gradient,) = torch.autograd.grad(pictures.square().sum(), texture)
    apart = SceneView(recipe, {"one": "poster", "two": "paint"}, [(RAINY, 0)], sensor="left")
    parts = {"one": texture.detach().requires_grad_(), "two": texture.detach().clone().requires_grad_()}
    road = texture.detach().clone().requires_grad_()
    apart.pictures(parts).square().sum().backward()
    SceneView(square(folder, "a"), "road").pictures(road).square().sum().backward()
    each = [parts["one"].grad, parts["two"].grad, road.grad]
    assert all(part.abs().max() > 0.01 for part in each)
    assert torch.allclose(gradient, sum(each), rtol=1e-5, atol=1e-6)


def test_a_texture_for_each_frame(recipe: Path, folder: Path) -> None:
    """A video: each frame shows its own texture, and only this one has its gradient."""
    from recipe_runtime.torch import SceneView

    view = SceneView(recipe, "paint", [(CLEAR, k) for k in range(3)], sensor="left")
    film = torch.cat([texture_of("a"), texture_of("a").flip(2), texture_of("a").flip(3)]).requires_grad_()
    pictures, targets = view(film)
    assert len(targets) == 3
    with recipe_runtime.open(recipe, CLEAR) as scene:
        for k, shown in enumerate(pictures):
            expected = scene.render(k, "left", textures={"paint": film[k]})
            assert torch.equal(shown, torch.from_numpy(expected.transpose(2, 0, 1)) / 255)
    (one,) = torch.autograd.grad(pictures[1].sum(), film, retain_graph=True)
    assert one[1].any() and not one[[0, 2]].any()
    (part,) = torch.autograd.grad(view.pictures(film[1:2], at=[1]).sum(), film)
    assert torch.equal(part, one)
    at = [2, 0]
    assert torch.equal(view.pictures(film[at], at=at), pictures[at])


def test_a_batch_of_textures_in_every_frame(recipe: Path) -> None:
    """`repeat_interleave` shows each texture in all frames; a batch alone shows the k-th in the k-th frame."""
    from recipe_runtime.torch import SceneView

    view = SceneView(recipe, "poster", [(RAINY, 0), (CLEAR, 1)], sensor="left")
    batch = torch.cat([texture_of("a"), texture_of("a").flip(2), 1 - texture_of("a")])
    all_pairs = view.pictures(batch.repeat_interleave(2, 0))
    assert torch.equal(all_pairs, torch.cat([view.pictures(texture) for texture in batch]))
    assert torch.equal(view.pictures(batch), all_pairs[[0, 3, 4]])


def test_directional_finite_differences(recipe: Path) -> None:
    """In float64, without rounding: all textures of several patches, sensors and frames move at once."""
    from recipe_runtime.torch import SceneView

    shown = {"film": ["poster", "paint"], "still": "sticker"}
    view = SceneView(recipe, shown, [(RAINY, 0), (CLEAR, 2)], sensor=["left", "right"], quantise=False)
    draw = torch.Generator().manual_seed(1)
    start = {"film": torch.rand(4, 3, 12, 20, generator=draw, dtype=torch.float64), "still": texture_of("b").double()}
    start = {name: (values * 0.9 + 0.05).requires_grad_() for name, values in start.items()}
    way = {name: torch.randn(values.shape, generator=draw, dtype=torch.float64) for name, values in start.items()}
    weights = torch.randn(4, 3, 64, 96, generator=draw, dtype=torch.float64)

    def loss(step: float) -> Any:
        return (view.pictures({name: values + step * way[name] for name, values in start.items()}) * weights).sum()

    gradients = torch.autograd.grad(loss(0.0), list(start.values()))
    found = sum((gradient * way[name]).sum() for gradient, name in zip(gradients, start, strict=True))
    with torch.no_grad():
        measured = (loss(1e-7) - loss(-1e-7)) / 2e-7
    assert found.item() == pytest.approx(measured.item(), rel=1e-4) and abs(found) > 1e-2


def test_attacks_on_batches_run_unchanged(recipe: Path) -> None:
    """The steps of torchattacks' PGD and foolbox's L-infinity PGD, with a model that has this view in front."""
    from recipe_runtime.torch import SceneView

    view = SceneView(recipe, "poster", [(CLEAR, 0)], sensor="left")

    class Model(torch.nn.Module):  # type: ignore[misc, name-defined, unused-ignore]
        def forward(self, textures: Any) -> Any:
            red, green, _ = view.pictures(textures)[..., 20:40, 30:50].mean(dim=(2, 3)).unbind(1)
            return torch.stack([red, green], dim=1) * 50

    model, labels = Model().eval(), torch.tensor([0, 1])
    images = torch.full((2, 3, 8, 16), 0.5)
    adversarial = images.clone()
    for _ in range(5):
        adversarial.requires_grad_()
        loss = torch.nn.functional.cross_entropy(model(adversarial), labels)
        (gradient,) = torch.autograd.grad(loss, adversarial)
        adversarial = adversarial.detach() + 0.1 * gradient.sign()
        adversarial = torch.clamp(images + torch.clamp(adversarial - images, -0.4, 0.4), 0, 1).detach()
    before, after = model(images), model(adversarial)
    wrong = 1 - labels
    margin = after - before
    assert (margin.gather(1, wrong[:, None]) - margin.gather(1, labels[:, None]) > 1).all()


MANY = {"wall": "poster", "over": "sticker"}


@pytest.mark.parametrize(
    ("texture", "options", "match"),
    [
        (lambda t: t, {}, r"has the textures wall, over; give each, by its name"),
        (lambda t: {"wall": t}, {}, r"has the textures wall, over, and those given are wall"),
        (lambda t: {"wall": t, "over": t[:, :2]}, {}, r"over is torch.float32 of the shape \(1, 2, 12, 20\)"),
        (
            lambda t: {"wall": t, "over": t.expand(5, -1, -1, -1)},
            {"batch": 2},
            r"shape \(5, 3, 12, 20\), but the view shows 2",
        ),
        (
            lambda t: {"wall": t * 255, "over": t},
            {},
            r"from 0 to 255; textures are from 0 to 1: divide 8-bit",
        ),
        (lambda t: {"wall": t * 2 - 1, "over": t}, {}, r"wall has values from -1 to 1; textures are from 0 to 1"),
        (lambda t: {"wall": t, "over": t * np.nan}, {}, r"over has values that are not finite"),
        (lambda t: {"wall": t, "over": t}, {"at": []}, "a batch has one picture or more"),
        (
            lambda t: {"wall": t, "over": t},
            {"at": [0], "batch": 2},
            "by `at`, or by `batch` and `step`, and not by both",
        ),
    ],
)
def test_wrong_textures_are_refused(recipe: Path, texture: Any, options: Any, match: str) -> None:
    from recipe_runtime.torch import SceneView

    with pytest.raises(InputError, match=match):
        SceneView(recipe, MANY, sensor="small").pictures(texture(texture_of("a")), **options)


def test_wrong_patches_are_refused(recipe: Path) -> None:
    from recipe_runtime.torch import SceneView

    wrong: list[tuple[Any, str]] = [
        ({}, "names none"),
        (["poster", "paint"], "the patches are a list; give the name of one, or a dictionary"),
        ({"a": ["poster"], "b": "poster"}, "patch poster: it shows one texture, and the mapping names it twice"),
        ({"a": ["poster", "roof"]}, "no patch 'roof'"),
    ]
    for patches, match in wrong:
        with pytest.raises(InputError, match=match):
            SceneView(recipe, patches)
    with pytest.raises(InputError, match="pictures of 48 x 32 and 96 x 64 pixels are no batch"):
        SceneView(recipe, "poster", [0], sensor=["left", "small"]).pictures(texture_of("a"))


def test_all_frames_of_all_sensors_by_default(recipe: Path) -> None:
    from recipe_runtime.torch import SceneView

    view = SceneView(recipe, "poster", sensor=("left", "right"))
    found = [(*shot.place, shot.sensor) for shot in view.shots]
    assert found == list(itertools.product((CLEAR, RAINY), range(3), ("left", "right")))
