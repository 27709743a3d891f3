"""3-D boxes and calibration of kwcoco.json agree with the pictures, without any other file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.compile import compile_recipe
from recipe_runtime.build.pipeline import BuildOptions, build

pytestmark = pytest.mark.slow

Floats = NDArray[np.float64]
Row = dict[str, Any]

# Two sedans of one blueprint, one parked and one driving, a cyclist and a person, each seen from two opposite sides by
# cameras that move with it.
RECIPE = """
recipe: truth
seed: 5
base:
  clock: {fps: 10, frames: 2, warmup: 2}
  town: {name: downtown, blocks: [1, 1], seed: 3}
  weather: ClearNoon
  actors:
    driving: {blueprint: vehicle.sedan.a, start: {x: 1.5, y: -16, yaw: 90}, route: [{x: 1.5, y: 30}], speed: 6}
    parked: {blueprint: vehicle.sedan.a, start: {x: -1.6, y: 16, yaw: -90}, speed: 0}
    bike: {blueprint: vehicle.bicycle.a, start: {x: 1.5, y: 8, yaw: 90}, route: [{x: 1.5, y: 30}], speed: 4}
    walker: {blueprint: walker.pedestrian.0003, start: {x: -4.6, y: 2, yaw: -90}, goal: {x: -4.6, y: -8}, speed: 1.5}
    runner: {blueprint: walker.pedestrian.0002, start: {x: 4.4, y: -6, yaw: 90}, goal: {x: 4.4, y: 12}, speed: 3.5}
  sensors:
"""
VIEWS = {  # distance of the two cameras, height, field of view
    "driving": (4.3, 1.9, 75),
    "parked": (4.3, 1.9, 75),
    "bike": (2.2, 2.6, 70),
    "walker": (1.7, 2.2, 75),
    "runner": (1.7, 2.2, 75),
}
CARS = ("driving", "parked")
OUTSIDE = 0.004  # metres: 1/3 pixel, the error of resampling a distorted picture
SPARE = {"driving": 0.02, "parked": 0.02, "bike": 0.05, "walker": 0.05, "runner": 0.05}  # metres


def recipe_text() -> str:
    lines = [RECIPE]
    for actor, (away, height, fov) in VIEWS.items():
        pitch = 14 if away > 3 else 38
        for side, x, y, yaw in (("front", away, 0.75 * away, -143), ("rear", -away, -0.75 * away, 37)):
            lens = ", lens_k: 0.1, lens_kcube: 0.03" if side == "rear" else ""
            mount = f"{{on: {actor}, x: {x}, y: {y}, z: {height}, yaw: {yaw}, pitch: {pitch}}}"
            lines.append(
                f"    {actor}_{side}: {{mount: {mount}, camera: {{width: 640, height: 480, fov: {fov}{lens}}}, "
                "capture: [depth, instance]}\n"
            )
    return "".join([*lines, "output: {annotations: [kwcoco]}\n"])


@dataclass(frozen=True)
class Picture:
    """One image of kwcoco.json with its pictures."""

    row: Row
    annotations: dict[str, Row]  # by actor
    folder: Path

    @cached_property
    def depth(self) -> Floats:
        pixels = np.asarray(Image.open(self._file("depth"))).astype(np.float64)
        return 1000.0 * (pixels[..., 0] + 256.0 * pixels[..., 1] + 65536.0 * pixels[..., 2]) / (256.0**3 - 1.0)

    @cached_property
    def instance(self) -> NDArray[np.int64]:
        return np.asarray(Image.open(self._file("instance"))).astype(np.int64)

    def _file(self, modality: str) -> Path:
        (name,) = (asset["file_name"] for asset in self.row["assets"] if asset["modality"] == modality)
        return self.folder / str(name)

    def pinhole(self, pixels: Floats) -> Floats:
        """Return the undistorted pixel coordinates of distorted ones [N, 2]."""
        k, lens = np.array(self.row["calibration"]["K"]), self.row["calibration"]["distortion"]
        centre, half = k[:2, 2], self.row["width"] / 2.0
        offset = (pixels - centre) / half
        r = np.sqrt((offset * offset).sum(axis=1, keepdims=True))
        undistorted: Floats = centre + half * offset * (1.0 + lens["lens_k"] * r**2 + lens["lens_kcube"] * r**3)
        return undistorted

    def points(self, actor: str) -> tuple[Floats, Floats]:
        """Return an actor's visible pixels: undistorted coordinates [N, 2] and world points [N, 3]."""
        ys, xs = np.nonzero(self.instance == self.annotations[actor]["instance"])
        pixels = self.pinhole(np.stack([xs + 0.5, ys + 0.5], axis=1))
        k, depth = np.array(self.row["calibration"]["K"]), self.depth[ys, xs][:, None]
        rays = np.concatenate([(pixels - k[:2, 2]) / k[[0, 1], [0, 1]], np.ones((len(xs), 1))], axis=1)
        pose = np.array(self.row["calibration"]["camera_to_world"])
        return pixels, (rays * depth) @ pose[:3, :3].T + pose[:3, 3]

    def project(self, points: Floats) -> Floats:
        """Return the undistorted pixel coordinates of world points [N, 3]."""
        pose, k = np.array(self.row["calibration"]["world_to_camera"]), np.array(self.row["calibration"]["K"])
        seen = points @ pose[:3, :3].T + pose[:3, 3]
        assert (seen[:, 2] > 0.0).all()
        pixels: Floats = (seen / seen[:, 2:]) @ k[:2].T
        return pixels


def rotation(box: Row) -> Floats:
    w, x, y, z = box["rotation"]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def corners(box: Row) -> Floats:
    signs = np.array(list(product((-0.5, 0.5), repeat=3)))
    placed: Floats = (signs * box["size"]) @ rotation(box).T + box["centre"]
    return placed


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> list[Picture]:
    folder = tmp_path_factory.mktemp("truth")
    (folder / "recipe.yaml").write_text(recipe_text())
    made = build(compile_recipe(folder / "recipe.yaml").plan, folder / "truth", BuildOptions(workers=0)).path
    data = json.loads((made / "annotations/kwcoco.json").read_text())
    found = []
    for row in data["images"]:
        mine = [a for a in data["annotations"] if a["image_id"] == row["id"]]
        found.append(Picture(row, {a["actor"]: a for a in mine}, made / "annotations"))
    return found


def of(pictures: list[Picture], actor: str, frame: int = 1) -> list[Picture]:
    """Return the two pictures of an actor at a frame."""
    found = [p for p in pictures if p.row["frame_index"] == frame and f"/{actor}_" in p.row["name"]]
    assert len(found) == 2
    return found


@pytest.mark.parametrize("actor", SPARE)
def test_pixels_lie_in_the_box_and_reach_its_sides(pictures: list[Picture], actor: str) -> None:
    """Back-projected pixels of two opposite cameras: cars in their body box, others in the tight box of the frame."""
    key = "box3d_world" if actor in CARS else "tight3d_world"
    pair = of(pictures, actor)
    boxes = [picture.annotations[actor][key] for picture in pair]
    assert boxes[0] == boxes[1]
    box = boxes[0]
    points = np.concatenate([picture.points(actor)[1] for picture in pair])
    within = (points - box["centre"]) @ rotation(box)
    spare = np.concatenate(
        [np.array(box["size"]) / 2 + within.min(axis=0), np.array(box["size"]) / 2 - within.max(axis=0)]
    )
    assert (spare > -OUTSIDE).all(), spare
    assert (spare < SPARE[actor]).all(), spare


@pytest.mark.parametrize("actor", SPARE)
def test_boxes_hold_the_mask_in_the_picture(pictures: list[Picture], actor: str) -> None:
    """Visible pixels of an undistorted picture lie in the projected tight box, the amodal mask within its bounds."""
    for frame in (0, 1):
        front = of(pictures, actor, frame)[0]
        label = front.annotations[actor]
        pixels, _ = front.points(actor)
        keys = ["tight3d_world", *(["box3d_world"] if actor in CARS else [])]
        for key in keys:
            outline = front.project(corners(label[key]))
            assert outside(outline, pixels) < 0.5
            x, y, width, height = label["amodal_bbox"]
            low, high = outline.min(axis=0), outline.max(axis=0)
            assert (low < (x + 0.5, y + 0.5)).all() and (high > (x + width - 0.5, y + height - 0.5)).all()


def outside(outline: Floats, pixels: Floats) -> float:
    """Return the largest distance of points from the convex hull of others, in pixels."""
    worst = -np.inf
    for first, second in permutations(range(len(outline)), 2):
        along = outline[second] - outline[first]
        normal = np.array([along[1], -along[0]]) / np.hypot(*along)
        if ((outline - outline[first]) @ normal < 1e-9).all():  # the outward normal of an edge of the hull
            worst = max(worst, float(((pixels - outline[first]) @ normal).max()))
    return worst


def test_a_blueprint_has_one_body_box_on_the_ground(pictures: list[Picture]) -> None:
    """Regression: the box of a driving sedan was 1.60 m high and 13 cm in the road, that of a parked one 1.47 m."""
    driving, parked = (of(pictures, actor)[0].annotations[actor]["box3d_world"] for actor in ("driving", "parked"))
    assert driving["size"] == parked["size"]
    for actor in SPARE:
        boxes = [p.annotations[actor]["box3d_world"] for k in (0, 1) for p in of(pictures, actor, k)]
        assert len({tuple(box["size"]) for box in boxes}) == 1
        for k in (0, 1):
            picture = of(pictures, actor, k)[0]
            lowest = picture.annotations[actor]["tight3d_world"]
            bottom = corners(picture.annotations[actor]["box3d_world"])[:, 2].min()
            assert bottom == pytest.approx(corners(lowest)[:, 2].min(), abs=0.01)


def test_frames_of_reference_agree(pictures: list[Picture]) -> None:
    """The calibration transforms the box of the sensor's frame (x forward, y left, z up) to the world's box."""
    optical = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # sensor from camera
    for picture in pictures:
        pose = np.array(picture.row["calibration"]["world_to_camera"])
        assert np.allclose(pose @ picture.row["calibration"]["camera_to_world"], np.eye(4), atol=1e-4)
        assert picture.row["timestamp"] == picture.row["frame_index"] / 10
        for label in picture.annotations.values():
            for key in ("box3d", "tight3d"):
                world = corners(label[f"{key}_world"]) @ pose[:3, :3].T + pose[:3, 3]
                assert np.allclose(world @ optical.T, corners(label[key]), atol=1e-4)
