"""Bugs of CARLA's data collector (pull request 4992): one test for each shows that this project does not have it.

The numbers are those of the table in docs/carla.md. Other tests check some of the properties in more detail.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pycocotools.mask
import pytest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.lowering.placement import instance_numbers
from recipe_runtime.annotate.categories import MOTS_CLASSES, MOTS_IGNORE
from recipe_runtime.annotate.mots import mots_id, mots_lines
from recipe_runtime.build.pipeline import BuildOptions, build

from tests.compiler.carla.importing import CONFIGS, compiled, import_files, import_text
from tests.runtime.fakes import ENGINES, dataset_plan
from tests.sources import ROOT

MOBILE = (CONFIGS / "mobile_sensors.yaml").read_text()


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("faults")
    return build(dataset_plan(), folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES)).path


@pytest.fixture(scope="module")
def kwcoco(dataset: Path) -> dict[str, list[dict[str, Any]]]:
    rows: dict[str, list[dict[str, Any]]] = json.loads((dataset / "annotations" / "kwcoco.json").read_text())
    return rows


STILL = """
carla: {seed: 42, townmap: Town15}
max_frames: 400
spawn_actors:
  - blueprint: {name: sensor.camera.rgb}
    transform: {location: {x: 1, y: 2, z: 2}}
    sensor_motion: {jitter_magnitude: {x: 0.3, y: 0.02, z: 0.1}}
"""


def test_1_modalities_share_the_jitter_so_labels_match_pixels(tmp_path: Path) -> None:
    (plan,) = compiled(import_text(MOBILE), tmp_path).plan.variants
    (sensor,) = plan.rig.sensors  # two sensors in the configuration, each with its own jitter
    assert sensor.capture == ("rgb", "instance")
    assert len(set(sensor.poses)) == 100


def test_2_jitter_has_no_permanent_offset_and_its_own_bound_on_each_axis(tmp_path: Path) -> None:
    one = import_text(STILL)
    (plan,) = compiled(one, tmp_path).plan.variants
    poses = np.array([[pose.x, pose.y, pose.z] for pose in plan.rig.sensors[0].poses])
    written = {row.to: float(row.written) for row in one.report.rows if ".mount." in row.to and row.written}
    x, y = (written[f"base.sensors.camera.mount.{axis}"] for axis in "xy")
    bounds = np.array([0.3, 0.02, 0.1])
    found = poses - np.array([x, y, 2.0])
    assert np.all(np.abs(found) <= bounds)
    assert np.all(np.ptp(found, axis=0) > 1.9 * bounds)
    assert np.all(np.abs(found.mean(axis=0)) < 4 * bounds / np.sqrt(3 * 400))  # four standard errors
    assert abs(np.corrcoef(found[:-1, 0], found[1:, 0])[0, 1]) < 0.2  # frames are independent


def test_3_the_frame_rate_is_honoured_and_speed_does_not_depend_on_it(tmp_path: Path) -> None:
    places = []
    for fps, frames, per_frame in ((30, 61, 0.1), (10, 21, 0.3)):
        text = MOBILE.replace("fps: 30", f"fps: {fps}").replace("100", str(frames)).replace("1.0", str(per_frame))
        text = text.replace("{x: 0.01, y: 0.001, z: 0.01}", "{}")
        (plan,) = compiled(import_text(text), tmp_path).plan.variants
        assert plan.scene.clock.fps == fps
        poses = plan.rig.sensors[0].poses
        places.append([poses[fps * second].x for second in range(3)])
    assert np.allclose(places[0], places[1], atol=1e-9)
    assert np.allclose(np.diff(places[0]), 3.0, atol=1e-9)


def test_4_defaults_apply_and_unknown_keys_are_reported(tmp_path: Path) -> None:
    one = import_text("max_frames: 1\nfps: 3\nspawn_actors: [{blueprint: {name: sensor.camera.rgb, shape: 1}}]\n")
    (plan,) = compiled(one, tmp_path).plan.variants
    camera = plan.rig.sensors[0].camera
    assert (camera.width, camera.height, camera.fov, plan.scene.clock.fps) == (800, 600, 90, 30)
    assert {default.to for default in one.report.defaults} >= {"seed", "base.clock.fps", "base.town"}
    unknown = {row.key: row.why for row in one.report.rows if row.outcome == "ignored"}
    assert unknown["fps"] and unknown["spawn_actors[0].blueprint.shape"]


def test_5_a_slow_sensor_does_not_end_the_run(tmp_path: Path) -> None:
    (following,) = import_files(CONFIGS / "following.yaml")  # with a sensor_tick of two frames
    assert compiled(following, tmp_path).plan.variants


def test_6_ids_and_frame_numbers_are_integers_and_videos_are_listed(kwcoco: dict[str, list[dict[str, Any]]]) -> None:
    assert kwcoco["videos"] and kwcoco["tracks"]
    for row in kwcoco["images"]:
        assert {type(row[key]) for key in ("id", "video_id", "frame_index", "width", "height")} == {int}
    assert {row["video_id"] for row in kwcoco["images"]} == {row["id"] for row in kwcoco["videos"]}


@pytest.mark.slow
def test_6_kwcoco_accepts_the_file(dataset: Path) -> None:
    from kwcoco.coco_schema import COCO_SCHEMA

    COCO_SCHEMA.validate(json.loads((dataset / "annotations" / "kwcoco.json").read_text()))


@pytest.mark.slow
def test_7_a_track_is_of_one_actor_and_does_not_depend_on_the_order_of_files(
    dataset: Path, kwcoco: dict[str, list[dict[str, Any]]], tmp_path: Path
) -> None:
    actors: dict[int, set[tuple[str, int]]] = {}
    for row in kwcoco["annotations"]:
        actors.setdefault(row["track_id"], set()).add((row["actor"], row["instance"]))
    assert all(len(each) == 1 for each in actors.values())
    variants = {row["id"]: row["variant"] for row in kwcoco["videos"]}
    videos = {row["id"]: variants[row["video_id"]] for row in kwcoco["images"]}
    tracks = {row["id"]: row["variant"] for row in kwcoco["tracks"]}
    assert all(videos[row["image_id"]] == tracks[row["track_id"]] for row in kwcoco["annotations"])
    assert set(actors) <= {row["id"] for row in kwcoco["tracks"]}
    again = build(
        dataset_plan(), tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)
    ).path
    name = "annotations/kwcoco.json"
    assert (again / name).read_bytes() == (dataset / name).read_bytes()


def test_8_image_ids_do_not_collide(kwcoco: dict[str, list[dict[str, Any]]]) -> None:
    ids = [row["id"] for row in kwcoco["images"]]
    assert len(set(ids)) == len(ids) == 96


def test_9_mots_classes_are_those_of_trackeval() -> None:
    pedestrian, car, truck = 12, 14, 15
    assert (MOTS_CLASSES[pedestrian], MOTS_CLASSES[car]) == (2, 1)  # the collector wrote 4, and 10, the ignore class
    assert mots_id(pedestrian * 1000 + 7) == 2007
    assert mots_id(truck * 1000 + 7) == MOTS_IGNORE * 1000
    assert all(mots_id(tag * 1000 + 999) // 1000 == kind for tag, kind in MOTS_CLASSES.items())


def test_10_every_sequence_has_all_its_frames_and_an_id_occurs_once_per_frame(dataset: Path) -> None:
    files = sorted((dataset / "mots" / "MOTS-train").glob("*/gt/gt.txt"))
    assert len(files) == 8
    for file in files:
        rows = [line.split(" ") for line in file.read_text().splitlines()]
        assert {int(row[0]) for row in rows} == set(range(1, 13))
        assert len({(row[0], row[1]) for row in rows}) == len(rows)
        assert all(int(row[1]) // 1000 == int(row[2]) for row in rows)


def test_10_parts_of_the_ignore_region_are_one_row() -> None:
    """In the collector, traffic lights and objects without a class had several rows with one ID in a frame."""
    masks = [np.asfortranarray(np.eye(2, 5, column, dtype=np.uint8)) for column in (0, 3)]
    counts = [pycocotools.mask.encode(mask)["counts"].decode() for mask in masks]
    records: list[Any] = [{"instance": 15001 + n, "counts": text} for n, text in enumerate(counts)]
    frame: Any = {"frame": 0, "objects": records}
    (line,) = mots_lines([frame], 5, 2)
    assert line.startswith("1 10000 10 2 5 ")


def test_11_a_fragmented_object_is_not_a_crowd(kwcoco: dict[str, list[dict[str, Any]]]) -> None:
    assert {row["iscrowd"] for row in kwcoco["annotations"]} == {0}


def test_12_more_instances_than_an_id_can_hold_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="limit of 299 actors is exceeded, 300"):
        instance_numbers([f"a{n}" for n in range(300)], ())
    with pytest.raises(ValueError, match="limit of actors that occur only in deltas"):
        instance_numbers((), [f"a{n}" for n in range(101)])
    actors = "  - blueprint: {name: 'walker.*'}\n" * 300
    with pytest.raises(InputError, match=r"301 entries; keep at most 300, or write an ActorsGenerator for crowds"):
        import_text("max_frames: 1\nspawn_actors:\n  - blueprint: {name: sensor.camera.rgb}\n" + actors)


def test_13_annotations_have_visibility_and_datasets_have_provenance(
    dataset: Path, kwcoco: dict[str, list[dict[str, Any]]]
) -> None:
    for row in kwcoco["annotations"]:
        assert {"visible_fraction", "truncation", "amodal_bbox"} <= row.keys()
    manifest = json.loads((dataset / "manifest.json").read_text())
    assert "sha256" in json.dumps(manifest)


def test_the_page_lists_the_same_bugs() -> None:
    page = (ROOT / "docs" / "carla.md").read_text(encoding="utf-8")
    text = Path(__file__).read_text(encoding="utf-8")
    numbers = [n for n in range(1, 99) if f"def test_{n}_" in text]
    assert numbers == list(range(1, 14))
    assert all(f"\n| {n} | " in page for n in numbers) and "\n| 14 | " not in page
