"""The sky in the large: clouds and their shadows, the share of the sky that a town leaves, and the hills around it."""

from typing import no_type_check

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.horizon import hills
from recipe_runtime.meshes.mesh import Body, Pattern, Surface
from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.atmosphere.clouds import cloud_shadow, cumulus
from recipe_runtime.render.atmosphere.weather_light import initial_light
from recipe_runtime.render.device.arrays import DeviceArray, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.renderer import Renderer
from recipe_runtime.render.scene.geometry import upload
from recipe_runtime.render.shadows.sky_grid import sky_grid
from recipe_runtime.render.shadows.sky_grid_kernels import SkyGrid, sky_share

from tests.runtime.render.street import CAMERA, EYE, appearance, box, ground, parts_at, street

wp.set_module_options(OPTIONS)
GREY = Surface("grey", Pattern.PLAIN, 3)
FLOOR = Surface("grey", Pattern.PLAIN, 1)


@wp.kernel
@no_type_check
def cloud_and_shadow(air: wp.array[Air], places: wp.array[wp.vec3f], out: wp.array[wp.vec2f]) -> None:
    """Write the thickness of the cloud between a place and the sun, and the sunlight that its shadow leaves."""
    p = places[wp.tid()]
    out[wp.tid()] = wp.vec2f(cumulus(air, p, air[0].sun, 0.0)[0], cloud_shadow(air, p))


@wp.kernel
@no_type_check
def shares(grid: wp.array[SkyGrid], places: wp.array[wp.vec3f], normal: wp.vec3f, out: wp.array[wp.float32]) -> None:
    """Write the share of the sky at places with a normal."""
    out[wp.tid()] = sky_share(grid, places[wp.tid()], normal)


def vectors(rows: NDArray[np.float64]) -> DeviceArray:
    """Upload points."""
    found: DeviceArray = wp.array(rows.astype(np.float32), dtype=wp.vec3f, device="cpu")
    return found


def test_the_shadow_of_a_cloud_lies_where_the_cloud_hides_the_sun() -> None:
    light = initial_light(appearance(40.0, cloudiness=38), "cpu")
    places = np.array([(x, y, 0.0) for x in range(-6000, 6000, 400) for y in range(-6000, 6000, 400)], float)
    out = wp.zeros(len(places), dtype=wp.vec2f, device="cpu")
    launch(cloud_and_shadow, len(places), "cpu", air=struct_array([light.air], "cpu"), places=vectors(places), out=out)
    thick, left = out.numpy().T
    lowest = 1.0 - float(light.air.cloud_shadow)
    assert 0.1 < (thick > 0.9).mean() < 0.9  # there are clouds, and there is sun
    assert left[thick > 0.9].mean() < lowest + 0.25 * (1.0 - lowest)
    assert left[thick == 0.0].mean() > 0.9


def test_an_overcast_and_a_clear_sky_cast_no_cloud_shadows() -> None:
    assert [float(initial_light(appearance(40.0, cloudiness=c), "cpu").air.cloud_shadow) for c in (5, 100)] == [0, 0]


@pytest.mark.parametrize("far", [4.0, 12.0, 25.0])
def test_the_sky_above_ground_beside_a_long_wall_follows_the_integral(far: float) -> None:
    """The oracle sums the cosine-weighted sky over all azimuths: 1 / (1 + (h cos a / d)^2) on the side of the wall."""
    wall = box([0.0, -300.0, 0.0], [8.0, 300.0, 9.0], GREY)
    bodies = [Body("ground", 0, (("static", ground(400.0, FLOOR)),)), Body("wall", 0, (("static", wall),))]
    grid = sky_grid(upload(bodies, "cpu"), "cpu")
    out = wp.zeros(1, dtype=wp.float32, device="cpu")
    place = vectors(np.array([(-far, 0.0, 0.1)]))
    launch(shares, 1, "cpu", grid=grid, places=place, normal=wp.vec3f(0.0, 0.0, 1.0), out=out)
    cosine = np.cos((np.arange(4000) + 0.5) / 4000 * np.pi - np.pi / 2)
    slope = 8.5 * cosine / far
    assert float(out.numpy()[0]) == pytest.approx(0.5 + 0.5 * float((1.0 / (1.0 + slope * slope)).mean()), abs=0.09)


def test_a_scene_without_houses_sees_the_whole_sky() -> None:
    grid = sky_grid(upload([Body("ground", 0, (("static", ground(50.0, FLOOR)),))], "cpu"), "cpu")
    out = wp.zeros(1, dtype=wp.float32, device="cpu")
    up = wp.vec3f(0.0, 0.0, 1.0)
    launch(shares, 1, "cpu", grid=grid, places=vectors(np.zeros((1, 3))), normal=up, out=out)
    assert out.numpy()[0] == 1.0


def test_moving_cloud_shadows_leave_reused_frames_equal_to_fresh_ones() -> None:
    weather = appearance(40.0, cloudiness=38, wind_intensity=100)
    one = Renderer(street())
    pictures = []
    for n, time in enumerate((0.0, 1.0, 3.9, 4.0, 4.5, 60.0)):
        fresh = Renderer(street())
        reused, new = (r.shade(r.observe(CAMERA, EYE, parts_at()), weather, "street", n, time) for r in (one, fresh))
        np.testing.assert_array_equal(reused, new)
        pictures.append(one.radiance(one.observe(CAMERA, EYE, parts_at()), weather, time))
    assert np.abs(pictures[-1] - pictures[0]).max() > 0.01  # something moved


def test_hills_close_around_a_town_and_leave_a_road_free() -> None:
    closed, open_ = Builder(), Builder()
    hills(closed, 0.0)
    hills(open_, 35.0)
    for builder, gap in ((closed, 0.0), (open_, 35.0)):
        points = builder.mesh().vertices.astype(float)
        crest = points[points[:, 2] > 0.0]
        assert np.hypot(points[:, 0], points[:, 1]).min() > 600.0
        assert (np.abs(crest[:, 0]) >= gap).all()
    points = closed.mesh().vertices.astype(float)
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0])[points[:, 2] > 4.0])
    assert np.diff(angles).max() < 0.02  # radians: no gap
