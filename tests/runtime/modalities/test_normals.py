"""Normals agree with the geometry by other ways: the slope of depth, and a ball's own centre."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_runtime.core.transforms import Array, from_pose, invert
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.modalities import declared, label_array, label_passes
from recipe_runtime.modalities.reading import stored_array
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import BRICKS, PAINT, ROAD, ball, box, ground

PINHOLE = CameraPlan(width=320, height=240, fov=80)
LENS = CameraPlan(width=320, height=240, fov=80, lens_k=0.3)
POSE = from_pose(Pose(x=-9.0, y=1.0, z=3.0, yaw=-5.0, pitch=12.0, roll=8.0))
CENTRE = np.array([4.0, 3.0, 2.0])
TURNED = from_pose(Pose(x=2.0, y=-2.0, z=0.0, yaw=35.0, pitch=20.0, roll=-15.0))


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    """Return a scene of ground, a ball and a moving box that is turned about all axes."""
    still = Body("town", 0, (("g", ground(40.0, ROAD)), ("b", ball(1.8, BRICKS, 48, CENTRE.tolist()))))
    return Renderer([still, Body("box", 14_001, (("base", box((-1, -1, 0), (1, 1, 2), PAINT)),))])


def seen_by(renderer: Renderer, camera: CameraPlan) -> tuple[NDArray[np.float64], ...]:
    """Return normals, points in the optical frame, and instances of a view."""
    seen = renderer.observe(camera, POSE, TURNED[None])
    normals = label_array(seen, "normals").astype(float)
    half = camera.width / 2.0
    x, y = np.meshgrid(np.arange(camera.width) + 0.5 - half, np.arange(camera.height) + 0.5 - camera.height / 2.0)
    straight = optics.focal_length(camera) / optics.factor(camera, np.hypot(x, y) / half)
    depth = seen.depth.astype(float)
    points = np.stack([x / straight * depth, y / straight * depth, depth], axis=-1)
    return normals, points, seen.instance.astype(float), depth


def in_view(points: Array) -> Array:
    """Return points of the world in the optical frame."""
    there = invert(POSE)
    x, y, z = (there[n, :3] @ points + there[n, 3] for n in range(3))
    return np.array([-y, -z, x])


@pytest.mark.parametrize("camera", [PINHOLE, LENS], ids=["pinhole", "lens"])
def test_normals_are_unit_vectors_that_face_the_camera(renderer: Renderer, camera: CameraPlan) -> None:
    normals, points, _, depth = seen_by(renderer, camera)
    sky = depth >= camera.far
    assert 0.1 < sky.mean() < 0.9
    assert (normals[sky] == 0.0).all()
    assert np.abs((normals[~sky] ** 2).sum(-1) - 1.0).max() < 1e-6
    assert ((normals * points).sum(-1)[~sky] < 0.0).mean() > 0.99  # not at the outline of the ball


def test_normals_of_planes_are_those_of_the_slope_of_depth(renderer: Renderer) -> None:
    """Of the ground and of a box that is turned about all axes, by differences of neighbouring points."""
    normals, points, instance, depth = seen_by(renderer, PINHOLE)
    across, down = np.zeros_like(points), np.zeros_like(points)
    across[:, 1:-1], down[1:-1] = points[:, 2:] - points[:, :-2], points[2:] - points[:-2]
    slope = np.cross(down, across)
    slope /= np.maximum(np.sqrt((slope * slope).sum(-1)), 1e-12)[..., None]
    compared = np.zeros(depth.shape, bool)
    compared[1:-1, 1:-1] = True
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):  # all neighbours have this normal
        compared &= (np.abs(np.roll(normals, (dy, dx), (0, 1)) - normals) < 1e-6).all(-1) & (depth < 30.0)
    assert compared[instance > 0].sum() > 1000 and compared[instance == 0].sum() > 10_000
    assert len(np.unique(normals[compared].round(3), axis=0)) >= 4  # ground, and three sides of the box
    errors = (slope * normals).sum(-1)[compared]
    assert np.quantile(errors, 0.001) > 0.9999  # beside an edge between parallel planes, the slope is another


@pytest.mark.parametrize("camera", [PINHOLE, LENS], ids=["pinhole", "lens"])
def test_normals_of_a_ball_lead_from_its_centre(renderer: Renderer, camera: CameraPlan) -> None:
    """They are smooth: a facet of this ball is 3.75 degrees wide."""
    normals, points, _, _ = seen_by(renderer, camera)
    outward = points - in_view(CENTRE)
    distance = np.sqrt((outward * outward).sum(-1))
    on_ball = np.abs(distance - 1.8) < 0.01
    cosine = (normals * outward).sum(-1)[on_ball] / distance[on_ball]
    inner = (normals * points).sum(-1)[on_ball] < -0.4 * np.sqrt((points * points).sum(-1))[on_ball]
    assert inner.sum() > 500
    assert np.degrees(np.arccos(np.minimum(cosine[inner], 1.0))).max() < (0.7 if camera is PINHOLE else 1.5)


def test_normals_of_a_stream_are_equal(renderer: Renderer) -> None:
    batch = FrameBatch([0], [0.0], POSE[None], TURNED[None, None])
    stream = renderer.frame_stream(PINHOLE, "street", [], 2, label_passes=label_passes(["depth", "normals"]))
    (made,) = stream.frames(batch)
    expected = label_array(renderer.observe(PINHOLE, POSE, TURNED[None]), "normals")
    np.testing.assert_array_equal(label_array(made.observation, "normals"), expected)


def test_a_plain_decoder_reads_the_png() -> None:
    """By the PNG specification and the formula of the documentation."""
    normals = np.zeros((5, 7, 3), np.float32)
    normals[1:3, 2:6] = (0.6, 0.0, -0.8)
    normals[3, 3] = (-1.0, 0.0, 0.0)
    body = declared("normals").encoded(normals, "png")
    width, height, depth, kind = struct.unpack_from(">IIBB", body, 16)
    assert (width, height, depth, kind) == (7, 5, 16, 2)
    size = struct.unpack_from(">I", body, 33)[0]
    rows = zlib.decompress(body[41 : 41 + size])
    above, codes = bytes(42), []
    for row in (rows[43 * n : 43 * n + 43] for n in range(5)):
        assert row[0] == 2  # the difference from the row above
        above = bytes((a + b) % 256 for a, b in zip(above, row[1:], strict=True))
        codes.append(struct.unpack(">21H", above))
    read = np.array(codes, float).reshape(5, 7, 3)
    assert np.array_equal(read, np.rint((normals.astype(float) + 1.0) / 2.0 * 65535.0))
    assert read[0, 0].tolist() == [32768.0] * 3
    assert np.array_equal(stored_array(body, "png"), read)


def test_the_picture_has_the_usual_colours() -> None:
    """A wall that faces the camera is light blue, ground is green, the sky is black."""
    shown = declared("normals").picture(np.array([[[0, 0, -1], [0, -1, 0], [1, 0, 0], [0, 0, 0]]], np.float32))
    assert shown.tolist() == [[[128, 128, 255], [128, 255, 128], [255, 128, 128], [0, 0, 0]]]
