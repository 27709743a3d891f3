"""The export of boxes for MOTChallenge; `test_trackeval` evaluates it."""

from __future__ import annotations

import configparser
import json
from pathlib import Path

import pytest
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.export import export

from tests.runtime.fakes import quiet


@pytest.mark.slow
def test_boxes_are_those_of_the_labels(tiny: Dataset, tmp_path: Path) -> None:
    export(tiny, tmp_path / "out", "mot", quiet)
    names = (tmp_path / "out/seqmaps/MOT17-train.txt").read_text().splitlines()
    assert names[0] == "name" and len(names) == 9
    for variant in tiny.plan.variants:
        for sensor in variant.rig.sensors:
            folder = tmp_path / "out/MOT17-train" / f"{variant.variant}+{sensor.name}".replace(",", "_")
            assert folder.name in names
            info = configparser.ConfigParser()
            info.read(folder / "seqinfo.ini")
            assert info["Sequence"]["seqLength"] == "12" and len([*(folder / "img1").iterdir()]) == 12
            rows = [list(map(float, row.split(","))) for row in (folder / "gt/gt.txt").read_text().splitlines()]
            expected = [
                [
                    label["frame"] + 1,
                    item["instance"],
                    item["amodal_bbox"][0] + 1,
                    item["amodal_bbox"][1] + 1,
                    *item["amodal_bbox"][2:],
                    *((1, 1) if item["instance"] // 1000 == 12 else (0, 6)),  # pedestrians, and the truck
                    item["visible_fraction"],
                ]
                for label in map(
                    json.loads, (tiny.root / variant.variant / sensor.name / "labels.jsonl").read_text().splitlines()
                )
                for item in label["objects"]
            ]
            assert rows == expected and rows
