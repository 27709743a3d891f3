"""A sensor with an interval: skipped frames are absent everywhere, and the other frames are unchanged."""

from __future__ import annotations

import json
import shutil
import tarfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import kwcoco
import numpy as np
import pytest
from PIL import Image
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.ir.plan import DatasetPlan, RigPlan, SensorPlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.dataset import digests, plan_checks
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.manifest_reader import read as read_manifest
from recipe_runtime.frames.shot import shot
from recipe_runtime.scenario import Scenario, Scenes
from recipe_runtime.transfer.export import export
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.verify import Options, verify, verify_files

from tests.runtime.fakes import ENGINES, dataset_plan, quiet, tree
from tests.runtime.forging import edited

TAKEN, OTHERS = (0, 5, 10), (1, 4, 11)
STREET = "weather=w0,jitter=shaky/street"


def slowed(plan: DatasetPlan, interval: int = 5) -> DatasetPlan:
    """Return the plan with a slower street sensor; the side sensor captures every frame."""

    def slow(sensor: SensorPlan) -> SensorPlan:
        return sensor.model_copy(update={"interval": interval}) if sensor.name == "street" else sensor

    variants = [
        v.model_copy(update={"rig": RigPlan(sensors=tuple(slow(s) for s in v.rig.sensors))}) for v in plan.variants
    ]
    return plan.model_copy(update={"variants": tuple(variants)})


SLOW = slowed(dataset_plan())


def made(folder: Path, plan: DatasetPlan) -> Path:
    return build(plan, folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES)).path


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("slow"), SLOW)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("whole"), dataset_plan())


def test_a_plan_without_intervals_does_not_contain_the_field() -> None:
    """So digests of plans from before the option are unchanged."""
    for sensor in dataset_plan().variants[0].rig.sensors:
        assert not sensor.document().keys() & {"arm", "interval"}
    street = SLOW.variants[0].rig.sensors[0].document()
    assert street["interval"] == 5 and "arm" not in street


def test_captured_frames_equal_those_of_a_full_build_and_others_are_absent(slow: Path, whole: Path) -> None:
    ours, theirs = tree(slow), tree(whole)
    for variant in SLOW.variants:
        for modality in MODALITIES:
            folder = f"{variant.variant}/street/{modality}"
            there = {path for path in ours if path.startswith(folder)}
            assert there == {f"{folder}/{k:06d}.png" for k in TAKEN}
            assert all(ours[path] == theirs[path] for path in there)
        lines, all_lines = (d[f"{variant.variant}/street/labels.jsonl"].splitlines() for d in (ours, theirs))
        assert lines == [all_lines[k] for k in TAKEN]
        side = [path for path in theirs if path.startswith(f"{variant.variant}/side/")]
        assert side and all(ours[path] == theirs[path] for path in side)
        assert ours[f"{variant.variant}/tracks.csv"] == theirs[f"{variant.variant}/tracks.csv"]
    assert {path for path in ours if not layout.is_of_page(path)} == layout.expected_files(SLOW)


def test_the_estimated_size_counts_captured_frames_only(slow: Path) -> None:
    plan_checks.check_bounds(SLOW)
    assert plan_checks.row_count(SLOW) == 4 * (
        3 * (1 + len(MODALITIES)) + 12 * 3
    )  # labels and all modalities; labels and two
    assert len(list(digests.frame_keys(SLOW))) == plan_checks.row_count(SLOW)
    files = sum(path.is_file() for path in slow.rglob("*"))
    assert files <= plan_checks.file_count(SLOW) <= files + 48  # variants share data of the page


def test_the_manifest_and_the_lockfile_use_the_frame_numbers_of_the_clip(
    slow: Path, whole: Path, tmp_path: Path
) -> None:
    manifest = json.loads((slow / "manifest.json").read_text())
    row = manifest["variants"]["weather=w0,jitter=shaky"]
    full = json.loads((whole / "manifest.json").read_text())["variants"]["weather=w0,jitter=shaky"]
    assert row["intervals"] == {"street": 5} and "intervals" not in full
    assert row["frames"]["street"]["rgb"] == [full["frames"]["street"]["rgb"][k] for k in TAKEN]
    locked = lock(SLOW, "tiny.yaml", {}, workers=0, progress=quiet, engines=ENGINES)
    assert {number for _, sensor, _, number in locked.frames if sensor == "street"} == set(TAKEN)
    assert locked.identity == manifest["identity"]
    locked.write(tmp_path / "tiny.lock")
    assert lockfile.read(tmp_path / "tiny.lock").frames == locked.frames


@pytest.mark.parametrize("intervals", [{"street": 1}, {"street": "5"}, {}, [5], {"street": True}])
def test_a_manifest_with_an_invalid_interval_is_damaged(slow: Path, tmp_path: Path, intervals: Any) -> None:
    manifest = json.loads((slow / "manifest.json").read_text())
    manifest["variants"]["weather=w0,jitter=shaky"]["intervals"] = intervals
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(ValueError, match="intervals"):
        read_manifest(tmp_path)


def test_intervals_of_a_manifest_are_those_of_its_plan(slow: Path, tmp_path: Path) -> None:
    """Of a sensor that takes one frame only, no number of a frame depends on its interval."""
    root = Path(shutil.copytree(slow, tmp_path / "slow"))
    with edited(root) as manifest:
        for row in manifest["variants"].values():
            row["intervals"] = {"street": 4}
    with pytest.raises(InputError, match="has other intervals of frames than its plan"):
        datasets.read(root)


@pytest.mark.slow
def test_it_passes_verification_and_a_frame_under_another_number_fails(slow: Path) -> None:
    held, options = datasets.read(slow), Options(nonce=1, everything=True, workers=0)
    report = verify(held.plan, held.lock, options, quiet, dataset=held, engines=ENGINES)
    assert (report.verdict, report.bound.total) == ("PASS", 4 * (3 + 12))
    assert verify_files(held, options, quiet).verdict == "PASS"
    moved = {(k, s, m, n + (s == "street" and n > 0)): v for (k, s, m, n), v in held.lock.frames.items()}
    report = verify(held.plan, replace(held.lock, frames=moved), options, quiet, engines=ENGINES)
    assert report.verdict == "FAIL"


def test_annotations_use_the_clips_frame_numbers_and_times(slow: Path) -> None:
    data = kwcoco.CocoDataset(slow / "annotations/kwcoco.json")
    assert not data.missing_images()
    for name, numbers in (("street", list(TAKEN)), ("side", list(range(12)))):
        (video,) = (row for row in data.dataset["videos"] if row["name"] == f"weather=w0,jitter=still/{name}")
        rows = [row for row in data.dataset["images"] if row["video_id"] == video["id"]]
        assert [row["frame_index"] for row in rows] == numbers
        assert [row["timestamp"] for row in rows] == [round(k / video["framerate"], 6) for k in numbers]
    flat = json.loads((slow / "annotations/coco/rgb.json").read_text())
    assert all((slow / row["file_name"]).is_file() for row in flat["images"])
    shown = [row for row in flat["images"] if row["file_name"].startswith(f"{STREET}/")]
    assert [row["frame_index"] for row in shown] == list(TAKEN)


def test_mots_text_and_pictures_use_the_same_frame_numbers(slow: Path, whole: Path) -> None:
    name = layout.sequence("weather=w0,jitter=shaky", "street")
    lines = (slow / f"mots/MOTS-train/{name}/gt/gt.txt").read_text().splitlines()
    every = (whole / f"mots/MOTS-train/{name}/gt/gt.txt").read_text().splitlines()
    assert lines == [line for line in every if int(line.split()[0]) - 1 in TAKEN]
    assert "seqLength=11\n" in (slow / f"mots/MOTS-train/{name}/seqinfo.ini").read_text()
    pictures = sorted(path.stem for path in (slow / f"mots/instances/{name}").iterdir())
    assert pictures == [f"{k + 1:06d}" for k in TAKEN]


def test_an_export_has_only_the_captured_frames(slow: Path, tmp_path: Path) -> None:
    export(datasets.read(slow), tmp_path / "out", "webdataset", quiet)
    names: list[str] = []
    for path in sorted((tmp_path / "out").glob("*.tar")):
        with tarfile.open(path) as shard:
            names += shard.getnames()
    assert {n.split(".")[0] for n in names if n.startswith(f"{STREET}/")} == {f"{STREET}/{k:06d}" for k in TAKEN}


@pytest.mark.slow
def test_only_a_sensor_with_another_rate_is_rendered_again(slow: Path, tmp_path: Path) -> None:
    made(tmp_path, SLOW)
    result = build(
        slowed(dataset_plan(), 3), tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)
    )
    assert (result.taken_frames, result.made_frames) == (4 * 12, 4 * 4)
    again = build(SLOW, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))
    assert again.taken_frames == 4 * 12
    assert tree(again.path) == tree(slow)
    wider = dataset_plan(weathers=3)
    grown = build(slowed(wider), tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))
    assert grown.taken_frames == 4 * (12 + 3)  # frames of a slow sensor are reused too
    assert tree(grown.path) == tree(made(tmp_path / "fresh", slowed(wider)))


def test_a_scenario_renders_only_captured_frames(slow: Path) -> None:
    with Scenario(SLOW.variants[1], Scenes(engines=ENGINES)) as scenario:
        assert (len(scenario), scenario.frames(), scenario.frames("side")) == (12, range(0, 12, 5), range(12))
        assert [number for number, _ in scenario.stream("street")] == list(TAKEN)
        stored = np.asarray(Image.open(slow / SLOW.variants[1].variant / "street/rgb/000005.png"))
        assert np.array_equal(scenario.render(5), stored)
        for number in OTHERS:
            with pytest.raises(InputError, match=f"the sensor street takes no picture at frame {number}"):
                scenario.render(number)
            with pytest.raises(InputError, match="takes no picture"):
                scenario.labels(number)


def test_a_shot_is_of_a_captured_frame(tmp_path: Path) -> None:
    variant = SLOW.variants[0]
    assert shot(variant, engines=ENGINES).frame == 5  # the middle one of the three captured frames
    assert shot(variant, "street", 10, engines=ENGINES).frame == 10
    with pytest.raises(InputError, match="street takes no picture at frame 6; it takes 0, 5, 10 only"):
        shot(variant, "street", 6, engines=ENGINES)
