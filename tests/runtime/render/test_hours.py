"""Times of day in every town: the lower the sun, the darker the picture, until lamps light the night."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from recipe_compiler.ir.plan import CameraPlan, CameraResponse, Pose, Sun
from recipe_compiler.library import blueprints, towns
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.loading import compiled
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.meshes.mesh import Body, Light, Pattern
from recipe_runtime.render.atmosphere.weather_light import initial_light
from recipe_runtime.render.lighting.lights import lamplight
from recipe_runtime.render.renderer import Renderer
from recipe_runtime.render.scene.geometry import Geometry

from tests.runtime.meshes.test_meshes import plan
from tests.runtime.render.street import PANES, appearance, box
from tests.sources import ROOT

LOW = Pose(x=1.5, y=14, z=1.6, yaw=84, pitch=2)  # in a lane
NOBODY = np.zeros((0, 3, 4))
HOURS = (15.0, 9.0, 5.0, 3.0, 1.0, 0.0, -2.0, -4.0, -6.0, -8.0, -10.0, -13.0, -20.0, -90.0)
STEP, RISE = 3.0, 6.0  # how many of 255 levels a picture may brighten by, from one hour to the next and in total
# In one town all weathers, in the others two: how a weather dims the sun and the sky does not depend on the town.
WEATHERS: dict[str, dict[str, float]] = {
    "clear": {"cloudiness": 10.0, "precipitation": 0.0, "fog_density": 0.0},
    "rain": {"cloudiness": 80.0, "precipitation": 60.0, "precipitation_deposits": 60.0, "wetness": 80.0},
    "downpour": {"cloudiness": 100.0, "precipitation": 100.0, "precipitation_deposits": 90.0, "wetness": 100.0},
    "dust": {"cloudiness": 10.0, "precipitation": 0.0, "fog_density": 0.0, "dust_storm": 100.0},
    "fog": {"cloudiness": 40.0, "precipitation": 0.0, "fog_density": 70.0, "fog_distance": 0.0},
}


@pytest.mark.slow
@pytest.mark.parametrize("town", towns.NAMES)
def test_dusk_is_darker_than_day_and_night_than_dusk(town: str) -> None:
    variant = compiled(ROOT / f"recipes/towns/{town}.yaml").variants[0]
    sensor = variant.rig.sensors[0]
    camera = sensor.camera.model_copy(update={"width": 96, "height": 64})
    renderer = Renderer(town_bodies(variant.scene.town))
    pose = LOW if town == "downtown" else sensor.pose(0)  # the recipe's camera looks down at places lit by lamps
    seen = renderer.observe(camera, from_pose(pose), NOBODY)
    calm = {sensor.name: CameraResponse(noise=0.0)}
    names = WEATHERS if town == "downtown" else ("clear", "fog")
    lights: dict[str, list[float]] = {name: [] for name in names}
    for altitude in HOURS:  # the outer loop: a renderer keeps the shadow maps of few sun directions
        for name in names:
            given = variant.appearance.weather.model_copy(update=WEATHERS[name])
            reported = {"weather": given, "sun": Sun(azimuth=30.0, altitude=altitude), "responses": calm}
            look = variant.appearance.model_copy(update=reported)
            lights[name].append(float(renderer.shade(seen, look, sensor.name, 0, 0.0).mean()))
    for name, light in lights.items():
        assert all(later <= earlier + STEP for earlier, later in pairwise(light)), (name, light)
        assert all(value <= min(light[: n + 1]) + RISE for n, value in enumerate(light)), (name, light)
        evening, dusk, night = light[2], light[HOURS.index(-2.0)], light[-1]
        assert (8.0 if name == "dust" else 18.0) < night < dusk < evening, (name, light)


@pytest.mark.slow
def test_the_number_of_lit_windows_grows_at_dusk() -> None:
    wall = Renderer([Body("wall", 0, (("s", box([20, -20, 0], [21, 20, 20], PANES)),))])
    seen = wall.observe(CameraPlan(width=160, height=80, fov=90), from_pose(Pose(z=10.0)), NOBODY)
    shares = []
    for altitude in (6.0, 4.0, 2.0, 0.0, -2.0):
        look = appearance(altitude, 0.0, {"wall": {"window": "#d8d4cc"}}, cloudiness=0.0)
        other = look.model_copy(update={"seed": 4})  # (other windows are drawn)
        one, two = (wall.radiance(seen, drawn)[..., 0] for drawn in (look, other))
        shares.append(float((np.abs(one - two) > 0.1 * np.median(one)).mean()))
    assert shares[0] == 0.0
    assert all(later > earlier for earlier, later in pairwise(shares)), shares
    assert shares[-1] > 0.1


def test_light_sources_are_neither_dim_at_dusk_nor_overexposed() -> None:
    """From sunset on, a window is nearly as bright as at night, and a traffic light is never overexposed."""
    lights = [initial_light(appearance(altitude), "cpu") for altitude in (-1.0, -4.0, -8.0, -14.0, -60.0)]
    shown = [light.air.emissive_gain * light.exposure() for light in lights]
    assert max(shown) < 2.5 * min(shown)
    for light in [initial_light(appearance(altitude), "cpu") for altitude in (60.0, 5.0)] + lights:
        assert 0.05 < light.air.signal * light.exposure() < 0.95


def test_a_street_without_lamps_has_a_longer_exposure() -> None:
    def lamps(count: int) -> Geometry:
        lit = tuple(Light((4.0 * k, 5.0, 6.0), (0.0, 0.0, -1.0), (1.0, 0.8, 0.6), 1400.0, 0.25) for k in range(count))
        return Renderer([Body("wall", 0, (("s", box([0, 5, 0], [1, 6, 6], PANES, lit)),))])._geometry

    eye, night = np.array([0.0, 0.0, 1.6]), initial_light(appearance(-30.0), "cpu")
    light = [lamplight(lamps(count), eye, NOBODY) for count in (0, 1, 3, 6, 12)]
    assert light == sorted(light)
    assert light[0] < 0.5 < light[-1]
    gains = [night.exposure(level) for level in light]
    assert gains == sorted(gains, reverse=True)
    near, past = (lamplight(lamps(6), eye + np.array([dx, 0.0, 0.0]), NOBODY) for dx in (0.0, 1.0))
    assert abs(past - near) < 0.06 * near  # one metre on, the exposure hardly changes
    noon = initial_light(appearance(60.0), "cpu")
    assert noon.exposure(0.3) == noon.exposure(2.0)


@pytest.mark.parametrize("car", [b for b in blueprints.LIBRARY if blueprints.parks(b)], ids=lambda b: b.id)
def test_only_a_driving_car_has_its_lights_on(car: blueprints.Blueprint) -> None:
    parked, driven = (actor_body(plan(car).model_copy(update={"speed": speed})) for speed in (0.0, 8.0))
    assert sum(len(mesh.lights) for _, mesh in driven.parts) == 2
    assert sum(len(mesh.lights) for _, mesh in parked.parts) == 0
    shining = {Pattern.HEADLIGHT, Pattern.TAILLIGHT, Pattern.LAMP}
    shown = [{s.pattern for _, mesh in body.parts for s in mesh.surfaces} & shining for body in (driven, parked)]
    assert shown[0] >= {Pattern.HEADLIGHT, Pattern.TAILLIGHT} and shown[1] == set()
