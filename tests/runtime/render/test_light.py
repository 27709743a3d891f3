"""Light compared with closed forms: Lambert's cosine law, Koschmieder's law, the length of a shadow."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, Pose
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body, Light, Pattern, Surface
from recipe_runtime.render.atmosphere.weather_light import extinction, initial_light, light_at_time
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import appearance, box, ground

GREY = Surface("grey", Pattern.PLAIN, 25)
BLACK = Surface("black", Pattern.PLAIN, 3)
LOOKS = {"ground": {"grey": "#bcbcbc"}, "pole": {"black": "#000000"}, "target": {"black": "#000000"}}
NOBODY = np.zeros((0, 3, 4))
CAMERA = CameraPlan(width=64, height=64, fov=60)


def level(*bodies: Body) -> Renderer:
    return Renderer([Body("ground", 0, (("static", ground(300.0, GREY)),)), *bodies])


def looked(renderer: Renderer, pose: Pose, weather: AppearancePlan, camera: CameraPlan = CAMERA) -> NDArray[np.float32]:
    return renderer.radiance(renderer.observe(camera, from_pose(pose), NOBODY), weather)


@pytest.mark.parametrize("altitude", [90.0, 60.0, 45.0, 30.0, 12.0])
def test_flat_ground_follows_lamberts_cosine_law(altitude: float) -> None:
    weather = appearance(altitude, looks=LOOKS, cloudiness=0, fog_density=0)
    light = initial_light(weather, "cpu")
    overhead = np.array([light.air.overhead[n] for n in range(3)])
    albedo = ((0xBC / 255 + 0.055) / 1.055) ** 2.4
    expected = albedo * (light.sunlight * exact.sin_deg(altitude) + overhead)
    seen = looked(level(), Pose(z=2.0, pitch=90), weather)[32, 32]
    np.testing.assert_allclose(seen, expected, rtol=0.004)  # 2 m of clear air


@pytest.mark.parametrize("metres", [6.0, 20.0, 45.0])
def test_a_black_target_in_fog_follows_koschmieders_law(metres: float) -> None:
    target = box([metres, -20, 0], [metres + 1, 20, 40], BLACK)
    weather = appearance(40.0, azimuth=180.0, looks=LOOKS, fog_density=100, fog_distance=1, fog_falloff=0)
    seen = looked(level(Body("target", 0, (("static", target),))), Pose(z=1.6), weather)[31, 31]
    air = initial_light(weather, "cpu").air
    path = float(air.fog) * (metres - 1.0) + (float(air.haze) + float(air.clear_air)) * metres
    veil = np.array([air.fog_colour[n] for n in range(3)]) * (1.0 - exact.exp(-path))
    np.testing.assert_allclose(seen, veil, rtol=0.005)
    assert float(air.fog) == pytest.approx(extinction(100.0), abs=1e-6)
    assert float(air.haze) < 0.01 * float(air.fog)


def test_the_glow_of_a_lamp_in_fog_is_the_integral_along_the_ray() -> None:
    """The closed form is within 2 % of a sum of a million steps, on the lamp and beside it, near and far."""
    lamp = Light((8.0, 0.0, 2.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0), 1400.0, -1.0)  # an isotropic lamp
    renderer = Renderer(
        [
            Body("ground", 0, (("static", ground(300.0, GREY, z=-250.0)),)),
            Body("lamp", 0, (("static", box([7.99, -0.01, 2.0], [8.01, 0.01, 2.02], BLACK, (lamp,))),)),
        ]
    )
    still = {"fog_density": 50.0, "fog_distance": 0.0, "fog_falloff": 0.0}
    dark, glowing = (
        looked(renderer, Pose(z=2.0), appearance(-40.0, looks=LOOKS, scattering_intensity=s, **still)) for s in (0, 1)
    )
    air = initial_light(appearance(-40.0, looks=LOOKS, scattering_intensity=1, **still), "cpu").air
    sigma, power = float(air.fog) + float(air.haze), 1400.0 / 11000.0
    steps = np.linspace(0.0, 1000.0, 1_000_001)
    for column in (20, 26, 31, 36):
        across, down = (column + 0.5 - 32) / 32 * 0.5773502691896258, 0.5 / 32 * 0.5773502691896258
        size = float(np.sqrt(1.0 + across * across + down * down))
        near = 8.0 / size
        beside = 64.0 - near * near
        way = (steps - near) * (steps - near) + beside + 0.12 * 0.12
        fades = (1.0 - beside / 25.0) * (1.0 - 64.0 / 4900.0)
        total = float((1.0 / way).sum()) * 0.001 * fades * fades * 0.6 * power / (1.0 + 12.0 * power)
        expected = sigma * float(air.glow_share) * exact.exp(-sigma * near) * total
        assert (glowing - dark)[31, column, 1] == pytest.approx(expected, rel=0.02)


def test_near_objects_are_visible_in_the_densest_fog() -> None:
    assert exact.exp(-extinction(100.0) * 7.0) > 0.5
    assert exact.exp(-extinction(100.0) * 45.0) < 0.021


@pytest.mark.parametrize("altitude", [60.0, 30.0, 20.0])
def test_the_length_of_a_shadow_follows_from_the_suns_altitude(altitude: float) -> None:
    pole = box([-0.1, -0.1, 0], [0.1, 0.1, 2.0], BLACK)
    weather = appearance(altitude, azimuth=180.0, looks=LOOKS, cloudiness=0, fog_density=0)
    camera = CameraPlan(width=400, height=400, fov=60)
    renderer = level(Body("pole", 0, (("static", pole),)))
    picture = looked(renderer, Pose(x=3.0, z=12.0, pitch=90), weather, camera)[..., 1]
    sine, cosine = exact.sin_cos_deg(altitude)
    metres = 12.0 / (200.0 * 1.7320508075688772)  # a pixel on the ground
    # The camera looks straight down; forward (world -x after the turn) runs down the image's columns.
    line = picture[:, 200]
    bright = np.median(picture)
    rows = np.nonzero((line < 0.6 * bright) & (line > 0.0))[0]
    xs = 3.0 - (rows + 0.5 - 200) * metres
    assert abs(xs.max() - (0.1 + 2.0 * cosine / sine)) < 2.5 * metres + 0.05
    assert xs.min() < 0.2  # the shadow touches its caster


def test_only_lamps_light_the_night_and_they_do_not_light_noon() -> None:
    noon, night = (initial_light(appearance(a), "cpu") for a in (60.0, -30.0))
    assert (noon.night, night.night) == (0.0, 1.0)
    assert night.sunlight.max() == 0.0
    assert night.exposure() > 50 * noon.exposure()


def test_computing_light_at_a_time_does_not_change_earlier_light() -> None:
    """Frames in flight still use their light, and the order of times does not matter."""
    start = initial_light(appearance(45.0, wind_intensity=60, precipitation=50), "cpu")
    first, then = start.moved, light_at_time(start, 1.5)
    assert light_at_time(light_at_time(start, 0.4), 1.5).moved == then.moved != first
    assert (float(start.air.drift[0]), int(start.air.leaf_step), int(start.air.ring_step)) == (0.0, 0, 0)
    assert (float(then.air.drift[0]), int(then.air.leaf_step), int(then.air.ring_step)) == pytest.approx(
        (0.514 * 14.0 * 0.6 * 1.5, 45, 18)
    )
    assert float(then.air.sunlight[0]) == float(start.air.sunlight[0])
    assert light_at_time(then, 1.5) is then
