"""Sun shadows: a plane does not shadow itself, a shadow begins at its object, fog dissolves it; lamps in fog."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body, Pattern, Surface
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import appearance, box, ground, quad

NOBODY = np.zeros((0, 3, 4))
FACE = Surface("face", Pattern.PLAIN, 20)
FLOOR = Surface("floor", Pattern.PLAIN, 1)
LOOKS = {"board": {"face": "#ffffff"}, "floor": {"floor": "#808080"}}


@pytest.mark.parametrize("yaw", [0.0, 23.0])
@pytest.mark.parametrize("distance", [8.0, 70.0])
def test_a_board_in_low_sun_is_evenly_lit(yaw: float, distance: float) -> None:
    """Adjacent pixels of a flat board differ by less than half a percent, near by and in the coarse map."""
    s, c = exact.sin_cos_deg(yaw)
    half, high = 0.8 * distance, 0.9 * distance
    corners = [[-s * t, c * t, z] for t, z in ((half, 0.05), (-half, 0.05), (-half, high), (half, high))]
    renderer = Renderer([Body("board", 0, (("s", quad(corners, [[0, 0]] * 4, FACE)),))])
    camera = CameraPlan(width=128, height=72, fov=55)
    eye = from_pose(Pose(x=-distance * c, y=-distance * s, z=0.45 * distance, yaw=yaw))
    seen = renderer.observe(camera, eye, NOBODY)
    for altitude in (2.0, 8.0):
        for beside in (120.0, 100.0, 93.0):
            plan = appearance(altitude, (yaw + beside) % 360, LOOKS, fog_density=0.0)
            light = renderer.radiance(seen, plan)[..., 0].astype(float)
            assert np.abs(np.diff(light, axis=1)).max() < 0.005 * np.median(light)


def test_a_shadow_begins_at_its_object() -> None:
    """The ground right behind a wall is in its shade: the bias that keeps planes even lets no light through."""
    wall = box([0, -20, 0], [0.3, 20, 2], FACE)
    renderer = Renderer([Body("floor", 0, (("s", ground(60, FLOOR)),)), Body("board", 0, (("s", wall),))])
    camera, eye = CameraPlan(width=64, height=48, fov=40), from_pose(Pose(x=1.0, z=3.0, pitch=89.0))
    seen = renderer.observe(camera, eye, NOBODY)
    behind, before = (
        renderer.radiance(seen, appearance(12.0, azimuth, LOOKS, fog_density=0.0))[..., 0] for azimuth in (180.0, 0.0)
    )
    floor = seen.semantic == 1
    assert behind[floor].max() < 0.6 * np.median(before[floor])


def test_fog_turns_sunlight_into_diffuse_light() -> None:
    """The contrast of a shadow on the ground near by falls with the fog, to under 0.1 at a visual range of 90 m."""
    renderer = Renderer(
        [Body("floor", 0, (("s", ground(60, FLOOR)),)), Body("board", 0, (("s", box([6, -9, 0], [6.3, 0, 3], FACE)),))]
    )
    camera, eye = CameraPlan(width=64, height=48, fov=60), from_pose(Pose(x=0.0, z=2.0, pitch=20.0))
    seen = renderer.observe(camera, eye, NOBODY)
    contrasts, levels = [], []
    for density in (0.0, 25.0, 50.0, 70.7):
        plan = appearance(35.0, 0.0, LOOKS, fog_density=density, fog_distance=500.0, fog_falloff=0.2)
        light = renderer.radiance(seen, plan)[..., 0]
        shade, sun = float(light[40, 44]), float(light[40, 20])
        contrasts.append((sun - shade) / sun)
        levels.append(sun)
    assert contrasts == sorted(contrasts, reverse=True)
    assert contrasts[0] > 0.5
    assert contrasts[-1] < 0.1
    assert levels[-1] > 0.25 * levels[0]  # most of the light is still there


def test_a_lamp_is_seen_farther_through_fog_than_other_things() -> None:
    """The light of a lamp falls with the square root of what Koschmieder's law leaves of a contrast."""
    lamp = quad([[0, 4, 0], [0, -4, 0], [0, -4, 8], [0, 4, 8]], [[0, 0]] * 4, Surface("lamp", Pattern.LAMP, 6))
    renderer, camera = Renderer([Body("bulb", 0, (("s", lamp),))]), CameraPlan(width=32, height=32, fov=20)
    seen = [renderer.observe(camera, from_pose(Pose(x=-at, z=4.0)), NOBODY) for at in (5.0, 45.0)]
    light = []
    for colour in ("#ffd8a0", "#000000"):
        plan = appearance(-40.0, looks={"bulb": {"lamp": colour}}, fog_density=100.0, fog_distance=0.0, fog_falloff=0.0)
        light.append([float(renderer.radiance(obs, plan)[16, 16, 0]) for obs in seen])
    near, far = (lit - dark for lit, dark in zip(*light, strict=True))
    left = exact.exp(-3.912 / 45.0 * 40.0)
    assert 0.9 * np.sqrt(left) < far / near < 1.1 * np.sqrt(left)
