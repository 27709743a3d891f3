"""Skins: continuous surfaces that follow several parts, compared with meshes whose vertices NumPy has moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.patches import PatchFace
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_runtime.body.kinematics import Quaternion, axis_rotation, forward_kinematics
from recipe_runtime.body.skeleton import Joint
from recipe_runtime.core.transforms import Array, from_pose, invert, rigid_transform
from recipe_runtime.meshes.builder import Builder, tube
from recipe_runtime.meshes.mesh import NO_MESH, Body, Mesh
from recipe_runtime.meshes.skin import FULL, BodyVertices, Influences, skin_of, split_parts
from recipe_runtime.modalities import label_passes
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import CLOTH, LOOKS, ROAD, appearance, ground, street
from tests.runtime.render.test_patches import of_colour, patch

JOINTS = (Joint("middle", "lower", (0.0, 0.0, 0.6)), Joint("upper", "middle", (0.0, 0.0, 0.6)))
NAMES = ("lower", "middle", "upper")
CAMERA = CameraPlan(width=160, height=120, fov=60)
EYE = from_pose(Pose(x=-4.0, z=1.2))
_RINGS, _SIDES = 37, 24


def column() -> Mesh:
    """Return a column of three parts, 1.8 m high, whose weights change gradually along it."""
    heights = [1.8 * k / (_RINGS - 1) for k in range(_RINGS)]
    points = tube([(0.0, 0.0, z) for z in heights], [0.2] * _RINGS, _SIDES)
    z = points[..., 2].reshape(-1)
    upper = np.clip((z - 1.05) / 0.3, 0.0, 1.0)
    middle = np.clip((z - 0.45) / 0.3, 0.0, 1.0) - upper
    weights = np.stack([1.0 - middle - upper, middle, upper], axis=1)
    b = Builder()
    b.grid(CLOTH, points, caps=(CLOTH, CLOTH), influences=Influences(np.tile([0, 1, 2], (len(z), 1)), weights))
    return b.mesh(joints=JOINTS)


COLUMN = column()
SUBJECT = Body("hero", 12001, (("lower", COLUMN), ("middle", NO_MESH), ("upper", NO_MESH)))


def pose(x: float = 0.0, bends: tuple[float, float] = (0.0, 0.0), turn: float = 0.0) -> Array:
    """Return the transforms of the three parts, [3, 3, 4]."""
    rotations: list[Quaternion] = [axis_rotation("y", bends[0]), axis_rotation("x", bends[1])]
    placed = forward_kinematics(((x, 0.0, 0.0), axis_rotation("z", turn)), JOINTS, rotations)
    return np.stack([rigid_transform(*one) for one in placed])


def moved(mesh: Mesh, parts: Array) -> Mesh:
    """Return the skin as a rigid mesh in the world, by the definition of linear blend skinning."""
    assert mesh.skin is not None
    vertices, normals = np.zeros(mesh.vertices.shape), np.zeros(mesh.normals.shape)
    for vertex in range(len(vertices)):
        for part, weight in zip(mesh.skin.parts[vertex], mesh.skin.weights[vertex] / 255.0, strict=True):
            t = parts[part]
            vertices[vertex] += weight * (t[:, :3] @ (mesh.vertices[vertex] - mesh.skin.origins[part]) + t[:, 3])
            normals[vertex] += weight * (t[:, :3] @ mesh.normals[vertex])
    normals /= np.sqrt((normals**2).sum(axis=1))[:, None]
    return replace(mesh, skin=None, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32))


def rigid(parts: Array) -> Body:
    return Body("hero", 12001, (("base", moved(COLUMN, parts)),))


HERE = from_pose(Pose())[None]
POSES = [pose(), pose(bends=(80.0, 0.0)), pose(0.3, (-60.0, 70.0), 40.0), pose(0.0, (110.0, -100.0), -120.0)]


def test_weights_are_whole_255ths_of_the_given_ones() -> None:
    rng = np.random.default_rng(3)
    weights = rng.random((200, 3)) * 7.0
    skin = skin_of(Influences(np.tile([2, 0, 1], (200, 1)), weights), JOINTS)
    assert (skin.weights.astype(int).sum(axis=1) == FULL).all()
    assert (np.diff(skin.weights.astype(int), axis=1) <= 0).all()
    shares = weights / weights.sum(axis=1, keepdims=True)
    for part, column_of in ((2, 0), (0, 1), (1, 2)):
        found = np.where(skin.parts == part, skin.weights, 0).max(axis=1) / 255.0
        assert np.abs(found - shares[:, column_of]).max() < 1 / 255


@pytest.mark.parametrize("parts", POSES, ids=["rest", "bent", "twisted", "folded"])
def test_a_skin_is_drawn_where_its_weights_place_it(parts: Array) -> None:
    """Depth, masks, boxes and normals equal those of the moved mesh, except where rounding decides."""
    a = Renderer([SUBJECT]).observe(CAMERA, EYE, parts)
    b = Renderer([rigid(parts)]).observe(CAMERA, EYE, HERE)
    assert (a.instance != b.instance).sum() <= 3
    inside = (a.instance == 12001) & (b.instance == 12001)
    assert inside.sum() > 400
    near = np.abs(a.depth[inside] - b.depth[inside]) < 1e-3
    assert near.mean() > 0.998
    (one,), (other,) = a.objects, b.objects
    assert np.abs(np.subtract(one.projected, other.projected)).max() <= 1 / 64
    (normals,) = label_passes(["normals"])
    turned, expected = a.drawn(normals)[inside], b.drawn(normals)[inside]
    assert (np.abs(turned - expected).max(axis=1) < 0.05).mean() > 0.99  # interpolated before they are normalised


def test_no_part_of_a_skin_is_lost_at_the_border_of_the_picture() -> None:
    """Chunks that joints swing far from their place at rest are found, whatever the camera sees of them."""
    rng = np.random.default_rng(11)
    renderer, camera, partly = Renderer([SUBJECT], reuse=NO_REUSE), CameraPlan(width=48, height=48, fov=40), 0
    for _ in range(80):
        bend = rng.uniform(-150, 150, 3)
        parts = pose(0.0, (float(bend[0]), float(bend[1])), float(bend[2]))
        x, y, z, yaw, pitch = rng.uniform((-2, -2, 0, -180, -40), (2, 2, 2, 180, 40)).tolist()
        eye = from_pose(Pose(x=x, y=y, z=z, yaw=yaw, pitch=pitch))
        seen = renderer.observe(camera, eye, parts).instance
        expected = Renderer([rigid(parts)], reuse=NO_REUSE).observe(camera, eye, HERE).instance
        assert (seen != expected).sum() <= 2
        partly += 0 < (expected > 0).sum() < expected.size
    assert partly >= 10


def pictures_differ(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Return the share of pixels that differ by more than the dark ground below one box of a body or several."""
    return float((np.abs(a.astype(int) - b.astype(int)).max(axis=-1) > 25).mean())


@pytest.mark.parametrize("altitude", [40.0, -30.0], ids=["sun", "lamp"])
def test_a_skin_casts_the_shadow_of_the_moved_mesh(altitude: float) -> None:
    """By day and below a street lamp, beside the same street without it."""
    parts = pose(0.0, (70.0, 30.0), 30.0)
    parts[:, :, 3] += np.array([5.0, 2.6, 0.15])
    town = [body for body in street() if not body.moves]
    eye, plan = from_pose(Pose(x=0.0, z=2.5, yaw=25, pitch=15)), appearance(altitude, 200.0, LOOKS)
    pictures = []
    for bodies, placed in ((([*town, SUBJECT]), parts), ([*town, rigid(parts)], HERE), (town, HERE[:0])):
        renderer = Renderer(bodies)
        pictures.append(renderer.shade(renderer.observe(CAMERA, eye, placed), plan, "street", 0, 0.0))
    skin, expected, empty = pictures
    assert pictures_differ(skin, expected) < 0.001
    assert pictures_differ(skin, empty) > 0.015


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_reused_and_recorded_frames_of_a_skin_have_the_bytes_of_full_ones(device: str) -> None:
    bodies = [Body("road", 0, (("base", ground(60, ROAD)),)), SUBJECT]
    parts = np.stack([pose(0.02 * n, (9.0 * n, -7.0 * n), 5.0 * n) for n in range(6)])
    plan = appearance(40.0, 200.0, LOOKS)
    keeping, forgetting = Renderer(bodies), Renderer(bodies, reuse=NO_REUSE)
    stream = Renderer(bodies, device).frame_stream(CAMERA, "street", [plan], in_flight=1)
    batch = FrameBatch(range(6), [0.0] * 6, np.stack([EYE] * 6), parts)
    for number, recorded in enumerate(stream.frames(batch)):
        full, reused = (r.observe(CAMERA, EYE, parts[number]) for r in (forgetting, keeping))
        expected = forgetting.shade(full, plan, "street", number, 0.0)
        assert np.array_equal(reused.depth, full.depth) and reused.objects == full.objects
        assert np.array_equal(recorded.observation.depth, full.depth) and recorded.observation.objects == full.objects
        assert np.array_equal(keeping.shade(reused, plan, "street", number, 0.0), expected)
        assert np.array_equal(recorded.pictures[0], expected)


def test_boxes_bound_the_moved_vertices() -> None:
    for parts in POSES:
        vertices = moved(COLUMN, parts).vertices
        found = BodyVertices.of(SUBJECT.parts).placed(parts)
        np.testing.assert_allclose(found.min(axis=1), vertices.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(found.max(axis=1), vertices.max(axis=0), atol=1e-6)


def test_a_skin_splits_into_rigid_parts_that_meet_at_rest() -> None:
    """Texture maps and surfaces of patches see them."""
    parts, rest = split_parts(SUBJECT.parts), pose()
    assert [name for name, _ in parts] == list(NAMES)
    assert sum(len(mesh.triangles) for _, mesh in parts) == len(COLUMN.triangles)
    corners = np.concatenate(
        [(mesh.vertices + rest[n][:, 3])[mesh.triangles] for n, (_, mesh) in enumerate(parts)]
    ).reshape(-1, 9)
    expected = COLUMN.vertices[COLUMN.triangles].reshape(-1, 9)
    np.testing.assert_allclose(np.unique(corners.round(4), axis=0), np.unique(expected.round(4), axis=0), atol=2e-4)
    assert invert(rest[0]).shape == (3, 4)


def test_a_patch_is_where_the_main_part_of_the_skin_carries_it() -> None:
    """On the middle of the column as it turns, compared with a body of three rigid parts."""
    face = PatchFace(
        part="middle",
        corner=(-0.2, 0.08, 0.45),
        right=(0.0, -1.0, 0.0),
        down=(0.0, 0.0, -1.0),
        width=0.16,
        height=0.2,
        reach=0.1,
    )
    bodies = SUBJECT, Body("hero", 12001, split_parts(SUBJECT.parts))
    green = patch(of_colour("#00ff00"), "hero", (face,))
    plan = appearance(40.0, 200.0, LOOKS).model_copy(update={"patches": (green,)})
    for turn in (-30.0, 0.0, 30.0):
        parts, maps = pose(0.0, (0.0, 0.0), turn), []
        for body in bodies:
            renderer = Renderer([body])
            maps.append(renderer.patch_map(renderer.observe(CAMERA, EYE, parts), plan))
        assert maps[0].sum() > 20 and (maps[0] != maps[1]).sum() <= 2
