"""Motion blur: its length is the motion during the exposure, and only moving surfaces and their surroundings blur."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.plan import CameraPlan, CameraResponse, Pose
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.mesh import Body, Pattern, Surface
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import EYE, LOOKS, appearance, box, ground, parts_at, street
from tests.runtime.render.test_camera import light

CAMERA = CameraPlan(width=240, height=120, fov=60)
FOCAL = 120.0 / float(np.tan(np.radians(30.0)))
AHEAD = from_pose(Pose(z=1.5))
DISTANCE = 10.0
LOOK = {**LOOKS, "far": {"wall": "#202020"}, "near": {"shirt": "#f0f0f0"}, "floor": {"asphalt": "#4a4a4c"}}


@pytest.fixture(scope="module")
def slab() -> Renderer:
    """Return a bright slab, 1 m thick with its face 10 m away, in front of a dark wall 30 m away."""
    far = box([30.0, -60.0, -20.0], [31.0, 60.0, 40.0], Surface("wall", Pattern.PLAIN, 3))
    near = box([0.0, -1.0, 0.0], [1.0, 1.0, 4.0], Surface("shirt", Pattern.PLAIN, 12))
    floor = ground(60.0, Surface("asphalt", Pattern.PLAIN, 1), z=-1.0)
    bodies = [Body("floor", 0, (("base", floor),)), Body("far", 0, (("base", far),))]
    return Renderer([*bodies, Body("near", 12001, (("body", near),))])


def at(y: float) -> NDArray[np.float64]:
    return from_pose(Pose(x=DISTANCE, y=y))[None]


def shot(
    renderer: Renderer,
    neighbour: NeighbourFrame | None,
    pose: Array = AHEAD,
    parts: Array | None = None,
    /,
    **settings: float,
) -> NDArray[np.uint8]:
    response = CameraResponse.model_validate(
        {"noise": 0.0, "vignette_intensity": 0.0, "motion_blur_intensity": 1.0, **settings}
    )
    plan = appearance(40.0, looks=LOOK).model_copy(update={"responses": {"street": response}})
    seen = renderer.observe(CAMERA, pose, at(0.0) if parts is None else parts)
    return renderer.shade(seen, plan, "street", 1, 0.1, neighbour=neighbour)


def ramp(row: NDArray[np.uint8], sharp: NDArray[np.uint8]) -> list[tuple[float, float]]:
    """Return the first and last blurred column of each of the slab's two edges."""
    y = row.astype(float).sum(axis=1)
    dark, bright = np.median(y), sharp.astype(float).sum(axis=1).max()
    share = (y - dark) / (bright - dark)
    between = np.flatnonzero((share > 0.03) & (share < 0.97))
    left, right = between[between < 120], between[between >= 120]
    return [(float(part.min()), float(part.max()) + 1.0) for part in (left, right)]


@pytest.mark.parametrize("metres, shutter", [(0.2, 60.0), (0.4, 40.0), (0.5, 30.0)])
def test_the_blur_of_an_edge_is_as_long_as_its_motion(slab: Renderer, metres: float, shutter: float) -> None:
    sharp = shot(slab, None)
    picture = shot(slab, NeighbourFrame(AHEAD, at(-metres), 1 / 30), shutter_speed=shutter)
    way = metres / DISTANCE * FOCAL * 30.0 / shutter
    edge = 1.0 / DISTANCE * FOCAL
    for (start, end), place in zip(ramp(picture[50], sharp[50]), (120.0 - edge, 120.0 + edge), strict=True):
        assert end - start == pytest.approx(way, abs=1.5)
        assert (start + end) / 2.0 == pytest.approx(place, abs=1.0)  # centred: half before, half after


def test_the_length_is_proportional_to_intensity_up_to_a_limit(slab: Renderer) -> None:
    moment, sharp = NeighbourFrame(AHEAD, at(-0.4), 1 / 30), shot(slab, None)

    def length(**settings: float) -> float:
        start, end = ramp(shot(slab, moment, shutter_speed=40.0, **settings)[50], sharp[50])[0]
        return end - start

    whole = length()
    assert length(motion_blur_intensity=0.5) == pytest.approx(whole / 2.0, abs=1.5)
    assert length(motion_blur_max_distortion=3.0 / 240.0) == pytest.approx(3.0, abs=1.5)


def test_a_faster_shutter_blurs_less(slab: Renderer) -> None:
    sharp, moment = shot(slab, None).astype(int), NeighbourFrame(AHEAD, at(-0.5), 1 / 30)
    errors = [np.abs(shot(slab, moment, shutter_speed=s) - sharp).sum() for s in (30.0, 60.0, 120.0, 10_000.0)]
    assert errors[0] > errors[1] > errors[2] > errors[3]


def test_static_surfaces_do_not_blur() -> None:
    renderer = Renderer(street())
    still = NeighbourFrame(EYE, parts_at(3), 1 / 30)
    first, second = (
        shot(renderer, still, EYE, parts_at(3), motion_blur_intensity=i, shutter_speed=5.0) for i in (1.0, 0.001)
    )
    assert first.tobytes() == second.tobytes()


def test_only_the_surroundings_of_moving_bodies_blur(slab: Renderer) -> None:
    nearly = shot(slab, NeighbourFrame(AHEAD, at(0.0), 1 / 30))
    picture = shot(slab, NeighbourFrame(AHEAD, at(-0.5), 1 / 30), shutter_speed=30.0)
    changed = np.flatnonzero((picture != nearly).any(axis=(0, 2)))
    reach = FOCAL / DISTANCE * (1.0 + 0.25) + 2.0
    assert 120.0 - reach <= changed.min() and changed.max() <= 120.0 + reach


def test_a_turning_camera_blurs_everything_by_its_rotation() -> None:
    renderer = Renderer(street())
    pose, before = (from_pose(Pose(y=-1.0, z=1.7, yaw=yaw, pitch=4)) for yaw in (8.0, 6.0))
    sharp = light(shot(renderer, NeighbourFrame(pose, parts_at(3), 1 / 30), pose, parts_at(3)))
    picture = light(shot(renderer, NeighbourFrame(before, parts_at(3), 1 / 30), pose, parts_at(3), shutter_speed=30.0))
    way = FOCAL * np.tan(np.radians(2.0))  # 7.3 pixels, a little more towards the sides
    boxed = np.stack([np.roll(sharp, n, axis=1) for n in (-3, -2, -1, 0, 1, 2, 3)]).mean(
        axis=0
    )  # the sum of light is preserved
    middle = (slice(20, 100), slice(70, 170))
    assert way == pytest.approx(7.3, abs=0.1)
    assert np.abs(picture - boxed)[middle].mean() < 0.25 * np.abs(sharp - boxed)[middle].mean()


def test_a_body_that_moves_with_the_camera_stays_sharp(slab: Renderer) -> None:
    """The slab moves with the camera; the wall behind it blurs, but not over the slab."""
    moment = NeighbourFrame(from_pose(Pose(y=-2.0, z=1.5)), at(-2.0), 1 / 30)
    sharp, picture = shot(slab, None).astype(int), shot(slab, moment, shutter_speed=30.0).astype(int)
    edge = FOCAL / DISTANCE
    inside = slice(int(120 - edge) + 2, int(120 + edge) - 2)
    assert np.abs(picture[45:60, inside] - sharp[45:60, inside]).max() <= 1
    left = slice(int(120 - edge) - 12, int(120 - edge) - 2)
    assert np.abs(picture[45:50, left] - sharp[45:50, left]).max() <= 12  # the slab has no ghost on the wall
