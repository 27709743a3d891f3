"""The studies of attack goals: their measures on cases made by hand, and one step of each. `make test-torch`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")


class BoxDetector:
    """A detector with one box in each cell of a grid, and a logit that is high where the picture is bright."""

    def raw(self, pictures: Any) -> tuple[Any, Any]:
        side = pictures.shape[-1] // 10
        bright = torch.nn.functional.avg_pool2d(pictures, side).mean(dim=1).flatten(1)
        y, x = torch.meshgrid(torch.arange(10.0), torch.arange(10.0), indexing="ij")
        boxes = torch.stack([x - 0.5, y - 2, x + 1.5, y + 3], dim=-1).flatten(0, 1) * side
        return boxes.expand(len(pictures), -1, -1), bright[..., None].expand(-1, -1, 80)


@pytest.fixture
def simple_detector(monkeypatch: pytest.MonkeyPatch) -> None:
    from examples.attacks.goals import detection

    monkeypatch.setattr(detection, "opened", lambda name: BoxDetector())


def test_scores_are_those_of_coco() -> None:
    """Two of three objects found, the last at an overlap of 0.6 and below a false detection."""
    from examples.attacks.goals.coco_scores import Evaluation

    truths = [[0, 0, 10, 10], [0, 0, 10, 10], [0, 0, 10, 10]]
    detections = [[[0, 0, 10, 10, 0.9]], [[0, 0, 10, 6, 0.3]], [[50, 50, 60, 60, 0.5]]]
    scores = Evaluation(truths, detections).scores()
    # At 0.5, 0.55 and 0.6: precision 1 up to a recall of 1/3 and 2/3 up to one of 2/3, at 101 points of recall.
    both = (34 * 1 + 33 * 2 / 3) / 101
    assert scores.precision_50 == pytest.approx(both, abs=1e-6)
    assert scores.precision == pytest.approx((3 * both + 7 * 34 / 101) / 10, abs=1e-6)
    assert scores.recall == pytest.approx((3 * 2 / 3 + 7 * 1 / 3) / 10)


def test_scores_of_some_pictures_are_those_of_a_study_with_these_alone() -> None:
    from examples.attacks.goals.coco_scores import Evaluation

    random = np.random.default_rng(0)
    truths = [[0, 0, 10, 10]] * 6
    detections = [[[0, 0, 10, *random.uniform((4, 0), (12, 1))] for _ in range(3)] for _ in truths]
    chosen = [4, 1, 1, 3]
    alone = Evaluation([truths[k] for k in chosen], [detections[k] for k in chosen]).scores()
    assert Evaluation(truths, detections).scores(chosen) == alone


def test_a_certain_rate_has_an_interval() -> None:
    from examples.attacks.goals.bootstrap import mean, rate

    assert rate(np.zeros((3, 9, 1), np.bool_)) == "0 % [0, 12]"  # Wilson's for 27 trials
    spread = mean(np.random.default_rng(1).normal(0, 1, (40, 50)))
    assert (
        spread.low < spread.value < spread.high and 0.08 < spread.high - spread.low < 0.2
    )  # 3.9 / sqrt(2000) and more


def test_reframed_boxes_follow_what_they_show() -> None:
    from examples.attacks.goals.detection import reframed

    pictures = torch.zeros((8, 3, 200, 100))
    pictures[..., 60:120, 30:60] = 1
    boxes = torch.tensor([[30.0, 60.0, 60.0, 120.0]]).expand(8, -1)
    moved, found = reframed(pictures, boxes, torch.Generator().manual_seed(3))
    for picture, box in zip(moved, found, strict=True):
        rows, columns = (np.nonzero((picture[0] > 0.5).any(dim=axis).numpy())[0] for axis in (1, 0))
        shown = [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]
        np.testing.assert_allclose(box.numpy(), shown, atol=1.01)
    assert not torch.allclose(found[0], found[1])


def test_the_tracker_follows_a_square() -> None:
    from examples.attacks.goals.correlation_tracker import track

    random = torch.Generator().manual_seed(0)
    pictures = 0.3 * torch.rand((1, 3, 120, 160), generator=random).repeat(10, 1, 1, 1)
    target = torch.rand((3, 20, 20), generator=random)
    for number, picture in enumerate(pictures):
        picture[:, 40 + 2 * number : 60 + 2 * number, 20 + 5 * number : 40 + 5 * number] = target
    places = track(pictures, torch.tensor([30.0, 50.0]), 44.0)
    wanted = torch.tensor([[30.0 + 5 * number, 50 + 2 * number] for number in range(10)])
    torch.testing.assert_close(places, wanted, atol=2, rtol=0)


def test_finished_parts_are_read_and_not_run_again(tmp_path: Path) -> None:
    from examples.attacks.goals import parts

    textures = torch.rand((3, 3, 4, 5))
    study = parts.Study("one", ("plain",), ("random",), 7, 1, _never, lambda parts: {}, _never)
    for kind, seed in study.jobs(2):
        file = tmp_path / "one" / f"{kind}-{seed}.json"
        parts.write(parts.Part({"steps": 7, "seed": seed}, textures), file)
    parts.run([study], tmp_path, seeds=2, steps=None, workers=1)
    found = parts.read(study, tmp_path, seeds=2)
    assert [part.values["seed"] for part in found["random"]] == [0, 1] and len(found["plain"]) == 1
    torch.testing.assert_close(found["plain"][0].textures, textures, atol=0.5 / 255, rtol=0)


def test_workers_are_shared_by_cost() -> None:
    from examples.attacks.goals.parts import _shares

    assert _shares([42, 34, 15], 16) == [7, 6, 3] and _shares([9, 1], 2) == [1, 1]


def _never(*_: object) -> Any:
    raise AssertionError("a finished part was run")


@pytest.mark.usefixtures("simple_detector")
def test_one_step_hides_a_person_a_little(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from examples.attacks.goals import hiding

    monkeypatch.setattr(hiding, "_TRAINING", [("", 2)])
    monkeypatch.setattr(hiding, "_TEST", [("#10", 4)])
    monkeypatch.setattr(hiding, "_SHOWN", (("sun", 4), ("night", 4)))
    found = {kind: [hiding.run(kind, 0, 1)] for kind in ("shirt, plain", "shirt, rendered", "chest, digital")}
    _report(hiding, found, tmp_path)
    texture = found["shirt, rendered"][0].textures
    assert texture.shape == (1, 3, 64, 64) and texture.max() <= 0.66  # grey with noise, and a step of 0.05


@pytest.mark.usefixtures("simple_detector")
def test_one_step_paints_a_car(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from examples.attacks.goals import car

    monkeypatch.setattr(car, "DISTANCES", ("9m",))
    monkeypatch.setattr(car, "AZIMUTHS", ("22",))
    monkeypatch.setattr(car, "_SEEN_AZIMUTHS", ("45",))
    monkeypatch.setattr(car, "_SHOWN", (("sun", "9m", "22"),))
    _report(car, {kind: [car.run(kind, 0, 1)] for kind in ("own paint", "logo", "one weather", "rendered")}, tmp_path)


def test_one_step_changes_the_texture_of_each_frame(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from examples.attacks.goals import tracking

    monkeypatch.setattr(tracking, "FRAMES", 4)
    monkeypatch.setattr(tracking, "_SHOWN_FRAMES", (1, 3))
    monkeypatch.setattr(tracking, "_TEST", ("base#12",))
    monkeypatch.setattr(tracking, "_SHOWN", "base#12")
    kinds = ("grey", "each frame, 1 video", "one texture, 1 video")
    found = {kind: [tracking.run(kind, 0, 1)] for kind in kinds}
    _report(tracking, found, tmp_path)
    assert [len(found[kind][0].textures) for kind in kinds] == [1, 4, 1]
    assert min(found["grey"][0].values["videos"]["base#12"]) > 0.5


def _report(study: Any, found: Any, folder: Path) -> None:
    """Check that each kind has a row in a table, and that the sheet can be drawn."""
    first = next(iter(study.tables(found).values()))
    assert [next(iter(row.values())) for row in first] == list(found)
    study.draw(found, folder / "sheet.jpg")
    assert (folder / "sheet.jpg").stat().st_size > 1000


def test_the_page_has_every_table_and_picture() -> None:
    from benchmarks.pages import table_of
    from examples.attacks.goals.__main__ import COMMAND, STUDIES
    from tests.sources import ROOT

    page = ROOT / "docs" / "attack-goals.md"
    names = page.read_text(encoding="utf-8").split(f"table of `{COMMAND}: ")[1:]
    for name in (text.partition("`")[0] for text in names):
        rows = table_of(page, f"{COMMAND}: {name}").splitlines()
        assert len({row.count("|") for row in rows}) == 1 and len(rows) > 3, name
    assert len(names) == 10
    for study in STUDIES:
        picture = page.with_name(f"attack-goals-{study}.jpg")
        assert f"({picture.name})" in page.read_text(encoding="utf-8") and picture.stat().st_size < 100_000
