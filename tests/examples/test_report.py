"""The study's tables and files, from invented results. `make test-torch`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")

STEPS, GREY = (1, 2), 0.25


def scores(name: str, steps: int) -> dict[str, list[float]]:
    """Return 0.8 for "many weathers" after all steps, in its own scene; else for the first weather only."""
    from examples.attacks.detectors import DETECTORS
    from examples.attacks.experiment import ATTACKS, MOMENTS, SCENES, WEATHERS

    few = ([0.8] + [0.2] * (len(WEATHERS) - 1)) * MOMENTS
    every = [0.8] * len(few)
    own = every if name == "many weathers" and steps == STEPS[-1] else few
    rows = {f"{one} in {scene}": own for one in DETECTORS for scene in SCENES}
    return rows | ({"inserted": every} if name in ATTACKS and ATTACKS[name].insertion == "digital" else {})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the files of a study of two seeds, and of a third of which one attack is not finished."""
    from examples.attacks.experiment import ATTACKS, SIZE, WEATHERS, Found
    from examples.attacks.results import write
    from examples.attacks.study import tasks

    path = tmp_path_factory.mktemp("results")
    for task in tasks(3)[:-1]:
        texture = torch.full((1, 3, *SIZE), GREY)
        texture[0, 2, 5, 7] = 1.0
        steps = STEPS if task.name in ATTACKS else (0,)
        rows = [] if task.name == "gradients" else [Found(texture, k, scores(task.name, k)) for k in steps]
        cosines = dict.fromkeys(WEATHERS, 0.5 + task.seed / 10) if task.name == "gradients" else {}
        write(path, task, rows, [2.0, 1.0], cosines)
    return path


@pytest.fixture
def results(folder: Path) -> Any:
    from examples.attacks.results import Results

    return Results(folder)


def test_only_seeds_with_all_attacks_count(results: Any) -> None:
    assert results.seeds == [0, 1] and results.steps == [1, 2]


def test_rates_follow_from_the_scores(results: Any) -> None:
    """3 scenes, 2 detectors * 2 seeds and 6 moments count as 72 trials: Wilson's interval of 72 / 72 is 95 to 100."""
    from examples.attacks.report import tables

    found = tables(results)
    success = {row["texture"]: row for row in found["success"]}
    assert success["many weathers"]["six held-out weathers"] == "100 (95 to 100) %"
    assert (
        success["logo"]["morning"].startswith("100 (") and success["logo"]["six held-out weathers"] == "0 (0 to 10) %"
    )
    assert success["digital"]["six held-out weathers"] == "0 (0 to 5) %"
    assert success["digital, inserted digitally"]["six held-out weathers"] == "100 (95 to 100) %"
    apart = {(row["attack"], row["minus"]): row for row in found["differences"]}
    assert apart["many weathers", "digital"]["six held-out weathers"] == "+100 (+93 to +100) *"
    assert apart["many weathers", "digital"]["morning"] == "+0 (-5 to +5)"
    steps = next(row for row in found["steps"] if row["attack"] == "many weathers")
    assert steps["SSD, 1 steps"] == "0 (0 to 10) %" and steps["SSD, 2 steps"] == "100 (90 to 100) %"
    assert found["gradients"][0]["SSD"] == "0.55 (0.50 to 0.60)"
    assert found["scores by weather"][0]["digital"] == "100 %" and found["scores by weather"][1]["digital"] == "0 %"
    thresholds = next(row for row in found["thresholds"] if row["attack"] == "many weathers")
    assert (thresholds["SSD, 0.7"], thresholds["CenterNet, 0.3"]) == ("100 %", "100 %")


def test_textures_are_kept(results: Any) -> None:
    texture = results.texture("digital", "wall", "SSD", 1)
    torch.testing.assert_close(float(texture[0, 0, 0, 0]), GREY, atol=0.5 / 255, rtol=0)
    assert float(texture[0, 2, 5, 7]) == 1 and results.texture("logo", "wall", "SSD", 0).shape == texture.shape


def test_a_folder_without_a_whole_seed_is_refused(folder: Path, tmp_path: Path) -> None:
    from examples.attacks.results import Results

    with pytest.raises(FileNotFoundError, match="has no results"):
        Results(tmp_path)
    for path in folder.glob("wall_ssd_*.json"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "wall_ssd_digital_0.json").unlink()
    (tmp_path / "wall_ssd_digital_1.json").unlink()
    (tmp_path / "wall_ssd_gradients_2.json").unlink()
    with pytest.raises(ValueError, match="no seed"):
        Results(tmp_path)


def test_the_sheet_marks_detected_people(results: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import numpy as np
    from PIL import Image

    from examples.attacks import report

    def grey(scene: str, detector: str, texture: Any, numbers: list[int]) -> Any:
        boxes = torch.tensor([[60.0, 60.0, 240.0, 240.0]]).expand(len(numbers), -1)
        return torch.full((len(numbers), 3, 300, 300), 0.5), boxes

    monkeypatch.setattr(report, "seen", grey)
    report.draw(results, tmp_path / "sheet.jpg")
    with Image.open(tmp_path / "sheet.jpg") as sheet:
        pixels = np.asarray(sheet.convert("RGB"), np.int64)
    marked = (pixels[..., 0] > 180) & (pixels[..., 2] < 110)
    cells = [marked[row * 190 : row * 190 + 160, 340:].any() for row in range(4)]
    assert cells == [False, False, False, True]


def test_the_page_has_every_table_and_the_sheet(results: Any) -> None:
    from benchmarks.pages import table_of
    from examples.attacks.report import tables
    from examples.attacks.study import COMMAND
    from tests.sources import ROOT

    page = ROOT / "docs" / "attack-study.md"
    for name, table in tables(results).items():
        kept = table_of(page, f"{COMMAND}: {name}").splitlines()
        if name != "steps":  # its columns name the numbers of steps
            assert kept[0] == "| " + " | ".join(table[0]) + " |", name
        assert len(kept) == len(table) + 2, name
    assert f"({page.stem}.jpg)" in page.read_text() and page.with_suffix(".jpg").stat().st_size < 100_000
