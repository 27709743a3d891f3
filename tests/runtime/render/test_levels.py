"""Levels of detail: versions of an object that are shown by its size in the picture."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.optics import focal_length
from recipe_compiler.ir.plan import CameraPlan, CameraResponse, Pose
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.builder import Builder, icosphere
from recipe_runtime.meshes.mesh import REFERENCE_FOCAL, Body, Mesh
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.raster.observation import FrameLabels
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import CAMERA, CLOTH, EYE, LOOKS, ROAD, appearance, ground

LIMIT = 10.0  # metres for this camera
_RATIO = focal_length(CAMERA) / REFERENCE_FOCAL
_ANCHOR = (0.0, 0.0, 0.8)
SUNNY = appearance(40.0, 200.0, LOOKS)
VERSIONS = ("near", "far")


def version(b: Builder, name: str) -> None:
    """Add a ball of many chunks for the near version, a box that is smaller and of another shape for the far one."""
    if name == "near":
        points, triangles = icosphere(3)
        b.smooth(CLOTH, points * 0.7 + np.array(_ANCHOR), triangles, 0.5)
    else:
        b.box(CLOTH, (-0.4, -0.3, 0.2), (0.4, 0.3, 1.4))


def alone(name: str) -> Mesh:
    b = Builder()
    version(b, name)
    return b.mesh()


def both(transform: Array | None = None) -> Mesh:
    b = Builder()
    with b.level(far=LIMIT / _RATIO, anchor=_ANCHOR, casts=False):
        version(b, "near")
    with b.level(near=LIMIT / _RATIO, anchor=_ANCHOR, casts=True):
        version(b, "far")
    return b.mesh(transform)


def scene(mesh: Mesh, *, moves: bool = True) -> list[Body]:
    body = Body("hero", 12001 if moves else 0, (("base", mesh),))
    return [Body("road", 0, (("base", ground(60, ROAD)),)), body]


def pose_at(frame: int) -> Array:
    """Return the pose of an object that crosses the limit twice."""
    return from_pose(Pose(x=9.6 + 0.13 * (frame if frame < 8 else 16 - frame), y=-1.0 + 0.05 * frame, yaw=9 * frame))


def shown(pose: Array) -> str:
    """Return the version that the camera must show, by the definition of the limits."""
    anchor = pose[:, :3] @ np.array(_ANCHOR) + pose[:, 3]
    return VERSIONS[math.dist(anchor, EYE[:, 3]) >= LIMIT]


def same_labels(a: FrameLabels, b: FrameLabels) -> bool:
    arrays = all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("depth", "instance", "semantic"))
    return arrays and a.objects == b.objects


def test_an_object_looks_like_one_of_its_versions_also_from_a_camera_that_reuses_frames() -> None:
    """At both sides of the limit: labels, boxes and pixels equal those of a scene with that version only."""
    renderer, forgetting = Renderer(scene(both())), Renderer(scene(both()), reuse=NO_REUSE)
    single = {name: Renderer(scene(alone(name)), reuse=NO_REUSE) for name in VERSIONS}
    names = []
    for frame in range(17):
        pose = pose_at(frame)
        names.append(shown(pose))
        seen, full, expected = (r.observe(CAMERA, EYE, pose[None]) for r in (renderer, forgetting, single[names[-1]]))
        assert same_labels(seen, expected) and same_labels(full, expected)
        kept, drawn = (r.shade(s, SUNNY, "street", frame, 0.0) for r, s in ((renderer, seen), (forgetting, full)))
        assert np.array_equal(kept, drawn)
    assert names[0] == names[-1] == "near" and "far" in names


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_a_recorded_frame_shows_the_same_versions(device: str) -> None:
    poses = np.stack([pose_at(frame) for frame in (0, 4, 7, 8)])
    parts = poses[:, None]
    renderer = Renderer(scene(both()))
    stream = Renderer(scene(both()), device).frame_stream(CAMERA, "street", [SUNNY], in_flight=1)
    batch = FrameBatch(range(4), [0.0] * 4, np.stack([EYE] * 4), parts)
    for number, frame in enumerate(stream.frames(batch)):
        seen = renderer.observe(CAMERA, EYE, parts[number])
        assert same_labels(frame.observation, seen)
        assert np.array_equal(frame.pictures[0], renderer.shade(seen, SUNNY, "street", number, 0.0))


@pytest.mark.parametrize("x", [6.0, 14.0])
def test_an_element_of_a_town_has_levels_about_its_own_anchor(x: float) -> None:
    at = from_pose(Pose(x=x, y=-1.0, yaw=30))
    (name,) = {shown(at)}
    b = Builder()
    version(b, name)
    none = np.zeros((0, 3, 4))
    for _ in range(3):
        seen, expected = (
            Renderer(scene(mesh, moves=False)).observe(CAMERA, EYE, none) for mesh in (both(at), b.mesh(at))
        )
        assert same_labels(seen, expected)


def covered(renderer: Renderer, camera: CameraPlan, pose: Array, response: CameraResponse) -> NDArray[np.bool_]:
    """Return the pixels that a red light at the object's place, not the road, colours."""
    look = {"road": {"asphalt": "#000000"}, "hero": {"shirt": "#ff0000"}}
    plan = appearance(60.0, 200.0, look).model_copy(update={"responses": {"street": response}})
    picture = renderer.shade(renderer.observe(camera, EYE, pose[None]), plan, "street", 0, 0.0).astype(int)
    hot: NDArray[np.bool_] = picture[..., 0] > picture[..., 2] + 60
    return hot


@pytest.mark.parametrize("lens", [{}, {"lens_k": 0.1}])
def test_pictures_show_the_version_of_the_labels_also_with_more_samples_and_a_lens(lens: dict[str, float]) -> None:
    """The undistorted image has a longer focal length, which alone would show the near version."""
    camera = CAMERA.model_copy(update=lens)
    pose = from_pose(Pose(x=11.0, y=-1.0))
    assert shown(pose) == "far"
    response = CameraResponse(supersample=2, noise=0.0)
    one, other = Renderer(scene(both())), Renderer(scene(alone("far")))
    red = covered(one, camera, pose, response)
    assert red.sum() > 20
    assert np.array_equal(red, covered(other, camera, pose, response))
    labels = one.observe(camera, EYE, pose[None])
    assert abs(int(red.sum()) - int((labels.instance == 12001).sum())) < 12


def test_a_version_that_casts_does_so_at_all_distances() -> None:
    """The shadow of a version that is not shown, on the road beside the object."""
    b = Builder()
    with b.level(far=1.0, anchor=_ANCHOR):
        version(b, "near")
    unseen, gone = Renderer(scene(b.mesh())), Renderer(scene(alone("far")))
    pose = from_pose(Pose(x=6.0, y=-1.0))[None]
    seen = unseen.observe(CAMERA, EYE, pose)
    assert not seen.objects and (seen.instance == 0).all()
    dark = unseen.shade(seen, SUNNY, "street", 0, 0.0).astype(int)
    bright = gone.shade(gone.observe(CAMERA, EYE, from_pose(Pose(x=-30.0))[None]), SUNNY, "street", 0, 0.0).astype(int)
    assert ((bright - dark).max(axis=-1) > 25).sum() > 20
