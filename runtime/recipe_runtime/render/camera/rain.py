"""The rain near a camera at one time."""

from __future__ import annotations

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.atmosphere.weather_light import WeatherLight
from recipe_runtime.render.camera.rain_kernels import Rain
from recipe_runtime.render.device.arrays import set_fields
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.numeric.seeds import noise_key
from recipe_runtime.render.scene.camera import world_from_view

_EXPOSURE_TIME = 1.0 / 45.0  # seconds during which a drop leaves its streak
_DROPS = 32000  # at precipitation 100, in a cube
_RAIN_CUBE = 26.0  # metres along its side
_RAIN_DEPTH = 15.0  # metres from the camera within which drops are drawn


def rain_at(world_from_sensor: Array, light: WeatherLight, time: float, seed: int) -> Rain:
    """Return the struct `Rain` of a frame: drops fall at 7 m/s, and the wind carries them along x and y."""
    eye, ahead = world_from_sensor[:, 3], world_from_sensor[:, 0]
    fall = [3.0 * light.wind, 5.0 * light.wind, -7.0]
    rows = world_from_view(world_from_sensor)
    streak = [sum(float(rows[r, c]) * fall[r] for r in range(3)) * _EXPOSURE_TIME for c in range(3)]
    low = [float(e + (0.36 * a - 0.5) * _RAIN_CUBE) for e, a in zip(eye, ahead, strict=True)]
    return set_fields(
        Rain(),
        key=noise_key(seed, "rain", 0),
        count=drop_count(light),
        cube=_RAIN_CUBE,
        low=wp.vec3d(*low),
        eye=wp.vec3d(*map(float, eye)),
        time=time,
        fall=wp.vec3d(*fall),
        streak=wp.vec3f(*streak),
        depth=_RAIN_DEPTH,
        cover=0.7,
    )


def drop_count(light: WeatherLight) -> int:
    """Return the number of drops in the cube."""
    return int(_DROPS * light.rain)


def streak_radiance(light: WeatherLight) -> wp.vec3f:
    """Return the radiance of a drop's streak."""
    radiance: wp.vec3f = light.air.fog_colour * (1.15 + 0.6 * light.rain) + light.air.overhead * (
        0.25 + 0.8 * light.night
    )
    return radiance
