"""Datasets in FiftyOne, whose own classes and importer run here on a database in memory (mongomock)."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import RigPlan
from recipe_runtime.dataset.reader import read

from tests.runtime.fakes import dataset_plan
from tests.runtime.transfer.conftest import made

pytestmark = [pytest.mark.readers, pytest.mark.filterwarnings("ignore")]


@pytest.fixture(scope="module", autouse=True)
def fiftyone() -> Iterator[Any]:
    base: Any = pytest.importorskip("mongomock").MongoClient
    store = pytest.importorskip("mongomock.store").ServerStore()  # of all clients
    pymongo = pytest.importorskip("pymongo")

    class Client(base):  # type: ignore[misc]
        """A database in memory that answers as the server that FiftyOne requires."""

        _closed = False

        def __init__(self, *args: object, **options: object) -> None:
            super().__init__("localhost", _store=store)

        def server_info(self) -> dict[str, object]:
            return {"version": "7.0.0", "versionArray": [7, 0, 0, 0]}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pymongo, "MongoClient", Client)
        patch.setenv("FIFTYONE_DATABASE_URI", "mongodb://localhost")
        patch.setenv("FIFTYONE_DO_NOT_TRACK", "1")
        patch.setenv("FIFTYONE_CONFIG_PATH", os.devnull + ".json")
        mongoengine = pytest.importorskip("mongoengine.connection")
        patch.setattr(mongoengine, "MongoClient", Client)
        yield pytest.importorskip("fiftyone")


def load(root: Path, **options: Any) -> Any:
    from recipe_runtime import fiftyone

    return fiftyone.load(root, **options)


def groups_of(dataset: Any) -> list[dict[str, Any]]:
    """Return the samples of each group by slice; mongomock has no lookups, which `iter_groups` needs."""
    found: dict[str, dict[str, Any]] = {}
    for name in dataset.group_slices:
        dataset.group_slice = name
        for sample in dataset:
            found.setdefault(sample.group.id, {})[name] = sample
    return [*found.values()]


def test_groups_have_the_sensors_and_modalities_of_a_frame(tmp_path: Path) -> None:
    dataset = made(dataset_plan(frames=3, weathers=1), tmp_path / "tiny")
    found = load(dataset.root, categories="coco")
    assert found.media_type == "group" and {*found.group_slices} == {"street", "side"}
    assert found.info["identity"] == dataset.lock.identity and found.mask_targets["semantic"][12] == "Pedestrian"
    seen = 0
    for group in groups_of(found):
        assert {(sample.variant, sample.frame) for sample in group.values()} == {
            (group["side"].variant, group["side"].frame)
        }
        for name, sample in group.items():
            folder = dataset.root / sample.variant / name
            assert Path(sample.filepath) == (folder / f"rgb/{sample.frame:06d}.png").absolute()
            instance = np.asarray(Image.open(folder / f"instance/{sample.frame:06d}.png"))
            painted = np.zeros_like(instance)
            height, width = instance.shape
            for item in sample.ground_truth.detections:
                x, y = round(item.bounding_box[0] * width), round(item.bounding_box[1] * height)
                h, w = item.mask.shape
                painted[y : y + h, x : x + w][item.mask] = item.index
                assert item.label == {12: "person", 15: "truck"}[item.index // 1000]
            assert np.array_equal(painted, instance) and painted.any()
            seen += 1
        street = group["street"]
        assert Path(street.semantic.mask_path).is_file() and street.depth.map.shape == (48, 64)
        assert group["side"].semantic is None
    assert seen == 3 * sum(len(variant.rig.sensors) for variant in dataset.plan.variants)


def test_sensors_without_colour_are_left_out(tmp_path: Path) -> None:
    plan = dataset_plan(frames=1, weathers=1)
    street, side = plan.variants[0].rig.sensors
    rig = RigPlan(sensors=(street.model_copy(update={"capture": ("depth",)}), side))
    dataset = made(
        plan.model_copy(update={"variants": (plan.variants[0].model_copy(update={"rig": rig}),)}), tmp_path / "a"
    )
    assert [[*group] for group in groups_of(load(dataset.root))] == [["side"]]


def test_fiftyones_importer_reads_flat_coco(tmp_path: Path, fiftyone: Any) -> None:
    dataset = made(dataset_plan(frames=2, weathers=1), tmp_path / "tiny")
    coco = json.loads((dataset.root / "annotations/coco/rgb.json").read_text())
    found = fiftyone.Dataset.from_dir(
        dataset_type=fiftyone.types.COCODetectionDataset,
        data_path=str(dataset.root),
        labels_path="annotations/coco/rgb.json",
        dataset_dir=str(dataset.root),
        label_types=["detections", "segmentations"],
        extra_attrs=["actor"],
    )
    samples = {os.path.relpath(sample.filepath, dataset.root): sample for sample in found}
    assert samples.keys() == {image["file_name"] for image in coco["images"]}
    for image in coco["images"]:
        marked = [a for a in coco["annotations"] if a["image_id"] == image["id"]]
        labels = samples[image["file_name"]].segmentations.detections
        assert [label.actor for label in labels] == [annotation["actor"] for annotation in marked]
        assert [int(label.mask.sum()) for label in labels] == [annotation["area"] for annotation in marked]


def test_a_damaged_dataset_is_refused(tmp_path: Path) -> None:
    from recipe_runtime import fiftyone

    dataset = made(dataset_plan(frames=1, weathers=1), tmp_path / "tiny")
    picture = dataset.root / dataset.plan.variants[0].variant / "street/rgb/000000.png"
    picture.unlink()
    picture.symlink_to("/etc/hostname")
    with pytest.raises(InputError, match="not a regular file"):
        [*fiftyone.samples(read(dataset.root))]
