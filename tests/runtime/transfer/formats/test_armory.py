"""Exports for Armory and MART, read back by readers that follow the documentation of their loaders, key by key."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.patches import PatchFace, PatchPlan, PatchTexture
from recipe_runtime.attacks.patch_metadata import is_on_ground
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.loading import opened
from recipe_runtime.transfer.export import export
from recipe_runtime.transfer.formats import armory, sequence
from recipe_runtime.transfer.formats.format import Row

from tests.runtime.fakes import quiet, tree
from tests.runtime.test_python_page import examples
from tests.runtime.transfer import conftest
from tests.runtime.transfer.conftest import RECIPE

FRAMES, WIDTH, HEIGHT = 3, 96, 72


@pytest.fixture(scope="module")
def made(attacked: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "armory"
    export(attacked, out, "armory", quiet)
    return out


def image(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as picture:
        assert picture.mode == "RGB", path
        return np.array(picture)


def detection_examples(dev: Path, kind: str) -> list[dict[str, Any]]:
    """Read a folder like Armory's loaders for object detection; `kind` is obj_det or over_obj_det."""
    street = kind == "obj_det"
    out = dev / "_out" if street else dev
    name = "kwcoco_annotations_without_patch_and_sans_tiny_objects.json" if street else "kwcoco_annotations.json"
    data = json.loads((out / name).read_text())
    assert all(row.keys() == {"id", "name", "supercategory"} for row in data["categories"])
    examples = []
    for row in sorted(data["images"], key=lambda row: str(row["file_name"]).lower()):
        for key in ("date_captured", "license", "coco_url", "flickr_url"):
            row.pop(key)
        if street:
            row.pop("video_id")
            row.pop("frame_index")
        assert row.keys() == {"file_name", "height", "width", "id"}, "a loader takes no other key"
        file = row["file_name"].split("/")[-1]
        stem = file.split(".")[0]
        assert file == f"{stem}.png", "a dot would truncate a name"
        rgb = dev / row["file_name"] if street else dev / "rgb" / file
        depth = out / ("sensor.camera.depth.2" if street else "depth") / file
        mine = sorted((a for a in data["annotations"] if a["image_id"] == row["id"]), key=lambda a: a["id"])
        metadata = out / "patch_metadata"
        examples.append(
            {
                "row": row,
                "rgb": image(rgb),
                "depth": image(depth),
                "objects": [(a["category_id"], a["bbox"], a["area"], bool(a["iscrowd"])) for a in mine],
                "gs_coords": np.load(metadata / f"{stem}_coords.npy"),
                "avg_patch_depth": np.load(metadata / f"{stem}_avg_depth.npy"),
                "mask": image(out / "foreground_mask" / file),
                "max_depth_perturb_meters": 3.0 if file[0] == "1" else 0.03,
            }
        )
    return examples


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["obj_det", "over_obj_det"])
def test_object_detection_is_read_back(attacked: Dataset, made: Path, recipe: Path, kind: str) -> None:
    examples = detection_examples(made / f"carla_{kind}/dev", kind)
    assert len(examples) == 2 * FRAMES, "of the camera that shows the patch, in two weathers"
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        for frame, example in enumerate(examples[:FRAMES]):
            np.testing.assert_array_equal(example["rgb"], scene.render(frame))
            metadata = scene.patch_metadata(frame, "poster")
            assert metadata is not None
            assert example["gs_coords"].dtype == np.int32 and example["gs_coords"].shape == (4, 2)
            np.testing.assert_array_equal(example["gs_coords"], metadata["gs_coords"])
            np.testing.assert_array_equal(example["mask"], metadata["mask"])
            assert set(np.unique(example["mask"])) == {0, 255}
            assert example["avg_patch_depth"].shape == () and example["avg_patch_depth"].dtype == np.float64
            assert example["avg_patch_depth"] == metadata["avg_patch_depth"]
            assert example["max_depth_perturb_meters"] == metadata["max_depth_perturb_meters"] == 3.0
            metres = np.clip(np.asarray(scene.render(frame, modality="depth")).astype(float), 0, 1000)
            if kind == "obj_det":
                assert (example["depth"] == example["depth"][..., :1]).all(), "three equal channels mean logarithmic"
                log = np.clip(1 + np.log(metres / 1000) / 5.70378, 0, 1)
                np.testing.assert_allclose(example["depth"][..., 0] / 255, log, atol=0.5 / 255 + 1e-4)
            else:
                r, g, b = (example["depth"][..., channel].astype(int) for channel in range(3))
                np.testing.assert_allclose((r + 256 * g + 65536 * b) / (256**3 - 1) * 1000, metres, atol=1e-4)
            boxes = [record["bbox"] for record in scene.labels(frame)]
            found = [b if kind == "over_obj_det" else [b[0], b[1], b[2] - b[0], b[3] - b[1]] for _, b, *_ in
                     example["objects"]]  # fmt: skip
            assert sorted(found) == sorted(boxes)
            assert {category for category, *_ in example["objects"]} == {1, 2}
            assert not any(crowd for *_, crowd in example["objects"])


def test_corners_are_clockwise_from_the_top_left(made: Path) -> None:
    for example in detection_examples(made / "carla_over_obj_det/dev", "over_obj_det"):
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = example["gs_coords"].tolist()
        assert ax < bx and dx < cx and ay < dy and by < cy
        inside = example["mask"][..., 0] > 0
        rows, columns = np.nonzero(inside)
        assert columns.min() >= min(ax, dx) - 1 and columns.max() <= max(bx, cx) + 1
        assert rows.min() >= min(ay, by) - 1 and rows.max() <= max(cy, dy) + 1


def test_mart_finds_mask_and_coordinates_by_the_name_of_the_picture(made: Path) -> None:
    root = made / "carla_over_obj_det/dev"
    data = json.loads((root / "kwcoco_annotations.json").read_text())
    for row in data["images"]:
        mask = np.array(Image.open(root / "foreground_mask" / row["file_name"]).convert("L"))
        assert mask.shape == (row["height"], row["width"]) and mask.max() == 255
        stem = Path(row["file_name"]).stem
        assert np.load(root / "patch_metadata" / f"{stem}_coords.npy").shape == (4, 2)
        assert all((root / modality / row["file_name"]).is_file() for modality in ("rgb", "depth"))


def test_mot_is_read_back(made: Path, recipe: Path) -> None:
    dev = made / "carla_mot/dev"
    videos = sorted(path.name for path in dev.iterdir())
    assert len(videos) == 2
    for video in videos:
        files = {kind: sorted((dev / video / kind).glob("*")) for kind in ("rgb", "foreground_mask", "patch_metadata")}
        stems = {kind: [re.split("[./]", str(path))[-2] for path in paths] for kind, paths in files.items()}
        assert len(stems["rgb"]) == FRAMES and stems["rgb"] == stems["foreground_mask"] == stems["patch_metadata"]
        coordinates = np.array([np.load(path) for path in files["patch_metadata"]], dtype=int)
        assert coordinates.shape == (FRAMES, 4, 2)
        assert np.stack([image(path) for path in files["foreground_mask"]]).any(axis=(1, 2, 3)).all()
        rows = np.loadtxt(dev / video / "instances.txt", dtype=np.float32)
        assert rows.shape[1] == 9 and (rows[:, 6] == 1).all() and (rows[:, 8] == 1).all()
        assert set(rows[:, 0]) == {1, 2, 3} and set(rows[:, 7]) == {1, 2}
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        rows = np.loadtxt(dev / videos[0] / "instances.txt", dtype=np.float32)
        for record in scene.labels(1):
            mine = rows[(rows[:, 0] == 2) & (rows[:, 1] == record["instance"])]
            np.testing.assert_array_equal(mine[0, 2:6], record["bbox"])


@pytest.mark.slow
def test_pictures_of_a_slow_sensor_are_numbered_as_its_labels(tmp_path: Path) -> None:
    """Regression: instances.txt counted the pictures of a sensor with a tick, and their names the clip's frames."""
    (tmp_path / "recipe.yaml").write_text(RECIPE.replace("[rgb, depth]", "[rgb, depth]\n      tick: 0.2"))
    plan, engines = opened(tmp_path / "recipe.yaml")
    plan = plan.model_copy(update={"variants": plan.variants[:1]})
    export(conftest.made(plan, tmp_path / "made", engines), tmp_path / "out", "armory", quiet)
    (video,) = (tmp_path / "out/carla_mot/dev").iterdir()
    assert sorted(p.name for p in (video / "rgb").iterdir()) == ["000001.png", "000002.png"]
    assert set(np.loadtxt(video / "instances.txt", dtype=np.float32)[:, 0]) == {1, 2}


@pytest.mark.slow
def test_the_example_of_the_page_reads_a_sample(
    made: Path, recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "exports").mkdir()
    (tmp_path / "exports/armory").symlink_to(made)
    monkeypatch.chdir(tmp_path)
    (example,) = [code for code in examples("docs/attacks.md") if "carla_mot" in code]
    known: dict[str, Any] = {}
    exec(example, known)
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        assert known["video"].name == "0000_weather=clear+street"
        np.testing.assert_array_equal(known["picture"], scene.render(1))
        metadata = scene.patch_metadata(1, "poster")
    assert metadata is not None and known["mask"].any()
    np.testing.assert_array_equal(known["mask"], metadata["mask"])
    assert (known["corners"].dtype, known["corners"].shape) == (np.int64, (4, 2))
    np.testing.assert_array_equal(known["corners"], metadata["gs_coords"])


def test_video_tracking_is_read_back(made: Path, recipe: Path) -> None:
    dev = made / "carla_video_tracking/dev"
    videos = sorted(path.name for path in dev.iterdir())
    assert len(videos) == 2
    for video in videos:
        every = {str(path) for path in (dev / video).glob("*.png")}
        masks = sorted(str(path) for path in (dev / video).glob("*_mask.png"))
        frames = sorted(every - set(masks))
        assert len(frames) == FRAMES and all(r.split(".")[-2] in m for r, m in zip(frames, masks, strict=True))
        boxes, corners = np.load(dev / video / "gt_boxes.npy"), np.load(dev / video / "gs_coords.npy")
        assert (boxes.shape, boxes.dtype, corners.shape, corners.dtype) == (
            (FRAMES, 4), np.int64, (FRAMES, 4, 2), np.int64
        )  # fmt: skip
        shown = image(Path(masks[0]))
        shown[np.all(shown == [255, 255, 255], axis=-1)] = 1
        assert set(np.unique(shown)) == {0, 1}
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        hero = next(record for record in scene.labels(2) if record["actor"] == "hero")
        x, y, w, h = hero["bbox"]
        assert np.load(dev / videos[0] / "gt_boxes.npy")[2].tolist() == [x, y, x + w, y + h]


def test_skipped_pictures_are_listed(made: Path) -> None:
    with (made / "left_out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {(row["sensor"], row["frame"], row["reason"]) for row in rows} == {
        ("away", "all", "no depth"),
        ("away", "all", "patch is not seen"),
    }
    assert rows[0]["variant"] == "weather=clear"


@pytest.mark.slow
def test_the_export_has_the_named_patch(attacked: Dataset, made: Path, recipe: Path, tmp_path: Path) -> None:
    """Armory allows one patch per sample; variants without the named patch are skipped."""
    index = export(attacked, tmp_path / "banner", "armory", quiet, options={"patch": "banner"}).index
    assert index["patch"] == "banner"
    examples = detection_examples(tmp_path / "banner/carla_over_obj_det/dev", "over_obj_det")
    assert 0 < len(examples) <= FRAMES
    with recipe_runtime.open(recipe, variant="weather=foggy") as scene:
        for example in examples:
            metadata = scene.patch_metadata(int(Path(example["row"]["file_name"]).stem[-6:]), "banner")
            assert metadata is not None
            np.testing.assert_array_equal(example["gs_coords"], metadata["gs_coords"])
            np.testing.assert_array_equal(example["mask"], metadata["mask"])
    assert "all,weather=clear,street,all,no patch or no rgb" in (tmp_path / "banner/left_out.csv").read_text()
    export(attacked, tmp_path / "poster", "armory", quiet, options={"patch": "poster"})
    assert without_index(tmp_path / "poster") == without_index(made), "the first patch is the default"
    with pytest.raises(InputError, match="is not this export"):
        export(attacked, tmp_path / "poster", "armory", quiet, options={"patch": "banner"})


def without_index(folder: Path) -> dict[str, Any]:
    """Return the files of an export except the index, which names the requested patch."""
    return {path: content for path, content in tree(folder).items() if path != "index.json"}


def test_an_unknown_patch_is_refused_with_the_valid_names(attacked: Dataset, tiny: Dataset, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no picture with a patch 'baner'; it has poster, banner"):
        export(attacked, tmp_path / "out", "armory", quiet, options={"patch": "baner"})
    with pytest.raises(InputError, match="has no picture with a patch"):
        export(tiny, tmp_path / "out", "armory", quiet)
    assert not (tmp_path / "out").exists()


def test_what_armory_cannot_use_is_reported(attacked: Dataset, tmp_path: Path) -> None:
    """Regression: an export of a patch that no frame shows had no picture, and no message."""
    (tmp_path / "left_out.csv").write_text("layout,variant,sensor,frame,reason\nall,a,street,all,no patch or no rgb\n")
    rows: list[Row] = [{"file": name, "size": 1, "sha256": "0"} for name in ("left_out.csv", "a.png")]
    some = armory.FORMAT.remarks(attacked, tmp_path, rows)
    assert "left_out.csv has 1 row: frames and videos that were left out" in some.notes[0]
    none = armory.FORMAT.remarks(attacked, tmp_path, rows[:1])
    assert "so the export has no picture" in none.warnings[0].message
    assert some.facts == none.facts == {"left_out": 1}


@pytest.mark.parametrize(
    "broken",
    [
        {"corners_int": [[1, 2]]},
        {"area": "9"},
        {"counts": "~~"},
        {"depth": None},
        {"depth": 1e300},
    ],
    ids=str,
)
def test_a_forged_truth_is_an_error(
    attacked: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: dict[str, Any]
) -> None:
    found = sequence.picture_file

    def forged(*given: Any) -> bytes:
        body = found(*given)
        if "/patches/" not in given[1]:
            return body
        truth = json.loads(body)
        truth["patches"][0] |= broken
        return json.dumps(truth).encode()

    monkeypatch.setattr(sequence, "picture_file", forged)
    with pytest.raises(InputError, match="patches/"):
        export(attacked, tmp_path / "out", "armory", quiet)
    assert not (tmp_path / "out").exists()


def test_metadata_without_a_patch_in_view(recipe: Path) -> None:
    with recipe_runtime.open(recipe, variant="weather=foggy") as scene:
        assert scene.patch_metadata(0, sensor="away") is None
        with pytest.raises(InputError, match="it has poster"):
            scene.patch_metadata(0, "Poster")
        found = scene.patch_metadata(-1)
        assert found is not None and found.keys() == {
            "gs_coords", "mask", "avg_patch_depth", "max_depth_perturb_meters"
        }  # fmt: skip
        assert found["mask"].shape == (HEIGHT, WIDTH, 3) and found["gs_coords"].dtype == np.int64
        truth = scene.patches(2)["patches"][0]
        assert int((found["mask"][..., 0] > 0).sum()) == truth["area"]
        assert layout.patches_file("weather=foggy", "street", 2).endswith("street/patches/000002.json")


@pytest.mark.parametrize(
    ("corner", "down", "ground"),
    [((0, 0, 0.15), (-1, 0, 0), True), ((0, 0, 6), (-1, 0, 0), False), ((0, 0, 2), (0, 0, -1), False)],
)
def test_patches_on_the_ground_have_the_smaller_bound(
    corner: tuple[float, float, float], down: tuple[float, float, float], ground: bool
) -> None:
    face = PatchFace(part="static", corner=corner, right=(0, -1, 0), down=down, width=1, height=1, reach=0.02)
    patch = PatchPlan(name="p", body="road", faces=(face,), texture=PatchTexture(colour="#102030"))
    assert is_on_ground(patch) == ground
