"""The paper's studies compute the documented measures, on videos and labels of a few pixels."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_runtime.annotate.calibration import Calibration
from recipe_runtime.annotate.records import LabelRecord

from benchmarks.pages import markdown
from benchmarks.paper.defences import Mask, Picture, RunningGaussian, flagged, removal, stabilised, thresholds
from benchmarks.paper.studies import share_in_boxes

SIZE, SIDE = 24, 5  # pixels: size of a frame and of the person


def video(shake: int) -> tuple[list[Picture], list[Mask], list[Mask]]:
    """Return a video in which a white square (the person) passes a wall with a patch of noise and the camera shakes."""
    noise = np.random.Generator(np.random.PCG64(1))
    wall = np.full((SIZE + 8, SIZE + 8, 3), 90, np.uint8)
    wall[8:20, 8:20] = noise.integers(0, 255, (12, 12, 3))
    on_wall = np.zeros(wall.shape[:2], np.bool_)
    on_wall[8:20, 8:20] = True
    pictures: list[Picture] = []
    patches: list[Mask] = []
    targets: list[Mask] = []
    for frame in range(30):
        top, left = 4 + noise.integers(-shake, shake + 1, 2)
        target = np.zeros((SIZE, SIZE), np.bool_)
        if frame >= 18:
            target[18 : 18 + SIDE, 2 * (frame - 18) % 19 :][:, :SIDE] = True
        seen = wall[top : top + SIZE, left : left + SIZE].copy()
        seen[target] = 255
        pictures.append(seen)
        patches.append(on_wall[top : top + SIZE, left : left + SIZE] & ~target)
        targets.append(target)
    return pictures, patches, targets


def test_background_subtraction_removes_a_patch_only_before_a_static_camera() -> None:
    static = removal(*video(0), RunningGaussian(), warmup=18)
    assert static.patch == 1.0 and static.target < 0.3
    assert removal(*video(3), RunningGaussian(rate=0.01), warmup=18).patch < 0.8


@pytest.mark.parametrize(("down", "right"), [(0, 0), (3, -5), (-7, 2)])
def test_a_stabilised_subtractor_sees_frames_that_stand_still(down: int, right: int) -> None:
    """Its model sees the second frame where the first is, and its mask is returned where the second frame is."""
    pytest.importorskip("cv2", reason="OpenCV is not installed (opencv-python-headless)")
    blocks = np.random.Generator(np.random.PCG64(1)).integers(0, 255, (30, 30, 3), dtype=np.uint8)
    wall = blocks.repeat(4, axis=0).repeat(4, axis=1)
    seen: list[Picture] = []

    def dark(picture: Picture) -> Mask:
        seen.append(picture)
        return np.asarray(picture.mean(axis=2) < 100, np.bool_)

    model = stabilised(dark)
    first, second = wall[20:100, 20:100], wall[20 - down : 100 - down, 20 - right : 100 - right]
    masks = [model(np.ascontiguousarray(each)) for each in (first, second)]
    inner = slice(10, 70)
    assert np.abs(seen[0].astype(int) - seen[1])[inner, inner].mean() < 4.0
    expected = np.asarray(second.mean(axis=2) < 100)
    assert (masks[1] == expected)[inner, inner].mean() > 0.97


def test_a_subtractor_that_keeps_everything_removes_nothing() -> None:
    everything = removal(*video(0), lambda picture: np.ones(picture.shape[:2], np.bool_), warmup=0)
    assert (everything.patch, everything.target) == (0.0, 0.0)


def test_thresholds_of_clean_pictures_find_a_patch() -> None:
    """All three statistics detect coloured noise on a grey wall, and nothing on the wall itself."""
    clean = np.full((SIZE, SIZE, 3), 90, np.uint8) + (np.indices((SIZE, SIZE)).sum(axis=0) % 2 * 4)[..., None]
    clean = clean.astype(np.uint8)
    pictures, patches, _ = video(0)
    limits = thresholds([clean], 1.0)
    assert not any(mask.any() for mask in flagged(clean, limits).values())
    for name, mask in flagged(pictures[0], limits).items():
        assert mask[patches[0]].mean() > 0.8, name


@pytest.mark.parametrize(("depth", "inside"), [(10.0, 16), (11.5, 0)])
def test_pixels_are_in_the_box_if_their_depth_is(depth: float, inside: int) -> None:
    """A 2 m cube, 10 m in front of a camera, rotated by 90 degrees about its vertical axis."""
    instances = np.zeros((16, 16), np.uint16)
    instances[6:10, 6:10] = 12001
    half = 0.5**0.5
    box = {"centre": [10.0, 0.0, 0.0], "size": [2.0, 2.0, 2.0], "rotation": [half, 0.0, 0.0, half], "yaw": 90.0}
    label: LabelRecord = {"instance": 12001, "tight3d": box}  # type: ignore[typeddict-item]
    view: Calibration = {"K": [[40.0, 0.0, 8.0], [0.0, 40.0, 8.0], [0.0, 0.0, 1.0]]}  # type: ignore[typeddict-item]
    metres = np.full((16, 16), depth, np.float32)
    assert share_in_boxes(metres, instances, [label], view) == (inside, 16)


def test_a_table_has_one_row_per_measurement() -> None:
    assert markdown([{"a": "1", "b": "x"}, {"a": "2", "b": "y"}]) == "| a | b |\n| --- | --- |\n| 1 | x |\n| 2 | y |"
