"""TrackEval reads the layouts of MOTSChallenge and KITTI; a tracker that outputs the labels has perfect scores."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.library.blueprints import match
from recipe_runtime.transfer.export import export
from recipe_runtime.transfer.formats.kitti import label_lines

from tests.runtime.fakes import dataset_plan, quiet
from tests.runtime.transfer.conftest import made
from tests.runtime.transfer.formats.test_kitti import record_of

pytestmark = [pytest.mark.trackeval, pytest.mark.filterwarnings("ignore")]

SEQUENCES = 8


def plan() -> DatasetPlan:
    """Return the plan of the fakes with a car in place of the truck, a class that both benchmarks ignore."""
    tiny = dataset_plan()
    scene = tiny.variants[0].scene
    sedan = match("vehicle.sedan.a")[0]
    car = {"tag": 14, "blueprint": sedan.id, "shape": sedan.shape}
    actors = tuple(a.model_copy(update=car) if a.tag == 15 else a for a in scene.actors)
    scene = scene.model_copy(update={"actors": actors})
    variants = tuple(v.model_copy(update={"scene": scene}) for v in tiny.variants)
    return tiny.model_copy(update={"variants": variants})


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trackeval")
    dataset = made(plan(), folder / "tiny")
    for name in ("mots", "mot", "kitti"):
        export(dataset, folder / name, name, quiet)
    return folder


def mots(folder: Path) -> tuple[str, dict[str, Any], list[str]]:
    data = folder / "mots_trackers" / "MOTS-train" / "perfect" / "data"
    data.mkdir(parents=True, exist_ok=True)
    for path in (folder / "mots" / "MOTS-train").iterdir():
        shutil.copy(path / "gt" / "gt.txt", data / f"{path.name}.txt")
    config = {"GT_FOLDER": str(folder / "mots"), "TRACKERS_FOLDER": str(folder / "mots_trackers")}
    return "MOTSChallenge", config, ["pedestrian"]


def mot(folder: Path) -> tuple[str, dict[str, Any], list[str]]:
    """Return what the evaluation of boxes needs; the tracker outputs the boxes of people."""
    data = folder / "mot_trackers" / "MOT17-train" / "perfect" / "data"
    data.mkdir(parents=True, exist_ok=True)
    for path in (folder / "mot" / "MOT17-train").iterdir():
        rows = [line.split(",") for line in (path / "gt" / "gt.txt").read_text().splitlines()]
        people = [row for row in rows if row[7] == "1"]
        (data / f"{path.name}.txt").write_text("".join(",".join([*row[:6], "1,-1,-1,-1"]) + "\n" for row in people))
    config = {"GT_FOLDER": str(folder / "mot"), "TRACKERS_FOLDER": str(folder / "mot_trackers")}
    return "MotChallenge2DBox", config, ["pedestrian"]


def kitti(folder: Path) -> tuple[str, dict[str, Any], list[str]]:
    data = folder / "kitti_trackers" / "perfect" / "data"
    shutil.copytree(folder / "kitti/training/label_02", data, dirs_exist_ok=True)
    config = {"GT_FOLDER": str(folder / "kitti/training"), "TRACKERS_FOLDER": str(folder / "kitti_trackers")}
    return "Kitti2DBox", {**config, "SPLIT_TO_EVAL": "training"}, ["car", "pedestrian"]


def kitti_mots(folder: Path) -> tuple[str, dict[str, Any], list[str]]:
    data = folder / "kitti_mots_trackers" / "perfect" / "data"
    shutil.copytree(folder / "kitti/mots/label_02", data, dirs_exist_ok=True)
    config = {"GT_FOLDER": str(folder / "kitti/mots"), "TRACKERS_FOLDER": str(folder / "kitti_mots_trackers")}
    return "KittiMOTS", {**config, "SPLIT_TO_EVAL": "training"}, ["car", "pedestrian"]


@pytest.mark.parametrize("layout", [mots, mot, kitti, kitti_mots])
def test_a_perfect_tracker_has_perfect_scores(
    exports: Path, layout: Callable[[Path], tuple[str, dict[str, Any], list[str]]]
) -> None:
    trackeval = pytest.importorskip("trackeval")

    name, config, classes = layout(exports)
    scores = scores_of(trackeval, name, config, classes)
    assert len(scores) == SEQUENCES + 1
    for label in classes:
        whole = scores["COMBINED_SEQ"][label]
        assert whole["HOTA"]["HOTA"].min() == 1.0
        assert (whole["CLEAR"]["MOTA"], whole["CLEAR"]["CLR_FP"], whole["CLEAR"]["CLR_FN"]) == (1.0, 0, 0)
        assert whole["CLEAR"]["CLR_TP"] > 20
        assert whole["CLEAR"]["sMOTA"] == pytest.approx(1.0)  # sMOTSA where the boxes are masks


def test_boxes_of_one_pixel_do_not_count(tmp_path: Path) -> None:
    """Regression: 4 of these 20 cars were missed by a tracker that outputs the labels, a MOTA of 0.8."""
    trackeval = pytest.importorskip("trackeval")
    sizes = [(20, 30), (2, 40), (40, 2), (9, 9), (1, 40)]
    cars = [record_of([50 * k, 4, *size]) | {"instance": 14001 + k} for k, size in enumerate(sizes)]
    frames: Any = [{"frame": frame, "objects": cars} for frame in range(4)]
    folders = [tmp_path / "gt/label_02", tmp_path / "trackers/perfect/data"]
    for folder in folders:
        folder.mkdir(parents=True)
        (folder / "0000.txt").write_text("".join(label_lines(frames)))
    (tmp_path / "gt/evaluate_tracking.seqmap.training").write_text("0000 empty 000000 000004\n")
    config = {"GT_FOLDER": str(tmp_path / "gt"), "TRACKERS_FOLDER": str(tmp_path / "trackers")}
    scores = scores_of(trackeval, "Kitti2DBox", {**config, "SPLIT_TO_EVAL": "training"}, ["car"])
    found = scores["COMBINED_SEQ"]["car"]["CLEAR"]
    assert (found["MOTA"], found["CLR_TP"], found["CLR_FN"], found["CLR_FP"]) == (1.0, 16, 0, 0)


def scores_of(trackeval: Any, name: str, config: dict[str, Any], classes: list[str]) -> Any:
    """Return TrackEval's scores of the tracker `perfect`."""
    quiet = {"PRINT_CONFIG": False, "PRINT_RESULTS": False, "OUTPUT_SUMMARY": False, "OUTPUT_DETAILED": False}
    evaluator = trackeval.Evaluator({**quiet, "PLOT_CURVES": False, "BREAK_ON_ERROR": True, "TIME_PROGRESS": False})
    dataset = getattr(trackeval.datasets, name)({**config, "CLASSES_TO_EVAL": classes, "PRINT_CONFIG": False})
    metrics = [trackeval.metrics.HOTA({"PRINT_CONFIG": False}), trackeval.metrics.CLEAR({"PRINT_CONFIG": False})]
    results, _ = evaluator.evaluate([dataset], metrics)
    return results[name]["perfect"]
