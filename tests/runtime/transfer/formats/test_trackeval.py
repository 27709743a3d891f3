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

from tests.runtime.fakes import dataset_plan, quiet
from tests.runtime.transfer.conftest import made

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
    for name in ("mots", "kitti"):
        export(dataset, folder / name, name, quiet)
    return folder


def mots(folder: Path) -> tuple[str, dict[str, Any], list[str]]:
    data = folder / "mots_trackers" / "MOTS-train" / "perfect" / "data"
    data.mkdir(parents=True, exist_ok=True)
    for path in (folder / "mots" / "MOTS-train").iterdir():
        shutil.copy(path / "gt" / "gt.txt", data / f"{path.name}.txt")
    config = {"GT_FOLDER": str(folder / "mots"), "TRACKERS_FOLDER": str(folder / "mots_trackers")}
    return "MOTSChallenge", config, ["pedestrian"]


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


@pytest.mark.parametrize("layout", [mots, kitti, kitti_mots])
def test_a_perfect_tracker_has_perfect_scores(
    exports: Path, layout: Callable[[Path], tuple[str, dict[str, Any], list[str]]]
) -> None:
    trackeval = pytest.importorskip("trackeval")

    name, config, classes = layout(exports)
    quiet = {"PRINT_CONFIG": False, "PRINT_RESULTS": False, "OUTPUT_SUMMARY": False, "OUTPUT_DETAILED": False}
    evaluator = trackeval.Evaluator({**quiet, "PLOT_CURVES": False, "BREAK_ON_ERROR": True, "TIME_PROGRESS": False})
    dataset = getattr(trackeval.datasets, name)({**config, "CLASSES_TO_EVAL": classes, "PRINT_CONFIG": False})
    metrics = [trackeval.metrics.HOTA({"PRINT_CONFIG": False}), trackeval.metrics.CLEAR({"PRINT_CONFIG": False})]
    results, _ = evaluator.evaluate([dataset], metrics)
    scores = results[name]["perfect"]
    assert len(scores) == SEQUENCES + 1
    for label in classes:
        whole = scores["COMBINED_SEQ"][label]
        assert whole["HOTA"]["HOTA"].min() == 1.0
        assert (whole["CLEAR"]["MOTA"], whole["CLEAR"]["CLR_FP"], whole["CLEAR"]["CLR_FN"]) == (1.0, 0, 0)
        assert whole["CLEAR"]["CLR_TP"] > 20
        assert whole["CLEAR"]["sMOTA"] == pytest.approx(1.0)  # sMOTSA where the boxes are masks
