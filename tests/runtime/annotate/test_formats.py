"""Annotation files are read by the formats' own libraries, and `validate` detects what these accept."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import kwimage
import numpy as np
import pycocotools.mask
import pytest
from PIL import Image
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from recipe_compiler.ir.errors import InputError
from recipe_runtime.annotate import ids
from recipe_runtime.build.pipeline import BuildOptions, build

from tests.runtime.annotate.validate import problems
from tests.runtime.fakes import ENGINES, dataset_plan

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools' decode


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("formats")
    return build(dataset_plan(), folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES)).path


@pytest.mark.slow
def test_kwcoco_accepts_it_without_a_warning(dataset: Path) -> None:
    command = [sys.executable, "-m", "kwcoco", "validate", "annotations/kwcoco.json", "--corrupted", "True"]
    done = subprocess.run(command, cwd=dataset, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "warn" not in (done.stdout + done.stderr).lower().replace("'img_attrs': 'warn'", "")


def test_a_track_is_one_actor_in_every_video_and_file(dataset: Path) -> None:
    data = json.loads((dataset / "annotations/kwcoco.json").read_text())
    tracks = {row["id"]: row for row in data["tracks"]}
    assert len(tracks) == 4 * 3  # one per actor and variant
    flat = json.loads((dataset / "annotations/coco/rgb.json").read_text())
    videos = {row["id"]: row for row in data["videos"]}
    images = {row["id"]: videos[row["video_id"]] for row in data["images"]}
    seen: dict[int, set[str]] = {}
    for row in (*data["annotations"], *flat["annotations"]):
        track, video = tracks[row["track_id"]], images[row["image_id"]]
        assert (track["variant"], track["actor"], track["instance"]) == (
            video["variant"],
            row["actor"],
            row["instance"],
        )
        seen.setdefault(row["track_id"], set()).add(video["sensor"])
    assert list(seen.values()).count({"street", "side"}) >= 4  # both sensors share a track
    assert [row["id"] for row in data["annotations"]] == [row["id"] for row in flat["annotations"]]
    assert len({row["scene"] for row in videos.values()}) == 1


@pytest.mark.slow
def test_ids_do_not_change_when_a_dataset_is_extended(dataset: Path, tmp_path: Path) -> None:
    """Regression: IDs were counters, so that an additional frame or variant changed those of later images."""
    longer = build(
        dataset_plan(13, 3), tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)
    ).path
    for file in ("annotations/kwcoco.json", "annotations/coco/rgb.json"):
        data, more = (json.loads((root / file).read_text()) for root in (dataset, longer))
        for table in ("videos", "tracks", "images", "annotations"):
            before, after = ({row["id"]: row for row in rows.get(table, ())} for rows in (data, more))
            assert before.keys() <= after.keys()
            assert all(0 < number < 1 << 53 for number in after)
            assert all(after[n].get("file_name") == row.get("file_name") for n, row in before.items())
            assert all(after[n].get("actor") == row.get("actor") for n, row in before.items())


@pytest.mark.slow
def test_equal_ids_are_refused(monkeypatch: pytest.MonkeyPatch, dataset: Path, tmp_path: Path) -> None:
    monkeypatch.setattr(ids, "ID_LIMIT", 40)
    with pytest.raises(InputError, match=r"have the id .* which is a digest of their names"):
        build(dataset_plan(), tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))


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


def test_mots_text_and_pictures_agree(dataset: Path) -> None:
    names = (dataset / "mots/seqmaps/MOTS-train.txt").read_text().split()
    assert names[0] == "name" and len(names) == 9
    assert names[1] == "weather=w0_jitter=still+street"  # a comma ends a name in TrackEval
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


def test_a_sequence_has_its_image_folder(dataset: Path) -> None:
    for info in dataset.glob("mots/MOTS-train/*/seqinfo.ini"):
        (place,) = (line[6:] for line in info.read_text().splitlines() if line.startswith("imDir="))
        assert len(list((info.parent / place).glob("*.png"))) == 12


def test_tracks_equal_the_trace(dataset: Path) -> None:
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
    (change("images", 1, frame_index=0), r"\(video, frame_index\) \(\d+, 0\) occurs 2 times"),
    (change("annotations", 0, track_id=99), r"annotations \d+: track_id 99 has no row in tracks"),
    (change("annotations", 0, distance=float("nan")), r"\$.annotations\[0\].distance is nan"),
    (change("annotations", 0, area=3), r"annotation \d+: area 3 is not the mask's"),
    (lambda data: data["images"][0]["assets"][0].update(file_name="../no.png"), "../no.png is not there"),
]


def test_the_check_accepts_a_valid_file(dataset: Path) -> None:
    assert problems(dataset / "annotations/kwcoco.json") == []
    assert problems(dataset / "annotations/coco/rgb.json", dataset) == []


@pytest.mark.parametrize(("fault", "message"), FAULTS)
def test_the_check_detects(dataset: Path, fault: Callable[[dict[str, Any]], None], message: str) -> None:
    data = json.loads((dataset / "annotations/kwcoco.json").read_text())
    fault(data)
    changed = dataset / "annotations" / "changed.json"
    changed.write_text(json.dumps(data))
    try:
        found = problems(changed)
    finally:
        changed.unlink()
    assert any(re.search(message, line) for line in found), found


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # a warning of kwcoco about gdal
@pytest.mark.parametrize("form", ["carla", "npy"])
def test_kwcoco_loads_every_depth_format(form: str, tmp_path: Path) -> None:
    plan = dataset_plan(2, 1, forms={"depth": form}, annotations=("kwcoco",))
    made = build(plan, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)).path
    read = """
import json, kwcoco, numpy
dataset, found = kwcoco.CocoDataset("annotations/kwcoco.json"), {}
for image in dataset.images().coco_images:
    if "street" in image.img["name"]:
        pixels = image.imdelay(CHANNELS).finalize().astype(float)
        metres = pixels[..., 0] if pixels.shape[2] == 1 else pixels @ [1, 256, 65536] * 1000 / (256**3 - 1)
        found[image.img["name"]] = [float(metres[47, 0]), float(metres.min())]
print(json.dumps(found))
"""
    channels = "depth" if form == "npy" else "depth_low|depth_middle|depth_high"
    command = [sys.executable, "-W", "ignore", "-c", read.replace("CHANNELS", repr(channels))]
    done = subprocess.run(command, cwd=made, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert len(found) == 4  # two frames of two rigs
    assert all(
        sky == pytest.approx(1000.0, abs=1e-4) and near == pytest.approx(4.0, abs=1e-4) for sky, near in found.values()
    )


@pytest.mark.slow
def test_a_perfect_detector_has_an_average_precision_of_1(dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """COCOeval reads boxes, masks and IDs above 2^32, which it stores as float64."""
    truth = COCO(dataset / "annotations/coco/rgb.json")
    keys = ("image_id", "category_id", "bbox", "segmentation")
    found = truth.loadRes([{**{k: row[k] for k in keys}, "score": 1.0} for row in truth.anns.values()])
    for kind in ("bbox", "segm"):
        evaluation = COCOeval(truth, found, kind)
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
        assert evaluation.stats[0] == pytest.approx(1.0)  # AP at IoU 0.50:0.95
        assert evaluation.stats[8] == pytest.approx(1.0)  # AR of 100 detections


@pytest.mark.slow
def test_boxes_are_x_y_width_height_with_outer_edges(dataset: Path) -> None:
    """x + width and y + height are the outer edges of the last column and row, as torchvision's `xyxy` has them."""
    data = json.loads((dataset / "annotations/coco/rgb.json").read_text())
    boxes = kwimage.Boxes(np.array([row["bbox"] for row in data["annotations"]]), "xywh")
    for row, (x0, y0, x1, y1) in zip(data["annotations"], boxes.to_ltrb().data, strict=True):
        mask = pycocotools.mask.decode({**row["segmentation"], "counts": row["segmentation"]["counts"].encode()})
        ys, xs = np.nonzero(mask)
        assert [x0, y0, x1, y1] == [xs.min(), ys.min(), xs.max() + 1, ys.max() + 1]
