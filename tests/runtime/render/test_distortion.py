"""Lens distortion: all modalities use one formula, and annotations describe the distorted image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pycocotools.mask
import pytest
from numpy.typing import NDArray
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan, CameraResponse, Pose
from recipe_runtime.annotate.masks import masks
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.mesh import Body, Pattern, Surface
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.raster.distortion import undistorted_camera
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.renderer import Renderer

from tests.runtime.annotate.validate import problems
from tests.runtime.render.street import EYE, LOOKS, WEATHERS, appearance, box, ground, parts_at, street

WIDE, HIGH, FOV = 200, 150, 80.0
FOCAL = WIDE / 2 / float(np.tan(np.radians(FOV / 2)))
BENDS = [(0.15, 0.0), (0.4, 0.0), (-0.1, 0.0), (0.0, 0.2), (0.3, -0.1)]
AHEAD = from_pose(Pose(z=1.5))


def distorted_camera(k: float, kcube: float) -> CameraPlan:
    return CameraPlan(width=WIDE, height=HIGH, fov=FOV, lens_k=k, lens_kcube=kcube)


def source(x: Any, y: Any, k: float, kcube: float) -> tuple[Any, Any]:
    """Return the undistorted offsets of distorted ones (from the centre, in pixels), by the documented formula."""
    r = np.hypot(x, y) / (WIDE / 2)
    f = 1.0 + k * r**2 + kcube * r**3
    return x * f, y * f


def offsets() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    y, x = np.mgrid[0:HIGH, 0:WIDE]
    return x + 0.5 - WIDE / 2, y + 0.5 - HIGH / 2


@pytest.fixture(scope="module")
def wall() -> Renderer:
    """Return a wall 10 m ahead, another in front of its left half, and level ground."""
    far = box([10.0, -200.0, -100.0], [11.0, 200.0, 200.0], Surface("wall", Pattern.PLAIN, 3))
    near = box([9.99, 3.0, -100.0], [10.5, 200.0, 200.0], Surface("pane", Pattern.PLAIN, 26))
    floor = ground(300.0, Surface("asphalt", Pattern.PLAIN, 1))
    return Renderer([Body("floor", 0, (("b", floor),)), Body("far", 0, (("b", far),)), Body("near", 0, (("b", near),))])


def observe(renderer: Renderer, k: float, kcube: float, pose: Array = AHEAD, parts: Array | None = None) -> Observation:
    return renderer.observe(distorted_camera(k, kcube), pose, np.zeros((0, 3, 4)) if parts is None else parts)


@pytest.mark.parametrize("k, kcube", BENDS)
def test_a_straight_edge_is_distorted_by_the_formula(wall: Renderer, k: float, kcube: float) -> None:
    """The edge at y = 3 m of a wall 9.99 m away is a column without distortion; its distorted place is by bisection."""
    semantic = observe(wall, k, kcube).semantic
    column = -3.0 / 9.99 * FOCAL
    checked = 0
    for row in range(0, HIGH, 5):
        y = row + 0.5 - HIGH / 2
        low, high = -WIDE / 2.0, 0.0
        for _ in range(50):
            x = (low + high) / 2.0
            low, high = (x, high) if source(x, y, k, kcube)[0] < column else (low, x)
        is_near = semantic[row] == 26
        if is_near.any() and semantic[row, np.flatnonzero(is_near).max() + 1] == 3:  # and no ground in between
            assert abs(np.flatnonzero(is_near).max() + 1.0 - (low + WIDE / 2)) <= 0.75
            checked += 1
    assert checked > 8


@pytest.mark.parametrize("k, kcube", BENDS)
def test_depth_is_along_the_optical_axis_at_the_distorted_place(wall: Renderer, k: float, kcube: float) -> None:
    seen = observe(wall, k, kcube)
    assert np.abs(seen.depth[seen.semantic == 3] - 10.0).max() < 1e-4
    _, down = source(*offsets(), k, kcube)
    floor = (seen.semantic == 1) & (down > 12)
    assert floor.sum() > 1000
    # The nearest sample of an undistorted image twice as fine is at most a quarter of a pixel above or below.
    near, far = 1.5 * FOCAL / (down[floor] + 0.27), 1.5 * FOCAL / (down[floor] - 0.27)
    assert (seen.depth[floor] > near - 1e-3).all() and (seen.depth[floor] < far + 1e-3).all()


@pytest.mark.parametrize("k, kcube", BENDS)
def test_colour_is_distorted_like_labels(k: float, kcube: float) -> None:
    """Red pixels of a plain red walker equal the mask, except at its edge."""
    renderer = Renderer(street())
    seen = observe(renderer, k, kcube, EYE, parts_at())
    plan = WEATHERS["foggy"].model_copy(update={"responses": {"street": CameraResponse(noise=0.0)}})
    plan = plan.model_copy(update={"weather": appearance().weather})
    picture = renderer.shade(seen, plan, "street", 0, 0.0).astype(int)
    red = (
        (picture[..., 0] > 60) & (picture[..., 1] < 0.55 * picture[..., 0]) & (picture[..., 2] < 0.55 * picture[..., 0])
    )
    mask = seen.instance == 12001
    inner = mask & np.roll(mask, 1, 0) & np.roll(mask, -1, 0) & np.roll(mask, 1, 1) & np.roll(mask, -1, 1)
    assert inner.sum() > 60
    assert red[inner].mean() > 0.98
    wider = mask | np.roll(mask, 2, 1) | np.roll(mask, -2, 1) | np.roll(mask, 2, 0) | np.roll(mask, -2, 0)
    ring = wider & ~mask & ~np.roll(mask, 1, 1) & ~np.roll(mask, -1, 1) & ~np.roll(mask, 1, 0) & ~np.roll(mask, -1, 0)
    assert red[ring].mean() < 0.25  # (bricks behind)


@pytest.mark.parametrize("k, kcube", BENDS)
def test_boxes_and_extents_are_of_the_distorted_image(k: float, kcube: float) -> None:
    renderer = Renderer(street())
    for frame in (0, 8, 14):
        seen = observe(renderer, k, kcube, EYE, parts_at(frame))
        found = {mask.instance: mask for mask in masks(seen.instance)}
        assert found
        for view in seen.objects:
            assert view.amodal >= view.visible
            if view.visible:
                mask = found[view.instance]
                code = {"size": [HIGH, WIDE], "counts": mask.counts.encode()}
                x, y, w, h = (int(v) for v in pycocotools.mask.toBbox(code))
                assert view.box == (x, y, x + w, y + h) and view.visible == int(pycocotools.mask.area(code))
                a = view.amodal_box
                assert a[0] <= x and a[1] <= y and x + w <= a[2] and y + h <= a[3]
            inside = min(view.projected[:2]) > 0 and view.projected[2] < WIDE
            if inside and view.projected[3] < HIGH:
                assert np.abs(np.array(view.projected) - view.amodal_box).max() < 1.3


def test_the_undistorted_camera_of_a_pinhole_is_the_pinhole() -> None:
    camera = CameraPlan(width=WIDE, height=HIGH, fov=FOV)
    assert undistorted_camera(camera) is camera
    assert (
        undistorted_camera(camera, 2).width,
        undistorted_camera(camera, 2).height,
        undistorted_camera(camera, 2).fov,
    ) == (2 * WIDE, 2 * HIGH, FOV)


@pytest.mark.parametrize("k, kcube", BENDS)
def test_the_undistorted_image_covers_the_distorted_one(k: float, kcube: float) -> None:
    camera = distorted_camera(k, kcube)
    width, height, fine = optics.undistorted_size(camera, 1)
    x, y = source(*offsets(), k, kcube)
    assert np.abs(x).max() * fine < width / 2 and np.abs(y).max() * fine < height / 2
    undistorted = undistorted_camera(camera)
    focal = undistorted.width / 2 / np.tan(np.radians(undistorted.fov / 2))
    assert focal == pytest.approx(fine * FOCAL, rel=1e-6)


BENT = """
recipe: bent
seed: 3
base:
  clock: {fps: 10, frames: 2}
  town: {name: downtown, blocks: [1, 1], seed: 3}
  actors:
    car: {blueprint: vehicle.hatchback.*, start: {x: -1.5, y: 0, yaw: -90}, speed: 0}
    walker: {blueprint: walker.pedestrian.*, start: {x: -4.4, y: 3}, goal: {x: -4.4, y: -9}, speed: 1.5}
  sensors:
    street:
      mount: {x: -6, y: 8, z: 1.7, yaw: -65, pitch: 4}
      camera: {width: 160, height: 120, fov: 80, lens_k: 0.3, supersample: 2, motion_blur_intensity: 1}
      capture: [rgb, depth, instance, semantic]
output: {annotations: [kwcoco, coco]}
"""


@pytest.mark.slow
def test_a_dataset_with_distortion_passes_verification(tmp_path: Path) -> None:
    (tmp_path / "bent.yaml").write_text(BENT)
    build(compile_recipe(tmp_path / "bent.yaml").plan, tmp_path / "out", BuildOptions(workers=0))
    found = [problems(path, tmp_path / "out") for path in sorted((tmp_path / "out").rglob("coco/*.json"))]
    assert found and not any(found)
    assert problems(tmp_path / "out" / "annotations" / "kwcoco.json") == []


@pytest.mark.slow
def test_reuse_does_not_change_a_distorted_frame() -> None:
    """A distorted frame rendered alone equals the frame of a sequence with temporal reuse."""
    running, plan = Renderer(street()), appearance(looks=LOOKS)
    for frame in range(3):
        seen = observe(running, 0.3, 0.0, EYE, parts_at(frame))
        last = running.shade(seen, plan, "street", frame, frame / 30)
    alone = Renderer(street(), reuse=NO_REUSE)
    again = alone.shade(observe(alone, 0.3, 0.0, EYE, parts_at(2)), plan, "street", 2, 2 / 30)
    assert last.tobytes() == again.tobytes()
