"""`torch.func` on a view: `grad`, `vmap`, `jacrev` and `functional_call` agree with autograd."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.ir.errors import InputError

from tests.runtime.torch.scenes import street

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> Any:
    from recipe_runtime.torch import SceneView

    recipe = street(tmp_path_factory.mktemp("functional"), "a", "a", "a")
    frames = [("weather=rainy", 0), ("weather=clear", 1)]
    return SceneView(recipe, {"wall": "poster", "car": "paint"}, frames, sensor="small", quantise=False)


@pytest.fixture(scope="module")
def textures() -> dict[str, Any]:
    draw = torch.Generator().manual_seed(2)
    return {name: torch.rand(3, 1, 3, 4, 5, generator=draw, dtype=torch.float64) for name in ("wall", "car")}


def loss(view: Any, textures: dict[str, Any]) -> Any:
    return view.pictures(textures).square().mean(dim=(1, 2, 3))


def first(textures: dict[str, Any]) -> dict[str, Any]:
    return {name: values[0] for name, values in textures.items()}


def test_grad(view: Any, textures: dict[str, Any]) -> None:
    one = {name: values.requires_grad_() for name, values in first(textures).items()}
    expected = torch.autograd.grad(loss(view, one).sum(), list(one.values()))
    found = torch.func.grad(lambda t: loss(view, t).sum())(first(textures))
    assert all(torch.equal(a, b) and a.any() for a, b in zip(found.values(), expected, strict=True))


@pytest.mark.parametrize("mapped", [{"wall": 0, "car": 0}, {"wall": 1, "car": None}])
def test_vmap_of_values_and_of_gradients(view: Any, textures: dict[str, Any], mapped: dict[str, int | None]) -> None:
    given = {n: v if mapped[n] == 0 else v.movedim(0, 1) if mapped[n] else v[0] for n, v in textures.items()}
    each = [{n: v[0] if mapped[n] is None else v[k] for n, v in textures.items()} for k in range(3)]
    values = torch.func.vmap(lambda t: loss(view, t), in_dims=(mapped,))(given)
    assert torch.equal(values, torch.stack([loss(view, one) for one in each]))
    gradient = torch.func.grad(lambda t: loss(view, t).sum())
    found = torch.func.vmap(gradient, in_dims=(mapped,))(given)
    for name in textures:
        assert torch.equal(found[name], torch.stack([gradient(one)[name] for one in each]))


def test_jacrev(view: Any, textures: dict[str, Any]) -> None:
    jacobian = torch.func.jacrev(lambda t: loss(view, t))(first(textures))
    for k in range(2):
        row = torch.func.grad(lambda t, k=k: loss(view, t)[k])(first(textures))
        assert all(torch.equal(jacobian[name][k], row[name]) for name in row)


def test_functional_call(view: Any, textures: dict[str, Any]) -> None:
    class Poster(torch.nn.Module):  # type: ignore[misc, name-defined, unused-ignore]
        def __init__(self) -> None:
            super().__init__()
            self.view, self.wall = view, torch.nn.Parameter(torch.zeros(1, 3, 4, 5, dtype=torch.float64))

        def forward(self, car: Any) -> Any:
            return loss(self.view, {"wall": self.wall, "car": car})

    one, model = first(textures), Poster()
    found = torch.func.functional_call(model, {"wall": one["wall"]}, (one["car"],))
    assert torch.equal(found, loss(view, one)) and not torch.equal(found, model(one["car"]))


def test_second_derivatives_are_refused(view: Any, textures: dict[str, Any]) -> None:
    once = torch.func.grad(lambda t: loss(view, t).sum())
    with pytest.raises(InputError, match="cannot be differentiated again"):
        torch.func.grad(lambda t: once(t)["wall"].sum())(first(textures))
