"""From weather and sun to light: the numbers of an appearance, worked out on the host by exact arithmetic.

Sunlight is white light dimmed by Rayleigh and Mie extinction along the air mass of Kasten and Young (1989). The sky's
brightness follows the sun's altitude through twilight. Fog's visual range V gives its extinction by Koschmieder's
law, 3.912 / V. Automatic exposure follows from these alone: never from a picture, never from the frame before.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler import exact
from recipe_compiler.plan import AppearancePlan, fixed

from recipe_runtime.render.air import DECAY_STEPS, HALO_ROWS, SKY_ROWS, Air
from recipe_runtime.render.device import wp

Colour = NDArray[np.float64]  # [3] linear RGB

DENSEST = 45.0  # metres seen at fog_density 100
LAMPS_ON, LAMPS_OFF = -1.0, 5.0  # sun altitudes, degrees, between which lamps fade

_BRIGHTNESS: tuple[tuple[float, float], ...] = (
    *((-90, 7e-5), (-18, 7e-5), (-12, 2e-4), (-6, 2.5e-3), (-3, 0.012), (0, 0.06)),
    *((5, 0.22), (15, 0.52), (45, 0.9), (90, 1.0)),
)  # of the sky, by the sun's altitude in degrees
_RAYLEIGH = np.array([0.052, 0.115, 0.245])  # optical depth of one air mass
_AEROSOL = np.array([0.8, 1.0, 1.35])  # haze takes more of the blue: Angstrom's law with an exponent of 1.3
_STREET_LIGHT = 1.0e-3  # what lamps give the eye to adapt to
_LAMPLIGHT = np.array([1.0, 0.8, 0.58])  # the colour of lamps' light, thrown about


@dataclass(frozen=True)
class Light:
    """What an appearance's light is, before it goes to a device."""

    air: Any
    sun: Colour  # unit, towards the sun
    sunlight: Colour
    exposure: float
    night: float
    rain: float  # 0 to 1
    wind: float  # 0 to 1


def direction(azimuth: float, altitude: float) -> Colour:
    """The unit vector towards a point of the sky, degrees."""
    sa, ca = exact.sin_cos_deg(azimuth)
    sh, ch = exact.sin_cos_deg(altitude)
    return np.array([ca * ch, sa * ch, sh])


def light_of(appearance: AppearancePlan, device: str) -> Light:
    """The light of an appearance at time 0."""
    w, altitude = appearance.weather, appearance.sun.altitude
    rain, fog = w.precipitation / 100.0, w.fog_density / 100.0
    dust = w.dust_storm / 100.0
    cover = 1.0 - (1.0 - w.cloudiness / 100.0) * (1.0 - 0.6 * rain)
    thick_fog = fog * fog
    shine = _shine(cover, rain, thick_fog, dust)
    night = 1.0 - _ease(LAMPS_ON, LAMPS_OFF, altitude)
    day = exact.exp(_between(_BRIGHTNESS, altitude))
    sun = direction(appearance.sun.azimuth, altitude)
    clear_sun = 5.6 * transmittance(altitude, w.mie_scattering_scale, w.rayleigh_scattering_scale)
    sunlight = clear_sun * shine
    zenith, horizon = _sky_colours(altitude, day, cover)
    scattered = clear_sun * max(float(sun[2]), 0.0) * (1.0 - shine) * 0.32
    overcast = (
        _mix(np.array([0.82, 0.9, 1.0]), np.array([0.62, 0.78, 1.12]), _ease(8.0, -2.0, altitude))
        * day
        * (0.95 - 0.35 * rain)
        * (1.0 - 0.3 * dust)
        + scattered
    )
    grey = _ease(0.25, 0.95, cover)
    overhead = _mix(_pale(0.54 * zenith + 0.33 * horizon, 0.5), overcast, grey)
    around = _mix(_pale(0.26 * zenith + 0.48 * horizon, 0.5), 0.62 * overcast, grey)
    falling = sunlight * max(float(sun[2]), 0.0) + overhead
    below = 0.25 * falling * np.array([1.0, 0.96, 0.9])
    walls = 0.05 * sunlight * (1.0 - max(float(sun[2]), 0.0))  # a low sun's light, thrown back by house fronts
    overhead = overhead + walls
    sideways = 0.5 * around + 0.5 * below + 0.2 * overhead + walls
    street = _STREET_LIGHT * night * (0.6 + 0.25 * cover) * _LAMPLIGHT  # clouds give a town its own glow back
    veil = _mix(overhead, around, 0.45) + 0.17 * street
    below, sideways, overhead = below + street, sideways + street, overhead + (0.3 + 0.3 * cover) * street
    air = Air()
    air.sun, air.sunlight = _vector(sun), _vector(sunlight)
    air.disc = _vector(clear_sun * 60.0 * shine)
    air.overhead, air.sideways, air.below = _vector(overhead), _vector(sideways), _vector(below)
    bright = overcast * 1.25 + sunlight * (0.16 + 0.2 * _ease(20.0, -2.0, altitude))
    air.cloud_bright = _vector(_mix(bright, overcast * 1.1, grey))
    air.cloud_dark = _vector(overcast * (0.78 - 0.2 * rain))
    air.cover = fixed(cover)
    air.stars = fixed(_ease(-6.0, -14.0, altitude) * (1.0 - cover)) * 2.0e-3
    _fill_fog(air, appearance, veil, sunlight, around)
    wet = max(w.wetness / 100.0, min(1.6 * rain, 1.0), 0.75 * w.precipitation_deposits / 100.0)
    air.wet, air.puddles = fixed(wet), fixed(w.precipitation_deposits / 100.0)
    air.night = fixed(night)
    air.seed = appearance.seed & 0xFFFFFFFF
    air.decay, air.gradient, air.halo = _tables(zenith, horizon, clear_sun * shine, altitude, day, device)
    lamps = _STREET_LIGHT * night
    # A low sun lights the tops of houses; the street, which the exposure is for, lies in their shade.
    open_street = 0.33 + 0.67 * _ease(4.0, 40.0, altitude)
    seen = sunlight * (max(float(sun[2]), 0.3) * open_street * _ease(-1.0, 1.0, altitude)) + 1.25 * overhead
    luminance = 0.2126 * float(seen[0]) + 0.7152 * float(seen[1]) + 0.0722 * float(seen[2]) + lamps
    dim = 1.0 - 0.3 * _ease(9.0, -3.0, altitude) + 0.95 * _ease(-4.0, -10.0, altitude)
    dim = dim - 0.1 * rain * (1.0 - night) - 0.06 * fog + 0.3 * night * max(rain, fog)
    exposure = dim * exact.power(luminance, -0.86)
    return Light(air, sun, sunlight, fixed(exposure), night, rain, w.wind_intensity / 100.0)


def drift(light: Light, time: float) -> None:
    """Move the clouds to where the wind has them at a time in seconds."""
    light.air.drift = wp.vec2f(fixed(0.004 * time * light.wind), fixed(0.002 * time * light.wind))


def transmittance(altitude: float, mie: float = 0.03, rayleigh: float = 0.0331) -> Colour:
    """The share of sunlight that reaches the ground, by colour; fades to 0 as the disc sets."""
    height = max(altitude, -1.5)
    sine = exact.sin_deg(height)
    mass = 1.0 / (sine + 0.50572 * exact.power(height + 6.07995, -1.6364))
    depth = _RAYLEIGH * (rayleigh / 0.0331) + (0.08 + 0.9 * mie) * _AEROSOL
    white = np.array([1.0, 1.03, 1.1])
    left: Colour = white * np.array([exact.exp(-float(d) * mass) for d in depth]) * _ease(-1.2, 0.8, altitude)
    return left


def extinction(fog_density: float) -> float:
    """Koschmieder's extinction, 1/m, of a fog density 0..100: visual range falls with its square, to 45 m."""
    return 3.912 / DENSEST * (fog_density / 100.0) * (fog_density / 100.0)


def _shine(cover: float, rain: float, thick_fog: float, dust: float) -> float:
    """The share of direct sunlight that clouds, rain, fog and dust let through."""
    clouds = 1.0 - _ease(0.1, 0.85, cover) * 0.95
    return clouds * (1.0 - 0.75 * rain) * exact.exp(-2.6 * thick_fog) * (1.0 - 0.6 * dust)


def _sky_colours(altitude: float, day: float, cover: float) -> tuple[Colour, Colour]:
    noon = _ease(-2.0, 26.0, altitude)
    deep = _ease(-4.0, -12.0, altitude)
    zenith = _mix(np.array([0.22, 0.34, 0.70]), np.array([0.26, 0.48, 0.98]), noon)
    horizon = _mix(np.array([1.0, 0.86, 0.84]), np.array([1.22, 1.38, 1.52]), noon)
    horizon = _mix(horizon, np.array([0.52, 0.5, 0.62]), deep)
    return zenith * day, horizon * day


def _fill_fog(air: Any, appearance: AppearancePlan, veil: Colour, sunlight: Colour, around: Colour) -> None:
    w = appearance.weather
    dust, rain = w.dust_storm / 100.0, w.precipitation / 100.0
    grains, mist = 0.05 * dust * dust, 0.009 * rain
    fog = extinction(w.fog_density)
    total = fog + grains + mist + 0.0004
    brown = np.array([1.0, 0.72, 0.45])
    colour = _mix(veil, veil * brown + 0.06 * sunlight * brown, grains / total)
    haze = _mix(around, colour, min((fog + grains) / (0.1 * mist + 0.004 + fog + grains), 1.0))
    air.fog = fixed(total)
    air.fog_start = fixed(min(w.fog_distance, 1000.0) if fog >= grains + mist else 0.0)
    air.fog_thin = fixed(0.1 * w.fog_falloff * fog / total)
    air.fog_colour = _vector(_pale(haze, 0.6) * (1.0 - 0.12 * w.fog_density / 100.0))
    air.fog_sun = _vector(0.4 * sunlight)


def _tables(
    zenith: Colour, horizon: Colour, shining: Colour, altitude: float, day: float, device: str
) -> tuple[Any, Any, Any]:
    decay = np.array([exact.exp(-i / 64.0) for i in range(DECAY_STEPS)])
    rise = np.arange(SKY_ROWS) / (SKY_ROWS - 1.0)  # square root of the direction's z
    share = (1.0 - rise) * (1.0 - rise) * (1.0 - 0.45 * rise)
    gradient = zenith + (horizon - zenith) * share[:, None]
    cosine = np.sqrt(np.arange(HALO_ROWS) / (HALO_ROWS - 1.0)) * 2.0 - 1.0
    g = 0.8
    x = 1.0 + g * g - 2.0 * g * cosine
    narrow = (1.0 - g * g) / (x * np.sqrt(x))
    warm = np.array([1.0, 0.46, 0.16]) * day * 3.4 * _ease(-9.0, -1.0, altitude) * _ease(22.0, 4.0, altitude)
    wide = (1.0 + cosine) * 0.5
    halo = 0.014 * narrow[:, None] * shining + (wide * wide * wide)[:, None] * warm
    return (
        wp.array(decay.astype(np.float32), dtype=wp.float32, device=device),
        wp.array(_round(gradient), dtype=wp.vec3f, device=device),
        wp.array(_round(halo), dtype=wp.vec3f, device=device),
    )


def _ease(start: float, end: float, x: float) -> float:
    t = min(max((x - start) / (end - start), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def _pale(colour: Colour, share: float) -> Colour:
    """A colour with a share of its saturation taken."""
    return colour + (float(colour[0] + colour[1] + colour[2]) / 3.0 - colour) * share


def _mix(a: Colour, b: Colour, t: float) -> Colour:
    return a + (b - a) * t


def _between(points: tuple[tuple[float, float], ...], x: float) -> float:
    """The logarithm of a positive curve through points, straight between them."""
    for (x0, y0), (x1, y1) in pairwise(points):
        if x <= x1:
            t = max((x - x0) / (x1 - x0), 0.0)
            return exact.log(y0) + (exact.log(y1) - exact.log(y0)) * t
    return exact.log(points[-1][1])


def _vector(colour: Colour) -> Any:
    """A kernel's vector, its components rounded to 12 places (light at night is small)."""
    return wp.vec3f(*(round(float(c), 12) for c in colour))


def _round(table: NDArray[np.float64]) -> NDArray[np.float32]:
    return (np.floor(table * 1e12 + 0.5) / 1e12).astype(np.float32)
