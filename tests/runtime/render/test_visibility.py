"""Depth, labels and extents compared with closed forms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.mesh import Body, Mesh, Pattern, Surface
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import CAMERA, EYE, ball, box, ground, parts_at, street

GREY = Surface("grey", Pattern.PLAIN, 25)
SHIRT = Surface("shirt", Pattern.PLAIN, 12)
SQUARE = CameraPlan(width=64, height=64, fov=90)
HERE = from_pose(Pose())
PLANE = Body("plane", 0, (("static", ground(50.0, GREY, z=-30.0)),))


def triangle(corners: Sequence[Sequence[float]]) -> Mesh:
    c = np.array(corners, np.float32)
    normals = np.zeros_like(c) + np.array([-1, 0, 0], np.float32)
    surface = np.zeros(1, np.int32)
    return Mesh(c, normals, c[:, :2], np.array([[0, 1, 2]], np.int32), surface, (SHIRT,))


def actors(*meshes: Mesh) -> list[Body]:
    return [PLANE, *(Body(f"a{n}", 12001 + n, (("base", mesh),)) for n, mesh in enumerate(meshes))]


def places(count: int) -> Array:
    return np.stack([HERE] * count)


def test_the_depth_of_a_plane_is_its_height_over_the_rays_slope() -> None:
    renderer = Renderer([Body("ground", 0, (("static", ground(500.0, GREY)),))])
    seen = renderer.observe(CAMERA, from_pose(Pose(z=2.0)), np.zeros((0, 3, 4)))
    focal = CAMERA.width / 2 / 0.8390996311772799  # tan 40 degrees
    slope = (np.arange(CAMERA.height) + 0.5 - CAMERA.height / 2) / focal
    below = slope > 0.01
    rows = focal * 2.0 / seen.depth[below].astype(np.float64)  # each depth as an image row
    # Corners are snapped to 1/256 pixel, so a plane is within a little more than 1/512 pixel of its place.
    assert np.abs(rows - (slope[below] * focal)[:, None]).max() < 1 / 400
    assert (seen.depth[~below][:-1] == CAMERA.far).all()
    assert (seen.semantic[0] == 11).all()


def test_the_silhouette_of_a_ball_is_a_disc() -> None:
    renderer = Renderer(actors(ball(1.0, SHIRT, rings=64)))
    seen = renderer.observe(CameraPlan(width=400, height=400, fov=90), HERE, from_pose(Pose(x=5.0))[None])
    (view,) = seen.objects
    radius = 200.0 / np.sqrt(24.0)  # focal * r / sqrt(d^2 - r^2)
    assert view.visible == view.amodal == (seen.instance == 12001).sum()
    assert abs(view.amodal - np.pi * radius * radius) < 0.005 * view.amodal
    x0, y0, x1, y1 = view.amodal_box
    assert view.box == view.amodal_box
    assert abs((x0 + x1) / 2 - 200) <= 0.5 and abs((y0 + y1) / 2 - 200) <= 0.5
    assert max(abs(p - b) for p, b in zip(view.projected, view.amodal_box, strict=True)) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("place", [(5.0, 0.0, 0.0), (6.0, 1.0, -2.0)])
def test_the_outline_of_a_ball_is_a_conic_section(place: tuple[float, float, float]) -> None:
    renderer = Renderer(actors(ball(1.0, SHIRT, rings=96)))
    x, y, z = place
    camera = CameraPlan(width=400, height=400, fov=90)
    seen = renderer.observe(camera, HERE, from_pose(Pose(x=x, y=y, z=z))[None])
    step = (np.arange(400) + 0.5 - 200.0) / 200.0
    # A pixel's ray is (1, -right, -down); it hits the ball if its distance from the centre is below the radius.
    right, down = np.meshgrid(step, step)
    size = 1.0 + right * right + down * down
    along = x - right * y - down * z
    distance = np.sqrt(x * x + y * y + z * z - along * along / size)
    pixel = x / 200.0  # metres
    assert (seen.instance[distance < 1.0 - 0.75 * pixel] == 12001).all()
    assert (seen.instance[distance > 1.0 + 0.75 * pixel] != 12001).all()


@pytest.mark.parametrize("seed", range(8))
def test_triangles_that_share_an_edge_leave_no_gap_and_cover_no_pixel_twice(seed: int) -> None:
    random = np.random.Generator(np.random.Philox(seed))
    corners = np.concatenate([np.full((4, 1), 2.0), random.integers(-8, 9, (4, 2)) / 8.0], axis=1)
    a, b, c, d = corners
    # A fan around the centre of a convex outline, on a coarse grid, so that corners and edges hit pixel centres.
    middle = ((a + b + c + d) / 4.0).tolist()
    order = sorted(corners.tolist(), key=lambda p: _angle_key(p, middle))
    fan = [triangle([middle, p, q]) for p, q in zip(order, [*order[1:], order[0]], strict=True)]
    flipped = [Mesh(m.vertices, m.normals, m.uvs, m.triangles[:, ::-1].copy(), m.surface, m.surfaces) for m in fan]
    seen = Renderer(actors(*fan, *flipped)).observe(
        SQUARE, HERE, places(8)
    )  # half of the eight triangles face the camera
    assert (seen.instance > 0).sum() > 20
    assert sum(view.amodal for view in seen.objects) == (seen.instance > 0).sum()


def _angle_key(p: Sequence[float], middle: Sequence[float]) -> float:
    """Return a number that grows with the angle around the centre."""
    y, z = p[1] - middle[1], p[2] - middle[2]
    size = abs(y) + abs(z) or 1.0
    return float((1.0 - y / size) if z >= 0 else (3.0 + y / size))


def test_the_shared_diagonal_of_a_square_on_pixel_centres() -> None:
    # Edges run through pixel centres, so the top-left rule decides.
    low, high = -0.5 + 0.5 / 32.0, 0.5 + 0.5 / 32.0
    a, b, c, d = [2, 2 * low, 2 * low], [2, 2 * high, 2 * low], [2, 2 * high, 2 * high], [2, 2 * low, 2 * high]
    halves = [triangle([a, c, b]), triangle([a, d, c])]
    seen = Renderer(actors(*halves)).observe(SQUARE, HERE, places(2))
    assert (seen.instance > 0).sum() == 32 * 32
    assert sum(view.amodal for view in seen.objects) == 32 * 32


def test_a_body_across_the_near_plane_is_clipped_there() -> None:
    renderer = Renderer(actors(box([-5, -0.2, -1.0], [8, 0.2, -0.5], SHIRT)))
    seen = renderer.observe(SQUARE, HERE, places(1))
    (view,) = seen.objects
    assert view.amodal > 300
    assert seen.depth.min() >= SQUARE.near


def test_a_hidden_actor_keeps_its_amodal_extent() -> None:
    front, back = box([3, -2, -2], [3.2, 2, 2], SHIRT), box([6, -0.5, -0.5], [7, 0.5, 0.5], SHIRT)
    seen = Renderer(actors(front, back)).observe(SQUARE, HERE, places(2))
    alone = Renderer(actors(back)).observe(SQUARE, HERE, places(1))
    hidden = seen.objects[1]
    assert (hidden.visible, hidden.box) == (0, None)
    assert (hidden.amodal, hidden.amodal_box) == (alone.objects[0].visible, alone.objects[0].box)


def test_there_can_be_more_actors_than_bits_in_a_word() -> None:
    meshes = [box([4, -3.4 + n * 0.1, -0.2], [4.1, -3.34 + n * 0.1, 0.2], SHIRT) for n in range(70)]
    seen = Renderer(actors(*meshes)).observe(CameraPlan(width=400, height=100, fov=90), HERE, places(70))
    assert [view.instance for view in seen.objects] == list(range(12001, 12071))
    assert all(view.amodal >= view.visible > 0 for view in seen.objects)


def test_a_static_camera_observes_the_same_as_a_new_renderer() -> None:
    keeping, fresh = Renderer(street()), Renderer(street(), reuse=NO_REUSE)
    for frame in (0, 1, 2, 5):
        a, b = (r.observe(CAMERA, EYE, parts_at(frame)) for r in (keeping, fresh))
        assert np.array_equal(a.depth, b.depth) and np.array_equal(a.instance, b.instance)
        assert a.objects == b.objects


def test_a_wrong_number_of_part_transforms_is_an_error() -> None:
    with pytest.raises(ValueError, match="1 transforms were given for 2 moving parts"):
        Renderer(street()).observe(CAMERA, EYE, parts_at()[:1])


@pytest.mark.parametrize("seed", range(6))
def test_culled_geometry_would_not_have_been_visible(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.Generator(np.random.Philox(seed))
    x, y, yaw, pitch = random.uniform([-6, -6, -180, -60], [6, 6, 180, 60])
    eye = from_pose(Pose(x=float(x), y=float(y), z=1.5, yaw=float(yaw), pitch=float(pitch)))
    culling, drawing_all = Renderer(street()), Renderer(street())
    chunks = drawing_all._geometry.chunk_count
    monkeypatch.setattr(
        drawing_all._observer, "_chunks", lambda *_: wp.array(np.ones(chunks, np.int32), dtype=wp.int32, device="cpu")
    )
    a, b = (r.observe(CAMERA, eye, parts_at(seed)) for r in (culling, drawing_all))
    assert (a.seen.numpy() == 0).any()
    assert a.keys.numpy().tobytes() == b.keys.numpy().tobytes()
    assert a.objects == b.objects


LENS = Body("signal", 0, (("red", box([-0.1, -0.1, -0.1], [0.1, 0.1, 0.1], GREY)),), is_signal=True)


def test_a_traffic_light_is_not_part_of_an_actors_box() -> None:
    bodies, ball_at, lens_at = actors(ball(1.0, SHIRT)), from_pose(Pose(x=5.0)), from_pose(Pose(x=6.0, y=4.0, z=3.0))
    alone = Renderer(bodies).observe(SQUARE, HERE, ball_at[None])
    together = Renderer([*bodies, LENS]).observe(SQUARE, HERE, np.stack([ball_at, lens_at]))
    assert (together.semantic != alone.semantic).any()
    assert together.objects == alone.objects


@pytest.mark.parametrize("bodies", [[PLANE], actors(ball(1.0, SHIRT))])
def test_a_static_camera_sees_a_traffic_light_change(bodies: list[Body]) -> None:
    kept, fresh = Renderer([*bodies, LENS]), Renderer([*bodies, LENS], reuse=NO_REUSE)
    still = np.repeat(HERE[None], len(bodies) - 1, axis=0)
    for y in (4.0, 4.0, -4.0, 0.0, 4.0):
        parts = np.concatenate([still, from_pose(Pose(x=6.0, y=y, z=3.0))[None]])
        one, other = kept.observe(SQUARE, HERE, parts), fresh.observe(SQUARE, HERE, parts)
        np.testing.assert_array_equal(one.semantic, other.semantic)
        np.testing.assert_array_equal(one.depth, other.depth)
