"""The Python examples of README and docs/python.md run as they stand, on a recipe that differs in its size alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.sources import ROOT

RECIPE = Path("recipes/weather_sweep.yaml")
LARGE = {
    "width: 800, height: 600": "width: 32, height: 24",
    "vehicles: 6, pedestrians: 6": "vehicles: 0, pedestrians: 0",
}


def examples(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture(autouse=True)
def small_recipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / RECIPE).read_text(encoding="utf-8")
    for large, small in LARGE.items():
        assert large in text
        text = text.replace(large, small)
    (tmp_path / RECIPE).parent.mkdir()
    (tmp_path / RECIPE).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_an_example_runs_unchanged(page: str) -> None:
    """That of docs/python.md asked for frame 40 of 31, and raised IndexError."""
    known: dict[str, object] = {}
    exec(examples(page)[0], known)
    picture, metres = known["picture"], known["metres"]
    assert isinstance(picture, np.ndarray) and isinstance(metres, np.ndarray)
    assert (picture.dtype, picture.shape, metres.dtype, metres.shape) == (np.uint8, (24, 32, 3), np.float32, (24, 32))
    assert known.get("records") != []


@pytest.mark.torch
@pytest.mark.filterwarnings("ignore:This DataLoader will create")  # more workers than this host has cores
def test_the_example_of_pytorch_runs_unchanged() -> None:
    pytest.importorskip("torch")
    known: dict[str, object] = {}
    exec(examples("docs/python.md")[1], known)
    assert known["batch"]
