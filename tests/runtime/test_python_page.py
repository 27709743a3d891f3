"""The Python examples of README and docs run unchanged, on smaller recipes."""

from __future__ import annotations

import importlib
import re
import shutil
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.ir.errors import Code, InputError

from tests.compiler.modelling import png
from tests.sources import ROOT

CAMERA = ("width: 800, height: 600", "width: 32, height: 24")
SMALLER = {
    "recipes/weather_sweep.yaml": [CAMERA, ("vehicles: 6, pedestrians: 6", "vehicles: 0, pedestrians: 0")],
    "recipes/attacks/poster.yaml": [CAMERA, ("vehicles: 4, pedestrians: 6", "vehicles: 0, pedestrians: 0")],
}


def examples(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


def smaller(text: str, changes: list[tuple[str, str]]) -> str:
    for large, small in changes:
        assert large in text
        text = text.replace(large, small)
    return text


@pytest.fixture(autouse=True)
def small_recipes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "recipes/attacks").mkdir(parents=True)
    for path, changes in SMALLER.items():
        text = smaller((ROOT / path).read_text(encoding="utf-8"), changes)
        (tmp_path / path).write_text(text, encoding="utf-8")
    shutil.copy(ROOT / "recipes/attacks/poster.png", tmp_path / "recipes/attacks")
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_an_example_runs_unchanged(page: str) -> None:
    """Regression: the example of docs/python.md used frame 40 of 31, and raised IndexError."""
    known: dict[str, object] = {}
    exec(examples(page)[0], known)
    picture, metres = known["picture"], known["metres"]
    assert isinstance(picture, np.ndarray) and isinstance(metres, np.ndarray)
    assert (picture.dtype, picture.shape, metres.dtype, metres.shape) == (np.uint8, (24, 32, 3), np.float32, (24, 32))
    assert known.get("records") != []


@pytest.mark.slow
def test_the_example_of_a_patch_view_runs_unchanged() -> None:
    """A step against the gradient must bring the picture nearer to the goal."""
    known: dict[str, Any] = {}
    exec(examples("docs/attacks.md")[0], known)
    image, goal, view, values = (known[name] for name in ("image", "goal", "view", "values"))
    assert known["picture"].shape == (24, 32, 3) and np.abs(known["picture"] - values * 255).max() < 1.6
    assert known["gradient"].shape == image.shape and (known["gradient"] > 0).any()
    stepped = view.forward(image - 0.01 * (known["gradient"] > 0))
    assert ((stepped - goal) ** 2).sum() < ((values - goal) ** 2).sum()


@pytest.mark.slow
def test_the_recipe_of_a_painted_car_shows_its_paint(tmp_path: Path) -> None:
    """The recipe on the page is complete, and works with an image of any size."""
    page = (ROOT / "docs/attacks.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^    recipe: painted\n(?:    .*\n)*", page, re.MULTILINE)
    (tmp_path / "painted.yaml").write_text(smaller(textwrap.dedent(text), [CAMERA]), encoding="utf-8")
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps/vehicle.sedan.a.body.png").write_bytes(png(np.full((3, 4, 3), [255, 0, 255], np.uint8)))
    with recipe_runtime.open(tmp_path / "painted.yaml") as scene:
        picture = scene.render(5).astype(int)
        assert scene.patches(5)["patches"][0]["area"] > 20
    assert ((picture[..., 0] > picture[..., 1] + 60) & (picture[..., 2] > picture[..., 1] + 60)).sum() > 20


def test_without_pytorch_the_error_has_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)  # its import then fails as if it were not installed
    monkeypatch.delitem(sys.modules, "recipe_runtime.torch", raising=False)
    with pytest.raises(InputError) as caught:
        importlib.import_module("recipe_runtime.torch")
    (problem,) = caught.value.problems
    assert (problem.code, problem.message) == (Code.MISSING_LIBRARY, "PyTorch is not installed")
    assert problem.help == "install it: pip install 'torch>=2.6'"
