"""The rain about a camera at one moment."""

from __future__ import annotations

from typing import Any

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.camera import rain_kernels
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.weather_light import Light
from recipe_runtime.render.scene.camera import world_from_view

_EXPOSURE_TIME = 1.0 / 45.0  # seconds during which a drop leaves its streak
_DROPS = 32000  # at precipitation 100, in a cube
_RAIN_CUBE = 26.0  # metres along its side
_RAIN_DEPTH = 15.0  # metres from the camera within which drops are drawn


def rain_at(world_from_sensor: Array, light: Light, time: float) -> Any:
    """The rain about a camera: drops fall at 7 m/s, and the wind carries them along the world's x and y."""
    eye, ahead = world_from_sensor[:, 3], world_from_sensor[:, 0]
    fall = [3.0 * light.wind, 5.0 * light.wind, -7.0]
    rows = world_from_view(world_from_sensor)
    streak = [sum(float(rows[r, c]) * fall[r] for r in range(3)) * _EXPOSURE_TIME for c in range(3)]
    shower = rain_kernels.Rain()
    shower.count, shower.cube, shower.depth = int(_DROPS * light.rain), _RAIN_CUBE, _RAIN_DEPTH
    shower.low = wp.vec3d(*(float(e + (0.36 * a - 0.5) * _RAIN_CUBE) for e, a in zip(eye, ahead, strict=True)))
    shower.eye, shower.fall, shower.streak = wp.vec3d(*map(float, eye)), wp.vec3d(*fall), wp.vec3f(*streak)
    shower.time, shower.cover = time, 0.85
    return shower


def streak_radiance(light: Light) -> Any:
    """The radiance of a drop's streak."""
    return light.air.fog_colour * 1.15 + light.air.overhead * (0.25 + 0.8 * light.night)
