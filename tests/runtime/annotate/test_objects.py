"""Annotations agree with the pixels, as counted by pycocotools, and with the geometry."""

import math
from pathlib import Path

import numpy as np
import pycocotools.mask
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_compiler.ir.plan_types import fixed
from recipe_runtime.annotate.calibration import Calibration
from recipe_runtime.annotate.masks import masks
from recipe_runtime.annotate.objects import truncation
from recipe_runtime.annotate.records import Box3d, FrameRecord, LabelledFrame, LabelRecord, label_digest
from recipe_runtime.body.kinematics import quaternion_of_matrix
from recipe_runtime.build.journal import CacheJournal
from recipe_runtime.core.transforms import compose, from_pose, invert, part_transforms
from recipe_runtime.dataset.schedule import all_shards, views
from recipe_runtime.modalities import pixel_digest

from tests.runtime.fakes import ENGINES, NO_LABELS, actor_bodies, dataset_plan, simulate
from tests.runtime.frame_source import FrameSource


def pictures() -> list[NDArray[np.uint16]]:
    """Yield instance pictures with runs at the first and last pixel, across columns, in pieces and of one pixel."""
    empty = np.zeros((6, 5), np.uint16)
    whole = np.full((6, 5), 12001, np.uint16)
    corners = empty.copy()
    corners[0, 0] = corners[5, 4] = 14002
    column = empty.copy()
    column[:, 2:4] = 12003
    wrapped = empty.copy()
    wrapped[4:, 1] = wrapped[:2, 2] = 15001  # one run across the end of a column
    noise = (np.arange(48 * 64) * 2654435761 % 4 + 12000).astype(np.uint16).reshape(48, 64)
    noise[noise == 12000] = 0
    return [empty, whole, corners, column, wrapped, noise, noise[:, :1], noise[:1]]


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools' decode
@pytest.mark.parametrize("picture", pictures())
def test_masks_decode_to_the_instance_pixels(picture: NDArray[np.uint16]) -> None:
    found = masks(picture)
    assert [m.instance for m in found] == sorted(set(picture[picture > 0].tolist()))
    for mask in found:
        pixels = np.asarray(picture == mask.instance)
        code = {"size": list(picture.shape), "counts": mask.counts.encode()}
        assert np.array_equal(pycocotools.mask.decode(code).astype(bool), pixels)
        assert code["counts"] == pycocotools.mask.encode(np.asfortranarray(pixels.astype(np.uint8)))["counts"]
        ys, xs = np.nonzero(pixels)
        width, height = np.ptp(xs) + 1, np.ptp(ys) + 1
        assert mask.area == pixels.sum()
        assert mask.box == tuple(map(int, (xs.min(), ys.min(), width, height)))


CAMERA = CameraPlan(width=100, height=100, fov=90)


def test_truncation_is_the_fraction_outside_the_picture() -> None:
    assert truncation((10.0, 20.0, 30.0, 40.0), CAMERA) == 0.0
    assert truncation((-10.0, 20.0, 30.0, 40.0), CAMERA) == 0.25
    assert truncation((-100.0, -100.0, 200.0, 200.0), CAMERA) == fixed(8 / 9)
    assert truncation((100.0, 20.0, 130.0, 40.0), CAMERA) == 1.0


def test_records_describe_the_scene(tmp_path: object) -> None:
    plan = dataset_plan()
    source = FrameSource(plan.variants[0], simulate(plan.variants[0].scene), engines=ENGINES)
    arrays, labels = source.render_labelled("street", 3)
    records = labels["objects"]
    assert sorted(arrays) == sorted(MODALITIES)
    assert (labels["frame"], labels["time"]) == (3, 0.3)
    by_name = {r["actor"]: r for r in records}
    hero = by_name["hero1"]
    assert hero["instance"] == 12001
    box = {"centre": [4.0, -2.375, 0.0], "size": [1.0, 1.0, 2.0], "rotation": [1.0, 0.0, 0.0, 0.0], "yaw": 0.0}
    assert hero["tight3d"] == box
    assert hero["tight3d_world"] == {**box, "centre": [4.0, -2.375, 1.0]}
    assert hero["distance"] == fixed(math.dist(hero["box3d"]["centre"], (0, 0, 0)))
    assert hero["velocity"] == [0.0, 1.0, 0.0]
    assert all(0 < r["visible_fraction"] <= 1 for r in records)
    assert any(r["visible_fraction"] < 1 for f in range(12) for r in source.render_labelled("street", f)[1]["objects"])


def test_records_have_the_fields_of_their_types() -> None:
    plan = dataset_plan()
    source = FrameSource(plan.variants[0], simulate(plan.variants[0].scene), engines=ENGINES)
    labels = source.render_labelled("street", 3)[1]
    assert labels.keys() == LabelledFrame.__annotations__.keys()
    assert labels["calibration"].keys() == Calibration.__annotations__.keys()
    for record in labels["objects"]:
        assert record.keys() == LabelRecord.__annotations__.keys()
        boxes = record["box3d"], record["box3d_world"], record["tight3d"], record["tight3d_world"]
        assert all(list(box) == list(Box3d.__annotations__) for box in boxes)


def test_a_journal_returns_the_records_written(tmp_path: Path) -> None:
    """JSON has no tuples: file rows are read as their declared type, so that they compare equal."""
    plan = dataset_plan()
    shard, journal = all_shards(plan)[0], CacheJournal(tmp_path, "run")
    record: FrameRecord = {
        **NO_LABELS,
        "digests": {},
        "rgb": {},
        "files": {"a": (1, "x"), "b": (2, "y")},
    }
    journal.write(shard, views(plan)[shard.view], [record])
    assert journal.read(shard, views(plan)[shard.view]) == [record]


def test_digests_differ_where_pixels_or_labels_differ() -> None:
    plan = dataset_plan()
    one, other = (FrameSource(v, simulate(v.scene), engines=ENGINES) for v in plan.variants[::2])  # two weathers
    (a, labels), (b, same) = one.render_labelled("street", 3), other.render_labelled("street", 3)
    assert label_digest(labels) == label_digest(same) != label_digest(one.render_labelled("street", 4)[1])
    for modality in ("depth", "instance", "semantic"):
        assert pixel_digest(modality, a[modality]) == pixel_digest(modality, b[modality])
    assert pixel_digest("rgb", a["rgb"]) != pixel_digest("rgb", b["rgb"])


def turned(q: list[float]) -> NDArray[np.float64]:
    """Return the rotation matrix of a unit quaternion (w, x, y, z) by the textbook formula."""
    w, x, y, z = q
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


@pytest.mark.parametrize("angles", [(0, 30, 0), (0, 0, 25), (40, -35, 15), (170, 20, -170)])
def test_boxes_enclose_their_actors_in_any_sensor_orientation(angles: tuple[float, float, float]) -> None:
    """Along the box's axes, every vertex of an actor is within half the box's size of its centre."""
    yaw, pitch, roll = angles
    variant = dataset_plan().variants[0]
    pose = Pose(x=0.5, z=1.5, yaw=yaw, pitch=pitch, roll=roll)
    sensor = variant.rig.sensors[0].model_copy(update={"poses": (pose,)})
    trace, bodies = simulate(variant.scene), actor_bodies(variant.scene)
    source = FrameSource(variant, trace, engines=ENGINES).source
    labels = source.labels(source.observe(sensor, 2), sensor, 2)
    boxes = {r["actor"]: r["tight3d"] for r in labels["objects"]}
    assert len(boxes) == 3
    parts, sensor_from_world = part_transforms(trace, 2), invert(from_pose(pose))
    for row, body in enumerate(bodies):
        place = compose(sensor_from_world, parts[row])
        seen = body.mesh("base").vertices @ place[:, :3].T + place[:, 3]
        box = boxes[body.name]
        within = (seen - box["centre"]) @ turned(box["rotation"])
        assert np.abs(within).max(axis=0) == pytest.approx(np.array(box["size"]) / 2, abs=1e-5)


@given(st.tuples(*[st.floats(-360, 360)] * 3))
def test_quaternions_equal_their_matrices(angles: tuple[float, float, float]) -> None:
    yaw, pitch, roll = angles
    matrix = from_pose(Pose(yaw=yaw, pitch=pitch, roll=roll))
    q = quaternion_of_matrix(matrix[:, :3].tolist())
    assert next(v for v in q if v) > 0
    assert np.abs(turned(list(q)) - matrix[:, :3]).max() < 1e-14
