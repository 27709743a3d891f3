"""The YOLO export, read as Ultralytics describes its format, has the boxes of the dataset's COCO annotations."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from PIL import Image
from pycocotools.coco import COCO
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import RigPlan
from recipe_runtime.annotate.outlines import joined, rings
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.export import export

from tests.runtime.fakes import dataset_plan, quiet
from tests.runtime.transfer.conftest import made

Boxes = NDArray[np.float64]  # rows: class, then x, y, width, height in pixels


def read_split(description: Path, split: str) -> tuple[dict[int, str], dict[str, Boxes]]:
    """Return the names of the classes, and the boxes of each picture of a split by the name of its file."""
    data: dict[str, Any] = yaml.safe_load(description.read_text())
    root = Path(data.get("path") or description.parent)
    pictures = sorted((root / data[split]).rglob("*.*"))
    found = {}
    for picture in pictures:
        before, _, after = str(picture).rpartition("/images/")
        labels = Path(f"{before}/labels/{after}").with_suffix(".txt")
        with Image.open(picture) as image:
            width, height = image.size
        rows = np.array([line.split() for line in labels.read_text().splitlines()], float).reshape(-1, 5)
        assert (rows >= 0).all() and (rows[:, 1:] <= 1).all() and (rows[:, 0] < len(data["names"])).all()
        sizes = rows[:, 3:] * [width, height]
        found[picture.name] = np.hstack([rows[:, :1], rows[:, 1:3] * [width, height] - sizes / 2, sizes])
    assert [*data["names"]] == [*range(len(data["names"]))]
    return data["names"], found


def test_boxes_are_those_of_coco(tiny: Dataset, tmp_path: Path) -> None:
    export(tiny, tmp_path / "out", "yolo", quiet)
    names, found = read_split(tmp_path / "out" / "data.yaml", "train")
    coco = COCO(tiny.root / "annotations/coco/rgb.json")
    assert [names[number - 1] for number in coco.getCatIds()] == [
        row["name"] for row in coco.loadCats(coco.getCatIds())
    ]
    order = [f"{v.variant}/{s.name}" for v in tiny.plan.variants for s in v.rig.sensors]
    assert len(found) == len(coco.imgs) == 96
    for image in coco.imgs.values():
        sequence, _, frame = image["file_name"].replace("/rgb/", "/").rpartition("/")
        (name,) = (name for name in found if name.startswith(f"{order.index(sequence):04d}_") and name.endswith(frame))
        assert (tmp_path / "out/images/train" / name).read_bytes() == (tiny.root / image["file_name"]).read_bytes()
        marked = coco.loadAnns(coco.getAnnIds(image["id"]))
        expected = np.array([[a["category_id"] - 1, *a["bbox"]] for a in marked], float).reshape(-1, 5)
        np.testing.assert_allclose(found[name], expected, atol=64e-6)


def inside(polygon: NDArray[np.float64], width: int, height: int) -> NDArray[np.bool_]:
    """Return the pixels whose centres are in a polygon by the rule of odd crossings, [H, W]."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    found = np.zeros((height, width), np.bool_)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 != y1:
            found ^= ((y0 <= y) != (y1 <= y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return found


@given(arrays(np.uint8, (5, 7), elements=st.integers(0, 1)))
@example(np.array([[1, 1, 1, 0, 0], [1, 0, 1, 0, 1], [1, 1, 0, 1, 0]], np.uint8))  # a hole, pieces that share corners
def test_a_polygon_is_the_mask(mask: NDArray[np.uint8]) -> None:
    polygon = np.array(joined(rings(mask)), float).reshape(-1, 2)
    if not mask.any():
        assert not len(polygon)
        return
    assert np.array_equal(inside(polygon, mask.shape[1], mask.shape[0]), mask > 0)
    rows, columns = np.nonzero(mask)
    assert [*polygon.min(axis=0), *polygon.max(axis=0)] == [
        columns.min(),
        rows.min(),
        columns.max() + 1,
        rows.max() + 1,
    ]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools' decode
def test_segments_are_the_masks_of_coco(tiny: Dataset, tmp_path: Path) -> None:
    export(tiny, tmp_path / "out", "yolo", quiet, options={"task": "segment", "categories": "coco"})
    names = yaml.safe_load((tmp_path / "out" / "data.yaml").read_text())["names"]
    assert names == dict(enumerate(["person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck"]))
    coco = COCO(tiny.root / "annotations/coco/rgb.json")
    lines = (tmp_path / "out/labels/train/0000_weather-w0_jitter-still-street_000003.txt").read_text().splitlines()
    (image,) = (i for i in coco.imgs.values() if i["file_name"] == "weather=w0,jitter=still/street/rgb/000003.png")
    marked = coco.loadAnns(coco.getAnnIds(image["id"]))
    assert marked and len(lines) == len(marked)
    for line, annotation in zip(lines, marked, strict=True):
        category, *shares = map(float, line.split())
        assert len(shares) >= 6 and len(shares) % 2 == 0 and min(shares) >= 0 and max(shares) <= 1
        assert (
            names[category] == {"Pedestrian": "person", "Truck": "truck"}[coco.cats[annotation["category_id"]]["name"]]
        )
        polygon = np.array(shares).reshape(-1, 2) * [image["width"], image["height"]]
        assert np.array_equal(inside(polygon, image["width"], image["height"]), coco.annToMask(annotation) > 0)


def test_other_tasks_are_refused(tiny: Dataset, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no task 'classify'"):
        export(tiny, tmp_path / "out", "yolo", quiet, options={"task": "classify"})


def test_frames_without_objects_have_an_empty_file(tmp_path: Path) -> None:
    plan = dataset_plan(frames=2, weathers=1)
    scene = plan.variants[0].scene.model_copy(update={"actors": ()})
    variants = tuple(variant.model_copy(update={"scene": scene}) for variant in plan.variants)
    dataset = made(plan.model_copy(update={"variants": variants}), tmp_path / "empty")
    export(dataset, tmp_path / "out", "yolo", quiet)
    _, found = read_split(tmp_path / "out" / "data.yaml", "val")
    assert len(found) == 8 and not any(map(len, found.values()))


def test_names_are_plain_and_unique(tmp_path: Path) -> None:
    """Names that differ only in marks, which file names of this export do not have, stay apart by their numbers."""
    plan = dataset_plan(frames=1, weathers=1)
    names = "weather=a,b", "weather=a+b%"
    variants = tuple(v.model_copy(update={"variant": name}) for v, name in zip(plan.variants, names, strict=True))
    dataset = made(plan.model_copy(update={"variants": variants}), tmp_path / "marks")
    export(dataset, tmp_path / "out", "yolo", quiet)
    _, found = read_split(tmp_path / "out" / "data.yaml", "train")
    assert [name for name in found if re.fullmatch(r"\d{4}_weather-a.b.*-(street|side)_000000\.png", name)] == [*found]
    rows = (tmp_path / "out" / "sequences.csv").read_text().splitlines()
    assert rows[1] == '0000,"weather=a,b",street' and len(rows) == 1 + len(found)


def test_a_dataset_without_colour_is_refused(tmp_path: Path) -> None:
    plan = dataset_plan(frames=1, weathers=1)
    sensor = plan.variants[0].rig.sensors[0].model_copy(update={"capture": ("depth",)})
    variant = plan.variants[0].model_copy(update={"rig": RigPlan(sensors=(sensor,))})
    dataset = made(plan.model_copy(update={"variants": (variant,)}), tmp_path / "grey")
    with pytest.raises(InputError, match="has no RGB pictures"):
        export(dataset, tmp_path / "out", "yolo", quiet)
