"""Random frames and changes of textures, and the limits of a printer."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.ir.errors import InputError

from tests.runtime.torch.scenes import street

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")
CLEAR, RAINY = "weather=clear", "weather=rainy"


def seeded(seed: int) -> Any:
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> Any:
    from recipe_runtime.torch import SceneView

    recipe = street(tmp_path_factory.mktemp("augment"), "a", "a", "a")
    return SceneView(recipe, "poster", sensor=["small", "left"])


def test_samples_follow_the_weights(view: Any) -> None:
    """Counts of 6000 draws are within five standard deviations of what the weights say."""

    def weight(shot: Any) -> float:
        return {CLEAR: 1.0, RAINY: 3.0}[shot.variant] * {"left": 0.0, "small": 1.0}[shot.sensor]

    drawn = view.sample(seeded(0), 6000, weight)
    assert {view.shots[k].sensor for k in drawn} == {"small"}
    rainy = sum(view.shots[k].variant == RAINY for k in drawn)
    assert abs(rainy - 4500) < 5 * (6000 * 0.75 * 0.25) ** 0.5
    each = [drawn.count(k) for k in set(drawn)]
    assert len(each) == 6 and min(each) > 400
    assert view.sample(seeded(1), 9) == view.sample(seeded(1), 9) != view.sample(seeded(2), 9)
    assert len(set(view.sample(seeded(3), 500))) == len(view.shots) == 12


@pytest.mark.parametrize(("weight", "match"), [(0.0, "all shots have the weight 0"), (-1.0, "the weight -1; weights")])
def test_wrong_weights_are_refused(view: Any, weight: float, match: str) -> None:
    with pytest.raises(InputError, match=match):
        view.sample(seeded(0), weights=lambda shot: weight)


def test_each_picture_has_its_own_augmented_texture(view: Any) -> None:
    from recipe_runtime.torch import Photometric, SceneView

    scene, texture = view.shots[0].scenario, torch.full((1, 3, 5, 7), 0.5, requires_grad=True)
    changed = SceneView(scene, "poster", [0, 0, 1], sensor="small", augment=Photometric(seeded(5)))
    plain = SceneView(scene, "poster", [0, 0, 1], sensor="small")
    pictures = changed.pictures(texture)
    expected = plain.pictures(Photometric(seeded(5))(texture.detach().expand(3, -1, -1, -1)))
    assert torch.equal(pictures, expected) and not torch.equal(pictures[0], pictures[1])
    pictures.sum().backward()
    assert texture.grad.shape == texture.shape and texture.grad.any()


def test_textures_are_augmented_by_name(view: Any) -> None:
    from recipe_runtime.torch import SceneView

    scene, grey = view.shots[0].scenario, torch.full((1, 3, 4, 4), 0.5)
    shown = {"wall": "poster", "car": "paint"}
    dark = SceneView(scene, shown, [0], sensor="small", augment={"car": torch.zeros_like})
    plain = SceneView(scene, shown, [0], sensor="small")
    expected = plain.pictures({"wall": grey, "car": torch.zeros_like(grey)})
    assert torch.equal(dark.pictures({"wall": grey, "car": grey}), expected)
    assert not torch.equal(plain.pictures({"wall": grey, "car": grey}), expected)
    with pytest.raises(InputError, match="`augment` names the texture roof; the view has wall, car"):
        SceneView(scene, shown, [0], augment={"roof": torch.zeros_like})


def test_photometric_changes_have_the_published_ranges() -> None:
    """Contrast and brightness are drawn for a texture, noise for a value: Thys et al. (2019)."""
    from recipe_runtime.torch import Photometric

    dark, bright = torch.full((400, 3, 8, 8), 0.2), torch.full((400, 3, 8, 8), 0.6)
    low, high = (Photometric(seeded(3), noise=(0.0, 0.0))(t).double() for t in (dark, bright))
    assert torch.equal(low, low[:, :1, :1, :1].expand_as(low))
    contrast = ((high - low) / 0.4)[:, 0, 0, 0]
    brightness = low[:, 0, 0, 0] - 0.2 * contrast
    for values, least, most in ((contrast, 0.8, 1.2), (brightness, -0.1, 0.1)):
        reach = most - least
        assert least - 1e-6 <= values.min() < least + 0.05 * reach and most - 0.05 * reach < values.max() <= most + 1e-6
        assert abs(values.mean() - (least + most) / 2) < 5 * reach / (12 * 400) ** 0.5
    only = Photometric(seeded(4), contrast=(1.0, 1.0), brightness=(0.0, 0.0))(bright) - bright
    assert (
        -0.1 <= only.min() < -0.09 and 0.09 < only.max() <= 0.1 and only.std() == pytest.approx(0.2 / 12**0.5, rel=0.02)
    )
    assert Photometric(seeded(4))(torch.ones(9, 3, 4, 4)).max() == 1.0


def test_a_quarter_turn_and_a_half_size() -> None:
    from recipe_runtime.torch import Geometric

    image = torch.rand(1, 3, 6, 6, generator=seeded(1))
    turned = Geometric(degrees=(90.0, 90.0), scale=(1.0, 1.0))(image)
    assert torch.allclose(turned, image.rot90(1, (2, 3)), atol=1e-5)
    smaller = Geometric(degrees=(0.0, 0.0), scale=(0.5, 0.5), fill=0.25)(torch.ones(1, 3, 8, 8))
    assert torch.equal(smaller[..., 3:5, 3:5], torch.ones(1, 3, 2, 2)) and (smaller[..., 0, :] == 0.25).all()
    wide = torch.zeros(1, 3, 4, 8)
    wide[..., 1:3, 2:6] = 1.0  # turned, it is twice as high and half as wide
    assert torch.allclose(
        Geometric(degrees=(90.0, 90.0), scale=(1.0, 1.0), fill=0.0)(wide)[..., 0:4, 3:5].mean(), torch.tensor(1.0)
    )


def test_non_printability() -> None:
    """The product of the distances to all colours, for each texel: Sharif et al. (2016)."""
    from recipe_runtime.torch import Printable

    printer = Printable(colours=[(0, 0, 0), (255, 255, 255)])
    one = torch.tensor([0.2, 0.4, 0.6], dtype=torch.float64)
    expected = (0.2**2 + 0.4**2 + 0.6**2) ** 0.5 * (0.8**2 + 0.6**2 + 0.4**2) ** 0.5
    assert printer.non_printability(one[:, None, None]).item() == pytest.approx(expected)
    two = torch.stack([one, torch.ones(3, dtype=torch.float64)], dim=1)[None, :, None]  # one texel is printable
    assert printer.non_printability(two).item() == pytest.approx(expected / 2)
    chart, texture = Printable(), torch.rand(1, 3, 6, 6, generator=seeded(1)).requires_grad_()
    field = torch.tensor([115, 82, 68]).reshape(1, 3, 1, 1) / 255
    assert chart.non_printability(field).item() < 1e-9 < chart.non_printability(texture).item()
    (gradient,) = torch.autograd.grad(chart.non_printability(torch.cat([texture, field.expand(1, 3, 6, 6)])), texture)
    assert gradient.isfinite().all() and gradient.any()


def test_range_and_total_variation() -> None:
    from recipe_runtime.torch import Printable, total_variation

    ramp = torch.linspace(0, 1, 5, dtype=torch.float64).expand(1, 3, 4, 5).clone().requires_grad_()
    assert Printable(low=0.1, high=0.8)(ramp).unique().tolist() == pytest.approx([0.1, 0.25, 0.5, 0.75, 0.8])
    assert total_variation(ramp).item() == pytest.approx(0.25)
    both = ramp + torch.linspace(0, 1, 4, dtype=torch.float64)[:, None]
    assert total_variation(both).item() == pytest.approx((0.25**2 + (1 / 3) ** 2) ** 0.5)
    flat = torch.full((1, 3, 4, 4), 0.5, requires_grad=True)
    (gradient,) = torch.autograd.grad(total_variation(flat), flat)
    assert not gradient.any()
