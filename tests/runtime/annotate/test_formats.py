"""The annotation files are read by those whose formats they are, and their own check finds what those miss."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pycocotools.mask
import pytest
from PIL import Image
from pycocotools.coco import COCO
from recipe_runtime.annotate.validate import problems
from recipe_runtime.build.pipeline import build

from tests.runtime.fakes import ENGINES, dataset_plan

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools' decode


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("formats")
    return build(dataset_plan(), folder / "tiny", workers=0, cache=folder / "cache", engines=ENGINES).path


@pytest.mark.slow
def test_kwcoco_accepts_it_without_a_warning(dataset: Path) -> None:
    command = [sys.executable, "-m", "kwcoco", "validate", "annotations/kwcoco.json", "--corrupted", "True"]
    done = subprocess.run(command, cwd=dataset, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "warn" not in (done.stdout + done.stderr).lower().replace("'img_attrs': 'warn'", "")


def test_a_track_is_one_actor_in_every_video_and_file(dataset: Path) -> None:
    data = json.loads((dataset / "annotations/kwcoco.json").read_text())
    assert [(row["id"], row["name"]) for row in data["tracks"]] == [(12001, "hero1"), (12002, "hero2"), (15001, "van")]
    flat = json.loads((dataset / "annotations/coco/rgb.json").read_text())
    for row in (*data["annotations"], *flat["annotations"]):
        assert row["track_id"] == row["instance"]
    videos = {row["id"]: row["video_id"] for row in data["images"]}
    assert len({videos[row["image_id"]] for row in data["annotations"] if row["track_id"] == 12001}) == 8


def test_pycocotools_reads_masks_that_are_the_instance_pixels(
    dataset: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    coco = COCO(dataset / "annotations/coco/rgb.json")
    assert len(coco.imgs) == 96
    for image in coco.loadImgs(coco.getImgIds()):
        assert {"license", "date_captured", "coco_url", "flickr_url"} <= image.keys()
        path = dataset / image["file_name"].replace("/rgb/", "/instance/")
        instance, painted = np.asarray(Image.open(path)), np.zeros((48, 64), np.int64)
        for row in coco.loadAnns(coco.getAnnIds(image["id"])):
            assert row["iscrowd"] == 0
            assert coco.cats[row["category_id"]]["tag"] == row["instance"] // 1000
            painted += coco.annToMask(row).astype(np.int64) * row["instance"]
        assert np.array_equal(painted, instance)


def test_mots_text_and_pictures_say_the_same(dataset: Path) -> None:
    names = (dataset / "mots/seqmaps/MOTS-train.txt").read_text().split()
    assert names[0] == "name" and len(names) == 9
    assert names[1] == "weather=w0_jitter=still+street"  # TrackEval takes a comma for the end of a name
    for name in names[1:]:
        painted = np.zeros((12, 48, 64), np.int64)
        for line in (dataset / f"mots/MOTS-train/{name}/gt/gt.txt").read_text().splitlines():
            frame, identity, kind, height, width, counts = line.split(" ")
            assert int(identity) // 1000 == int(kind) and kind in ("2", "10")
            code = {"size": [int(height), int(width)], "counts": counts.encode()}
            painted[int(frame) - 1] += pycocotools.mask.decode(code).astype(np.int64) * int(identity)
        pictures = [np.asarray(Image.open(p)) for p in sorted((dataset / f"mots/instances/{name}").iterdir())]
        assert np.array_equal(painted, np.stack(pictures))
        assert "seqLength=12\n" in (dataset / f"mots/MOTS-train/{name}/seqinfo.ini").read_text()


def test_the_picture_folder_of_a_sequence_is_there(dataset: Path) -> None:
    for info in dataset.glob("mots/MOTS-train/*/seqinfo.ini"):
        (place,) = (line[6:] for line in info.read_text().splitlines() if line.startswith("imDir="))
        assert len(list((info.parent / place).glob("*.png"))) == 12


def test_tracks_are_the_trace(dataset: Path) -> None:
    lines = (dataset / "weather=w0,jitter=still/tracks.csv").read_text().splitlines()
    assert len(lines) == 1 + 12 * 3
    row = dict(zip(lines[0].split(","), lines[5].split(","), strict=True))
    assert (row["frame"], row["time"], row["actor"], row["instance"]) == ("1", "0.100000", "hero2", "12002")
    assert (row["x"], row["y"], row["z"], row["qw"], row["vy"]) == (
        "5.000000",
        "-0.875000",
        "1.000000",
        "1.000000",
        "1.000000",
    )


def change(table: str, row: int, **values: Any) -> Callable[[dict[str, Any]], None]:
    return lambda data: data[table][row].update(values)


FAULTS: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (change("images", 1, frame_index=0), r"\(video, frame_index\) \(1, 0\) stands 2 times"),
    (change("images", 1, video_id=99), "images 2: video_id 99 has no row in videos"),
    (change("annotations", 0, track_id=99), "annotations 1: track_id 99 has no row in tracks"),
    (change("annotations", 0, category_id=99), "annotations 1: category_id 99 has no row in categories"),
    (change("annotations", 0, image_id=999), "annotations 1: image_id 999 has no row in images"),
    (change("annotations", 0, id=2), "annotations id 2 stands 2 times"),
    (change("annotations", 0, distance=float("nan")), r"\$.annotations\[0\].distance is nan"),
    (change("annotations", 0, area=3), "annotation 1: area 3 is not the mask's"),
    (change("annotations", 0, bbox=[0, 0, 1, 1]), r"annotation 1: bbox \[0, 0, 1, 1\] is not the mask's"),
    (change("annotations", 0, amodal_bbox=[0, 0, 1, 1]), "annotation 1: bbox .* reaches out of amodal_bbox"),
    (change("tracks", 1, name="hero1"), "tracks name .* stands 2 times"),
    (lambda data: data["images"][0]["assets"][0].update(file_name="../no.png"), "../no.png is not there"),
    (
        lambda data: data["annotations"][1].update(segmentation=data["annotations"][0]["segmentation"]),
        "image 1: masks overlap",
    ),
    (
        lambda data: data["annotations"][0]["segmentation"].update(size=[64, 48]),
        "image 1: a mask's size is not the picture's",
    ),
]


def test_the_check_passes_what_is_whole(dataset: Path) -> None:
    assert problems(dataset / "annotations/kwcoco.json") == []
    assert problems(dataset / "annotations/coco/rgb.json", dataset) == []


@pytest.mark.parametrize(("fault", "message"), FAULTS)
def test_the_check_finds(dataset: Path, fault: Callable[[dict[str, Any]], None], message: str) -> None:
    data = json.loads((dataset / "annotations/kwcoco.json").read_text())
    fault(data)
    changed = dataset / "annotations" / "changed.json"
    changed.write_text(json.dumps(data))
    try:
        found = problems(changed)
    finally:
        changed.unlink()
    assert any(re.search(message, line) for line in found), found
