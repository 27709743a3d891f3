"""The export for KITTI, read by code that follows its development kit; `test_trackeval` evaluates it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pycocotools.mask
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from PIL import Image
from recipe_cli.commands.export import command
from recipe_compiler.ir.plan import Pose, RigPlan
from recipe_runtime.annotate.calibration import calibration
from recipe_runtime.core.transforms import compose, from_pose, invert
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.export import export
from recipe_runtime.transfer.formats import kitti

from tests.runtime.build.test_slow_sensors import slowed
from tests.runtime.fakes import dataset_plan, quiet, sensor_plan
from tests.runtime.transfer.conftest import made

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools' decode


@pytest.mark.slow
def test_kitti_masks_are_the_instance_pictures(tiny: Dataset, tmp_path: Path) -> None:
    export(tiny, tmp_path / "out", "kitti", quiet)
    rows = [line.split(",") for line in (tmp_path / "out/sequences.csv").read_text().splitlines()[1:]]
    assert [row[0] for row in rows] == [f"{n:04d}" for n in range(8)]
    painted = np.zeros((12, 48, 64), np.int64)
    for line in (tmp_path / "out/mots/label_02/0000.txt").read_text().splitlines():
        frame, identity, _, height, width, counts = line.split(" ")
        code = {"size": [int(height), int(width)], "counts": counts.encode()}
        painted[int(frame)] += pycocotools.mask.decode(code).astype(np.int64) * int(identity)
    folder = tiny.root / "mots/instances/weather=w0_jitter=still+street"
    assert np.array_equal(painted, np.stack([np.asarray(Image.open(p)) for p in sorted(folder.iterdir())]))
    seqmap = (tmp_path / "out/training/evaluate_tracking.seqmap.training").read_text().splitlines()
    assert seqmap[0] == "0000 empty 000000 000012"


def test_a_line_of_kittis_poses_is_a_frame(tmp_path: Path) -> None:
    """Regression: of a sensor with a tick, line k was the pose of its k-th picture, not of frame k."""
    plan = slowed(dataset_plan(weathers=1))
    dataset = made(plan, tmp_path / "tiny")
    export(dataset, tmp_path / "out", "kitti", quiet)
    poses = np.loadtxt(tmp_path / "out/training/poses/0000.txt").reshape(-1, 3, 4)
    lines = (dataset.root / "weather=w0,jitter=still" / "street" / "labels.jsonl").read_text().splitlines()
    assert len(poses) == 11  # as many as in the list of sequences
    for label in map(json.loads, lines):
        np.testing.assert_array_equal(poses[label["frame"]], label["calibration"]["camera_to_world"][:3])
    assert np.isnan(poses[[k for k in range(11) if k % 5]]).all()


def test_lens_distortion_is_reported_for_kitti(tmp_path: Path) -> None:
    """Regression: boxes projected by a calibration of KITTI missed the pictures, without a message.

    At first, the message named one sensor of several.
    """
    plan = dataset_plan(2, 1)
    sensor = plan.variants[0].rig.sensors[0]
    bent = sensor.model_copy(update={"camera": sensor.camera.model_copy(update={"lens_k": 0.3})})
    straight, also = (each.model_copy(update={"name": "side"}) for each in (sensor, bent))
    first = plan.variants[0].model_copy(update={"rig": RigPlan(sensors=(bent, straight))})
    second = plan.variants[1].model_copy(update={"rig": RigPlan(sensors=(bent, also))})
    plan = plan.model_copy(update={"variants": (first, second)})
    dataset = made(plan, tmp_path / "tiny")
    for form, warned in (("kitti", True), ("mots", False)):
        call = [str(dataset.root), str(tmp_path / form), "--format", form]
        done = CliRunner().invoke(command, call, catch_exceptions=False)
        assert (done.exit_code, "pictures of street, side have lens distortion" in done.stderr) == (0, warned)


def kitti_corners(fields: list[str]) -> NDArray[np.float64]:
    """Return the corners of a label's 3-D box in the camera frame [8, 3], as KITTI's development kit computes them."""
    h, w, l, x, y, z, turn = map(float, fields[10:17])  # noqa: E741  KITTI's names
    along = np.array([l, l, -l, -l, l, l, -l, -l]) / 2
    down = np.array([0, 0, 0, 0, -h, -h, -h, -h])
    aside = np.array([w, -w, -w, w, w, -w, -w, w]) / 2
    rotation = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    corners: NDArray[np.float64] = (rotation @ np.stack([along, down, aside])).T + np.array([x, y, z])
    return corners


def level_box(frame_from_actor: NDArray[np.float64]) -> Any:
    """Return the box of a car 4.5 x 1.8 x 1.5 m whose frame has the given transform, a rotation about z only."""
    yaw = math.atan2(frame_from_actor[1, 0], frame_from_actor[0, 0])
    centre = frame_from_actor @ [0.05, 0.0, 0.75, 1.0]
    rotation = [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]
    return {"centre": centre.tolist(), "size": [4.5, 1.8, 1.5], "rotation": rotation, "yaw": math.degrees(yaw)}


def record_of(box: list[int], **changed: float) -> Any:
    """Return the record of a car 9 m ahead of the camera with a 2-D box."""
    seen = level_box(compose(invert(from_pose(Pose(z=1.6))), from_pose(Pose(x=9))))
    shares = {"truncation": 0.0, "visible_fraction": 1.0, **changed}
    return {"instance": 14003, "amodal_bbox": box, "box3d": seen, **shares}


def labels_of(*records: Any) -> list[list[str]]:
    """Return the fields of the label lines of one frame."""
    camera = calibration(sensor_plan().camera, from_pose(Pose(z=1.6)))
    lines = kitti.label_lines([{"frame": 7, "time": 0.7, "calibration": camera, "objects": list(records)}])
    return [line.split() for line in lines]


@pytest.mark.parametrize(("wide", "high"), [(1, 1), (1, 30), (30, 1), (2, 2), (2, 30)])
def test_every_counted_box_has_an_area(wide: int, high: int) -> None:
    """Regression: a box of one pixel was counted, but no detection can match one without area."""
    (fields,) = labels_of(record_of([3, 4, wide, high]))
    assert len(fields) == 17
    x0, y0, x1, y1 = map(float, fields[6:10])
    assert x1 > x0 and y1 > y0
    if min(wide, high) > 1:
        assert fields[1:3] == ["14003", "Car"] and (x1, y1) == (2 + wide, 3 + high)
    else:
        assert fields[:6] == ["7", "-1", "DontCare", "-1", "-1", "-10.000000"]
        assert (x0, y0, x1, y1) == (2.5, 3.5, 2.5 + wide, 3.5 + high)  # (0, 0) is the centre of the first pixel


@pytest.mark.parametrize(("share", "level"), [(0.0, "0"), (0.02, "0"), (0.021, "1"), (0.5, "1"), (0.51, "2")])
def test_truncated_is_a_level(share: float, level: str) -> None:
    (fields,) = labels_of(record_of([3, 4, 20, 10], truncation=share))
    assert fields[3] == level


@pytest.mark.parametrize(("camera_yaw", "actor_yaw"), [(0, 0), (30, 0), (0, 70), (-100, -60), (170, 10)])
def test_kitti_boxes_equal_the_boxes_of_the_dataset(camera_yaw: float, actor_yaw: float) -> None:
    """For a level camera, projections of the KITTI box by `calib` and of the world's box by K agree."""
    sensor = from_pose(Pose(x=3, y=-2, z=1.6, yaw=camera_yaw))
    ahead = compose(sensor, from_pose(Pose(x=9, y=1.5, z=-1.6)))
    actor = from_pose(Pose(x=ahead[0, 3], y=ahead[1, 3], yaw=actor_yaw))
    world, seen = level_box(actor), level_box(compose(invert(sensor), actor))
    record: Any = {
        "instance": 14003,
        "truncation": 0.0,
        "visible_fraction": 0.8,
        "amodal_bbox": [3, 4, 10, 20],
        "box3d": seen,
    }
    camera = calibration(sensor_plan().camera, sensor)
    (line,) = kitti.label_lines([{"frame": 7, "time": 0.7, "calibration": camera, "objects": [record]}])
    fields = line.split()
    assert fields[:5] == ["7", "14003", "Car", "0", "1"]
    assert fields[6:10] == ["3.00", "4.00", "12.00", "23.00"]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]) / 2
    local = signs * world["size"] - [0, 0, world["size"][2] / 2]
    c, s = math.cos(math.radians(world["yaw"])), math.sin(math.radians(world["yaw"]))
    corners = local @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + world["centre"]
    pose = np.array(camera["world_to_camera"])
    expected = corners @ pose[:3, :3].T + pose[:3, 3]
    found = kitti_corners(fields)
    assert np.allclose(sorted(found.round(3).tolist()), sorted(expected.round(3).tolist()), atol=2e-3)
    rows = dict(
        row.split(":", 1) if ":" in row else row.split(" ", 1) for row in kitti.calibration_text(camera).splitlines()
    )
    p2 = np.array(rows["P2"].split(), float).reshape(3, 4)
    pixels = (p2 @ np.append(expected[0], 1)) / expected[0, 2]
    assert np.allclose(pixels[:2] + 0.5, (np.array(camera["K"]) @ expected[0] / expected[0, 2])[:2])
