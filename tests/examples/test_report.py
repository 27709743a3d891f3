"""The study's tables and files, from results that are made up. `make test-torch`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")

NAMES = ("logo", "random texture", "noise on the logo", "digital", "one weather", "many weathers")
NAMES = (*NAMES, "many weathers, false gradient")


@pytest.fixture
def results() -> Any:
    """Two frames a weather; "many weathers" finds a person in all, others in the sun's first frame alone."""
    from examples.attacks.experiment import HELD_OUT, MANY, Outcome
    from examples.attacks.report import Results

    weathers = [weather for _ in range(2) for weather in (*MANY, *HELD_OUT)]
    texture = torch.full((1, 3, 54, 36), 0.25)
    few, every = [0.8] + [0.2] * 23, [0.8] * 24
    outcomes = {name: [Outcome(texture, [], few, [])] * (1 if name == "logo" else 3) for name in NAMES}
    outcomes["many weathers"] = [Outcome(texture, [2.0, 1.0], every, [])] * 3
    outcomes["digital"] = [Outcome(texture, [2.0], few, every)] * 3
    return Results(weathers, outcomes, [dict.fromkeys((*MANY, *HELD_OUT), 0.5 + seed / 10) for seed in range(3)])


def test_rates_are_those_of_the_scores(results: Any) -> None:
    from examples.attacks.report import tables

    groups, weathers, differences, cosines = tables(results)
    rows = {row.split(" | ")[0].strip("| "): row.strip("| ").split(" | ") for row in groups.split("\n")}
    assert rows["logo"][1:] == ["50 %", "0 %", "0 %", "0.20"]
    assert rows["many weathers"][1:] == ["100 ± 0 %", "100 ± 0 %", "100 ± 0 %", "0.80"]
    assert rows["digital, as the attack sees it"][3:] == ["100 ± 0 %", "0.80"]
    assert "| sun | 0.50 |" in weathers and "| night | 0.20 |" in weathers
    assert "| many weathers | digital | +50 ± 0 * | +100 ± 0 * | +100 ± 0 * |" in differences
    assert "| fog | 0.600 ± 0.248 |" in cosines  # 4.303 * 0.1 / sqrt(3)


def test_files_hold_every_texture_and_score(results: Any, tmp_path: Path) -> None:
    from examples.attacks.study import write

    write(results, [(f"weather={weather}#3", 6) for weather in results.weathers], tmp_path)
    kept = json.loads((tmp_path / "results.json").read_text())
    assert len(kept["results"]) == len(list(tmp_path.glob("*.png"))) == 19
    assert (tmp_path / "many-weathers-false-gradient-2.png").exists()
    (row,) = [row for row in kept["results"] if (row["name"], row["seed"]) == ("digital", 1)]
    assert (row["inserted"], row["losses"]) == ([0.8] * 24, [2.0])


def test_the_sheet_marks_people_that_are_found(results: Any, tmp_path: Path) -> None:
    import numpy as np
    from PIL import Image

    from examples.attacks.report import draw

    class Grey:
        def seen(self, texture: Any, number: int) -> Any:
            return torch.full((3, 300, 300), 0.5), torch.tensor([60.0, 60.0, 240.0, 240.0])

    draw(results, Grey(), tmp_path / "sheet.jpg")  # type: ignore[arg-type, unused-ignore]
    with Image.open(tmp_path / "sheet.jpg") as sheet:
        pixels = np.asarray(sheet.convert("RGB"), np.int64)
    marked = (pixels[..., 0] > 180) & (pixels[..., 2] < 110)
    cells = [marked[row * 220 : row * 220 + 200, 204:].any() for row in range(4)]
    assert cells == [False, False, False, True]
