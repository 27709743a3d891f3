"""The study's tables and files, from invented results. `make test-torch`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")

ATTACKED = ("digital", "one weather", "many weathers", "many weathers, false gradient")
NAMES = ("logo", "random texture", "noise on the logo", *ATTACKED)


@pytest.fixture
def results() -> Any:
    """Return two frames per weather; "many weathers" has all persons detected, others only that of the first in sun."""
    from examples.attacks.experiment import HELD_OUT, MANY, Outcome
    from examples.attacks.results import Results

    frames = [(f"weather={weather}#3", frame) for frame in (6, 18) for weather in (*MANY, *HELD_OUT)]
    texture = torch.full((1, 3, 54, 36), 0.25)
    few, every = [0.8] + [0.2] * 23, [0.8] * 24
    outcomes = {name: [Outcome(texture, [], few, [])] * (1 if name == "logo" else 3) for name in NAMES}
    outcomes["many weathers"] = [Outcome(texture, [2.0, 1.0], every, [])] * 3
    outcomes["digital"] = [Outcome(texture, [2.0], few, every)] * 3
    return Results(frames, outcomes, [dict.fromkeys((*MANY, *HELD_OUT), 0.5 + seed / 10) for seed in range(3)])


def test_rates_follow_from_the_scores(results: Any) -> None:
    from benchmarks.pages import markdown
    from examples.attacks.report import tables

    groups, weathers, differences, cosines, settings = (markdown(table) for table in tables(results).values())
    rows = {row.split(" | ")[0].strip("| "): row.strip("| ").split(" | ") for row in groups.split("\n")}
    assert rows["logo"][1:] == ["50 %", "0 %", "0 %", "0.20"]
    assert rows["many weathers"][1:] == ["100 ± 0 %", "100 ± 0 %", "100 ± 0 %", "0.80"]
    assert rows["digital, inserted digitally"][3:] == ["100 ± 0 %", "0.80"]
    assert "| sun | 0.50 |" in weathers and "| night | 0.20 |" in weathers
    assert "| many weathers | digital | +50 ± 0 * | +100 ± 0 * | +100 ± 0 * | +0.60 ± 0.00 * |" in differences
    assert "| 3 | 2 | 3 | 24 | 36 x 54 | 0.2 |" in settings
    assert "| fog | 0.600 ± 0.248 |" in cosines  # 4.303 * 0.1 / sqrt(3)


def test_files_contain_every_texture_and_score(results: Any, tmp_path: Path) -> None:
    from examples.attacks.results import read, write

    results.outcomes["digital"][1].texture[0, 2, 5, 7] = 1.0
    write(results, tmp_path)
    assert (tmp_path / "many-weathers-false-gradient-2.png").exists()
    kept = read(tmp_path)
    assert (kept.frames, kept.cosines) == (results.frames, results.cosines)
    for name in NAMES:
        for one, other in zip(results.outcomes[name], kept.outcomes[name], strict=True):
            torch.testing.assert_close(one.texture, other.texture, atol=0.5 / 255, rtol=0)
            assert (one.losses, one.rendered, one.inserted) == (other.losses, other.rendered, other.inserted)


def test_the_sheet_marks_detected_people(results: Any, tmp_path: Path) -> None:
    import numpy as np
    from PIL import Image

    from examples.attacks.report import draw

    class Grey:
        def seen(self, texture: Any, places: list[tuple[str, int]]) -> Any:
            boxes = torch.tensor([[60.0, 60.0, 240.0, 240.0]]).expand(len(places), -1)
            return torch.full((len(places), 3, 300, 300), 0.5), boxes

    draw(results, Grey(), tmp_path / "sheet.jpg")  # type: ignore[arg-type, unused-ignore]
    with Image.open(tmp_path / "sheet.jpg") as sheet:
        pixels = np.asarray(sheet.convert("RGB"), np.int64)
    marked = (pixels[..., 0] > 180) & (pixels[..., 2] < 110)
    cells = [marked[row * 190 : row * 190 + 160, 166:].any() for row in range(4)]
    assert cells == [False, False, False, True]


def test_the_page_has_every_table_and_the_sheet(results: Any) -> None:
    from benchmarks.pages import table_of
    from examples.attacks.report import tables
    from examples.attacks.study import COMMAND
    from tests.sources import ROOT

    page = ROOT / "docs" / "attack-study.md"
    for name, table in tables(results).items():
        kept = table_of(page, f"{COMMAND}: {name}").splitlines()
        assert kept[0] == "| " + " | ".join(table[0]) + " |" and len(kept) == len(table) + 2, name
    assert f"({page.stem}.jpg)" in page.read_text() and page.with_suffix(".jpg").stat().st_size < 100_000
