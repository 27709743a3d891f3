"""Each weather parameter has the effect of its name, and a larger value has a larger effect.

Each test raises one parameter through at least four values on a small picture and measures the effect.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse, Pose
from recipe_compiler.ir.weather import PARAMETERS
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body, Light, Mesh, Pattern, Surface
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import (
    CAMERA,
    EYE,
    LEAVES,
    LOOKS,
    ROAD,
    appearance,
    ball,
    box,
    ground,
    parts_at,
    street,
)

GREY = Surface("grey", Pattern.PLAIN, 3)
COLOURS = {
    "ground": {"grey": "#9a9a9a", "asphalt": "#4a4a4c"},
    "wall": {"grey": "#e0e0e0"},
    "pole": {"grey": "#404040"},
}
NOBODY = np.zeros((0, 3, 4))
SMALL = CameraPlan(width=64, height=64, fov=60)
DULL = {"cloudiness": 0.0, "fog_density": 0.0, "wind_intensity": 0.0}


Test = TypeVar("Test", bound=Callable[[], None])
tested: set[str] = set()


def effect_of(parameter: str) -> Callable[[Test], Test]:
    """Mark the test of a parameter's effect; each parameter must have one."""
    tested.add(parameter)
    return lambda test: test


def scene(*static: tuple[str, Mesh], floor: Surface = GREY) -> Renderer:
    return Renderer([Body(name, 0, (("s", mesh),)) for name, mesh in (("ground", ground(300.0, floor)), *static)])


def looked(renderer: Renderer, pose: Pose, weather: AppearancePlan, camera: CameraPlan = SMALL) -> NDArray[np.float64]:
    """Return linear radiance [H, W, 3]."""
    return renderer.radiance(renderer.observe(camera, from_pose(pose), NOBODY), weather).astype(np.float64)


def shot(
    renderer: Renderer, pose: Pose, weather: AppearancePlan, time: float = 0.0, camera: CameraPlan = SMALL
) -> NDArray[np.float64]:
    """Return the 8-bit picture without noise [H, W, 3]."""
    quiet = weather.model_copy(update={"responses": {"street": CameraResponse(noise=0.0)}})
    seen = renderer.observe(camera, from_pose(pose), NOBODY)
    return renderer.shade(seen, quiet, "street", 0, time).astype(np.float64)


def plain(altitude: float = 45.0, azimuth: float = 180.0, **weather: float) -> AppearancePlan:
    return appearance(altitude, azimuth, COLOURS, **{**DULL, **weather})


def rises(values: Sequence[float], least: float = 0.0) -> None:
    """Assert that each value exceeds the previous one by at least the fraction `least` of their range."""
    assert len(values) >= 4
    span = max(values) - min(values)
    assert span > 0.0, values
    assert all(b - a > least * span for a, b in pairwise(values)), values


def falls(values: Sequence[float], least: float = 0.0) -> None:
    rises([-v for v in values], least)


FAR_WALL = ("wall", box([45, 0, 0], [46, 40, 30], GREY)), ("pole", box([45, -40, 0], [46, -0.01, 30], GREY))
ACROSS = Pose(z=1.6)


def far_contrast(weather: AppearancePlan) -> float:
    """Return the Michelson contrast of a light and a dark wall 45 m away."""
    seen = looked(scene(*FAR_WALL), ACROSS, weather)[:30, :, 1]
    light, dark = float(seen[10:, 8:24].mean()), float(seen[10:, 40:56].mean())
    return (light - dark) / (light + dark)


@effect_of("sun_azimuth_angle")
@pytest.mark.slow
def test_sun_azimuth_turns_shadows() -> None:
    pole = scene(("pole", box([-0.1, -0.1, 0], [0.1, 0.1, 2.0], GREY)))
    camera = CameraPlan(width=240, height=240, fov=60)
    angles = []
    for azimuth in (10.0, 75.0, 140.0, 220.0, 300.0):
        picture = looked(pole, Pose(z=14.0, pitch=90), plain(30.0, azimuth), camera)[..., 1]
        rows, columns = np.nonzero(picture < 0.6 * np.median(picture))
        # The camera looks down: up in the picture is world +x, left is world +y.
        away = 120.0 - np.array([rows.mean() + 0.5, columns.mean() + 0.5])
        angles.append(exact.atan2_deg(float(away[1]), float(away[0])) % 360.0)
        assert abs((angles[-1] - azimuth - 180.0 + 180.0) % 360.0 - 180.0) < 4.0
    assert len(set(angles)) == 5


@effect_of("sun_altitude_angle")
@pytest.mark.slow
def test_a_lower_sun_casts_longer_shadows() -> None:
    pole = scene(("pole", box([-0.1, -0.1, 0], [0.1, 0.1, 2.0], GREY)))
    camera = CameraPlan(width=200, height=200, fov=60)
    pictures = [looked(pole, Pose(x=3.0, z=14.0, pitch=90), plain(a), camera)[..., 1] for a in (65, 50, 35, 25, 18)]
    rises([float((p < 0.6 * np.median(p)).sum()) for p in pictures], 0.05)


def test_the_street_gets_darker_as_the_sun_sinks_until_lamps_light_it() -> None:
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    light = [renderer.radiance(seen, appearance(a)) for a in (-40.0, -8.0, -3.0, 2.0, 12.0, 45.0)]
    rises([float(np.median(r)) for r in light])
    pictures = [renderer.shade(seen, appearance(a), "street", 0, 0.0).astype(float) for a in (-90.0, -4.0, 3.0, 30.0)]
    night, dusk, evening, day = (float(p.mean()) for p in pictures)
    assert night < dusk < evening <= day + 30.0
    assert night > 20.0  # the lamps are on
    lamp = light[0].max() / np.median(light[0])
    assert lamp > 20.0 > light[-1].max() / np.median(light[-1])


@effect_of("cloudiness")
@pytest.mark.slow
def test_clouds_soften_the_sun_and_hide_the_sky() -> None:
    pole = scene(("pole", box([-1, -1, 0], [1, 1, 4.0], GREY)))
    covers = (0.0, 30.0, 60.0, 100.0)
    contrasts, blue = [], []
    for cover in covers:
        weather = plain(45.0, cloudiness=cover)
        ground_seen = looked(pole, Pose(x=3.0, z=14.0, pitch=90), weather)[..., 1]
        contrasts.append(float(np.percentile(ground_seen, 90) / np.percentile(ground_seen, 2)))
        above = looked(pole, Pose(z=2.0, pitch=-40), weather)
        blue.append(float((above[..., 2] / above[..., 0]).mean()))
    falls(contrasts)
    falls(blue)


@effect_of("precipitation")
@pytest.mark.slow
def test_rain_lowers_contrast_and_adds_streaks() -> None:
    amounts = (0.0, 25.0, 50.0, 75.0, 100.0)
    falls([far_contrast(plain(precipitation=amount)) for amount in amounts], 0.05)
    wall = scene(*FAR_WALL)
    moved = [
        np.abs(shot(wall, ACROSS, plain(precipitation=a), 0.0) - shot(wall, ACROSS, plain(precipitation=a), 0.1))
        for a in amounts
    ]
    rises([float((m.max(axis=2) > 4).mean()) for m in moved], 0.05)
    assert moved[0].max() == 0


@pytest.mark.slow
def test_rain_drops_fall_between_frames() -> None:
    """The streaks of two frames match best when those of the earlier frame are shifted by the distance of the fall."""
    wall, camera = scene(("wall", box([9, -40, -1], [9.2, 40, 30], GREY))), CameraPlan(width=160, height=160, fov=30)
    rain = [shot(wall, Pose(z=12.0), plain(precipitation=30), t, camera)[..., 1] for t in (1.0, 1.03, 5.0, 6.0, 7.0)]
    calm = np.median(rain, axis=0)
    early, late = (r - calm for r in rain[:2])
    matches = [float((early[: 110 - s] * late[s:110]).mean()) for s in range(50)]
    assert 5 < int(np.argmax(matches)) < 45  # 0.2 m at a distance of 1.5 to 9 m; 300 pixels per metre at 1 m


@effect_of("precipitation_deposits")
def test_more_deposits_enlarge_puddles_that_stay_in_place() -> None:
    bright, dark = (
        scene(("wall", box([14, -40, 0.0], [15, 40, 12], surface)), floor=ROAD)
        for surface in (Surface("bright", Pattern.PLAIN, 3), Surface("dark", Pattern.PLAIN, 3))
    )
    looks = {**COLOURS, "wall": {"bright": "#ffffff", "dark": "#101010"}}
    camera = CameraPlan(width=128, height=96, fov=70)
    pools: list[NDArray[np.bool_]] = []
    film: NDArray[np.float64] | None = None  # the reflection without deposits
    for deposits in (0.0, 25.0, 50.0, 75.0, 100.0):
        weather = appearance(45.0, 180.0, looks, **DULL, wetness=100.0, precipitation_deposits=deposits)
        mirrored = looked(bright, Pose(z=1.6, pitch=12), weather, camera) - looked(
            dark, Pose(z=1.6, pitch=12), weather, camera
        )
        film = mirrored if film is None else film
        pools.append(mirrored[50:, :, 1] > 1.3 * film[50:, :, 1])
    rises([float(pool.mean()) for pool in pools])
    for less, more in pairwise(pools):
        assert (less & ~more).mean() < 0.01  # a puddle grows and does not move


def _slant(picture: NDArray[np.float64]) -> float:
    """Return the mean tilt of a picture's streaks in degrees, by the structure tensor of the blurred picture."""
    for axis in (0, 1, 0, 1, 0, 1):
        picture = picture + np.roll(picture, 1, axis) + np.roll(picture, -1, axis)
    gx, gy = picture[1:-1, 2:] - picture[1:-1, :-2], picture[2:, 1:-1] - picture[:-2, 1:-1]
    across, cross, down = float((gx * gx).sum()), float((gx * gy).sum()), float((gy * gy).sum())
    return abs(0.5 * exact.atan2_deg(2.0 * cross, across - down))


@effect_of("wind_intensity")
@pytest.mark.slow
def test_wind_slants_the_rain() -> None:
    wall = scene(("wall", box([40, -60, -1], [41, 60, 60], GREY)))
    camera = CameraPlan(width=320, height=240, fov=40)
    winds = (0.0, 30.0, 60.0, 100.0)
    slants = []
    for wind in winds:
        weather = plain(precipitation=60, wind_intensity=wind)
        pictures = [shot(wall, Pose(z=20.0), weather, t, camera)[..., 1] for t in (1.0, 5.0, 6.0)]
        slants.append(_slant(pictures[0] - np.median(pictures, axis=0)))
    rises(slants, 0.1)
    assert slants[0] < 6.0  # streaks converge above the camera, so only those in the centre are vertical
    assert 25.0 < slants[-1] < 45.0  # wind at 5 m/s across the view, drops at 7 m/s downwards


def test_wind_moves_leaves_but_no_label() -> None:
    tree = scene(("tree", ball(2.0, LEAVES, 12, (7.0, 0.0, 2.0))))
    moved = []
    for wind in (0.0, 20.0, 45.0, 80.0):
        weather = appearance(45.0, 180.0, LOOKS, **{**DULL, "wind_intensity": wind})
        seen = tree.observe(SMALL, from_pose(Pose(z=1.6)), NOBODY)
        still, later = (tree.radiance(seen, weather, t).astype(float) for t in (0.0, 0.4))
        leaves = seen.semantic == LEAVES.tag
        moved.append(float(np.abs(later - still)[leaves].mean()))
        assert np.array_equal(seen.instance, tree.observe(SMALL, from_pose(Pose(z=1.6)), NOBODY).instance)
        assert np.array_equal(still[~leaves & (seen.depth < 100)], later[~leaves & (seen.depth < 100)])
    assert moved[0] == 0.0
    rises(moved, 0.05)


@effect_of("fog_density")
@pytest.mark.slow
def test_fog_hides_distant_surfaces() -> None:
    falls([far_contrast(plain(fog_density=fog)) for fog in (0.0, 25.0, 50.0, 75.0, 100.0)], 0.02)


@effect_of("fog_distance")
@pytest.mark.slow
def test_fog_distance_keeps_near_surfaces_clear() -> None:
    rises([far_contrast(plain(fog_density=90.0, fog_distance=d)) for d in (0.0, 8.0, 20.0, 44.0)], 0.02)


@effect_of("fog_falloff")
def test_fog_falloff_thins_it_with_height() -> None:
    tower = scene(("wall", box([30, 0, 20], [31, 30, 60], GREY)), ("pole", box([30, -30, 20], [31, -0.01, 60], GREY)))
    contrasts = []
    for falloff in (0.0, 0.2, 1.0, 5.0):
        weather = plain(fog_density=90.0, fog_distance=0.0, fog_falloff=falloff)
        seen = looked(tower, Pose(z=25.0), weather)[..., 1]
        light, dark = float(seen[:, 8:24].mean()), float(seen[:, 40:56].mean())
        contrasts.append((light - dark) / (light + dark))
    rises(contrasts, 0.03)


@effect_of("wetness")
def test_wetness_makes_the_ground_darker_and_glossier() -> None:
    road = scene(floor=ROAD)
    below, gloss = [], []
    for wet in (0.0, 30.0, 60.0, 100.0):
        weather = plain(60.0, 0.0, wetness=wet)
        below.append(float(looked(road, Pose(z=3.0, pitch=90), weather)[28:36, 28:36, 1].mean()))
        ahead = looked(road, Pose(z=1.6, yaw=180.0, pitch=3), weather)
        gloss.append(float(ahead[38:48, :, 2].mean()))
    falls(below, 0.1)
    rises([g / b for g, b in zip(gloss, below, strict=True)], 0.05)


@effect_of("scattering_intensity")
@pytest.mark.slow
def test_scattering_makes_halos_around_the_sun_and_lamps_in_fog() -> None:
    lamp = Light((12.0, 0.0, 4.0), (0.0, 0.0, -1.0), (1.0, 0.8, 0.55), 1400.0, 0.25)
    pole = box([11.9, -0.1, 4.0], [12.1, 0.1, 4.2], GREY, (lamp,))
    renderer = scene(("pole", pole))
    values = (0.0, 1.0, 10.0, 100.0)
    night = [
        looked(renderer, Pose(z=2.0), plain(-30.0, fog_density=60.0, scattering_intensity=v))[..., 1] for v in values
    ]
    day = [
        looked(renderer, Pose(z=2.0), plain(8.0, 0.0, fog_density=40.0, scattering_intensity=v))[..., 1] for v in values
    ]
    rises([float(p[20:26, 28:36].mean() - p[4:8, 2:8].mean()) for p in night], 0.05)
    rises([float(p[20:26, 28:36].mean() - p[20:26, 0:4].mean()) for p in day], 0.05)
    clear = [looked(renderer, Pose(z=2.0), plain(-30.0, scattering_intensity=v))[..., 1] for v in (0.0, 1.0)]
    assert clear[1][22, 32] - clear[0][22, 32] < 0.1 * (
        night[1][22, 32] - night[0][22, 32]
    )  # clear air scatters little


@effect_of("mie_scattering_scale")
@pytest.mark.slow
def test_mie_scattering_concentrates_light_around_the_sun() -> None:
    values = (0.0, 0.03, 0.5, 2.0, 5.0)
    skies = [looked(scene(), Pose(z=1.6, pitch=-30), plain(30.0, 0.0, mie_scattering_scale=v)) for v in values]
    rises([float(s[32, 37].mean()) for s in skies])  # 5 degrees from the sun
    rises([float(s[32, 37].mean() - s[4:8, :4].mean()) for s in skies])
    falls([far_contrast(plain(mie_scattering_scale=v)) for v in values])


@effect_of("rayleigh_scattering_scale")
@pytest.mark.slow
def test_rayleigh_scattering_makes_the_zenith_bluer_and_sunsets_redder() -> None:
    renderer = scene()
    values = (0.0, 0.0331, 0.3, 1.0, 2.0)
    zeniths = [looked(renderer, Pose(z=1.6, pitch=-80), plain(50.0, rayleigh_scattering_scale=v)) for v in values]
    rises([float(z[..., 2].mean() / z[..., 0].mean()) for z in zeniths])
    sunsets = [
        looked(renderer, Pose(z=1.6), plain(2.0, 0.0, rayleigh_scattering_scale=v))[22:30, 20:44] for v in values
    ]
    rises([float(s[..., 0].mean() / s[..., 2].mean()) for s in sunsets])


@effect_of("dust_storm")
@pytest.mark.slow
def test_dust_is_brown_and_hides_distant_surfaces() -> None:
    values = (0.0, 30.0, 60.0, 100.0)
    falls([far_contrast(plain(dust_storm=v)) for v in values], 0.05)
    skies = [looked(scene(), Pose(z=1.6, pitch=-10), plain(dust_storm=v))[:24] for v in values]
    rises([float(s[..., 0].mean() / s[..., 2].mean()) for s in skies], 0.05)


def test_every_parameter_has_a_test() -> None:
    assert tested == set(PARAMETERS)


@pytest.mark.slow
@pytest.mark.parametrize("hours", [(-90.0, -12.0, -6.0, 0.0, 6.0, 15.0, 45.0, 90.0)])
def test_exposure_depends_on_the_scene_and_not_on_history(hours: tuple[float, ...]) -> None:
    """Frames shaded before do not matter, and at no time of day is the picture black or overexposed."""
    renderer, seen = Renderer(street()), None
    seen = renderer.observe(CAMERA, EYE, parts_at())
    forth = {a: renderer.shade(seen, appearance(a), "street", 0, 0.0) for a in hours}
    back = {a: renderer.shade(seen, appearance(a), "street", 0, 0.0) for a in reversed(hours)}
    for altitude in hours:
        assert np.array_equal(forth[altitude], back[altitude])
        assert 18.0 < forth[altitude].mean() < 190.0
