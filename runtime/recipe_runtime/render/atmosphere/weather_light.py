"""From weather and sun to light: the parameters of an appearance, computed on the host with exact arithmetic.

Sunlight is white light attenuated by Rayleigh and Mie extinction along the air mass of Kasten and Young (1989). The
extinction of fog follows from its visual range V by Koschmieder's law, 3.912 / V. Automatic exposure follows from these
and from the street lamps near a camera, never from a picture or an earlier frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import AppearancePlan, Weather
from recipe_compiler.ir.plan_types import fixed

from recipe_runtime.render.atmosphere import sky
from recipe_runtime.render.atmosphere.air import DECAY_STEPS, SKY_ROWS, SWAY_STEPS, Air
from recipe_runtime.render.atmosphere.sky import MIE, RAYLEIGH, Colour, Haze, haze_of
from recipe_runtime.render.device.arrays import copy_struct, set_fields
from recipe_runtime.render.device.setup import wp

MIN_VISUAL_RANGE = 45.0  # visual range in metres at fog_density 100
LAMPS_ON, LAMPS_OFF = -1.0, 5.0  # sun altitudes, degrees, between which lamps fade
RUNNING_OFF_ON = 11.0, 6.0  # sun altitudes, degrees, between which vehicles turn on their lamps
_FOG_LAYER = 120.0  # metres, the height of fog that does not thin upward
_DOWNWARD = 0.6  # share of the light that fog scatters which reaches the ground
_MOLECULES = np.array([0.052, 0.115, 0.245])  # optical depth of one air mass
_AEROSOL = np.array([0.8, 1.0, 1.35])  # relative, by colour: Angstrom's law with an exponent of 1.3
_STREET_LIGHT = 1.0e-3  # light of lamps to which exposure adapts
_NIGHT_GAIN = 400.0  # the gain of exposure in a clear night
_SIGNAL, _SIGNAL_SHOWN = 0.35, 0.9  # radiance of a traffic light, and its maximum after exposure
_LAMPLIGHT = np.array([1.0, 0.8, 0.58])  # colour of the scattered light of lamps
_DUST = np.array([1.0, 0.60, 0.30])
_WIND = (0.514, 0.857)  # direction of the wind, as of rain
_CLOUD_SPEED = 14.0  # metres per second in a storm
_CLOUD_STEPS, _SHADOW_STEPS = 2.0, 0.25  # per second
_RING_STEPS = 12  # per second; a patch of ground changes its rings at every fourth
_LEAF_STEPS = 30  # per second; leaves at a place move at every fourth
_SWAY, _GUST_SPEED = 0.16, 0.9  # amplitude of leaves in a storm, metres; speed of gusts, metres per second
_GLOW_ENDS, _GLOW_SEEN = 70.0, 0.001  # maximum distance in metres, and minimum extinction, of visible glow
_CLEAR_AIR = 0.0006  # extinction of air without fog, 1/m
_RAIN_HAZE = 0.004  # extinction of heavy rain, 1/m: a visual range of 1 km


@dataclass(frozen=True)
class WeatherLight:
    """The light of an appearance: values for the host, and the struct `Air` for kernels."""

    air: Any
    sun: Colour  # unit, towards the sun
    sunlight: Colour
    daylight: float  # light of sun and sky to which exposure adapts
    lamplight: float  # light of lamps, in a typical street
    response: float  # target brightness of the picture
    night: float
    rain: float  # 0 to 1
    wind: float  # 0 to 1
    # drift and shadow_drift (x and y each), ring_step and leaf_step of `air`
    moved: tuple[float, float, float, float, int, int] = (0.0, 0.0, 0.0, 0.0, 0, 0)

    @property
    def sun_shines(self) -> bool:
        """Whether the sun casts shadows."""
        return bool(self.sun[2] > 0.0 and float(self.sunlight.max()) > 0.0)

    @property
    def lamps_burn(self) -> bool:
        """Whether lamps illuminate anything, or glow in fog."""
        return bool(self.air.night > 0.0 or self.air.glow_share > 0.0)

    @property
    def wet(self) -> bool:
        """Whether the ground reflects."""
        return bool(self.air.wet > 0.0)

    def exposure(self, lamps: float = 1.0) -> float:
        """Return the gain of automatic exposure; `lamps` is the light of lamps relative to a typical street."""
        return fixed(self.response * exact.power(self.daylight + self.lamplight * lamps, -0.86))


@dataclass(frozen=True)
class _State:
    """The weather as fractions, and what follows from it and the sun's altitude."""

    weather: Weather
    altitude: float
    sun: Colour
    haze: Haze
    rain: float
    fog: float
    dust: float
    cover: float  # cloud cover
    grey: float  # degree of overcast
    shine: float  # share of direct sunlight that clouds, rain, fog and dust transmit
    scattered: float  # share of it that fog scatters
    night: float
    day: float  # brightness of the sky


@dataclass(frozen=True)
class _Irradiance:
    """Light on surfaces that face up, sideways and down, and the colours of fog and overcast skies."""

    overhead: Colour
    sideways: Colour
    below: Colour
    around: Colour  # of the sky near the horizon
    overcast: Colour
    veil: Colour  # of thick fog


def direction(azimuth: float, altitude: float) -> Colour:
    """Return the unit vector towards a point of the sky, from angles in degrees."""
    sa, ca = exact.sin_cos_deg(azimuth)
    sh, ch = exact.sin_cos_deg(altitude)
    return np.array([ca * ch, sa * ch, sh])


def initial_light(appearance: AppearancePlan, device: str) -> WeatherLight:
    """Return the light of an appearance at time 0."""
    w = appearance.weather
    s = _state_of(appearance)
    clear_sun = 5.6 * transmittance(s.altitude, w.mie_scattering_scale, w.rayleigh_scattering_scale)
    sunlight = clear_sun * s.shine
    irradiance = _irradiance(s, clear_sun)
    air, warm = Air(), sky.warmth(s.altitude, s.haze)
    glow = 0.09 * _STREET_LIGHT * s.night * _LAMPLIGHT  # clouds reflect the light of the town
    bright = 0.82 * irradiance.overcast + 0.12 * sunlight + 0.7 * warm
    set_fields(
        air,
        sun=_vector(s.sun),
        sunlight=_vector(sunlight),
        disc=_vector(sunlight * 60.0),
        overhead=_vector(irradiance.overhead),
        sideways=_vector(irradiance.sideways),
        below=_vector(irradiance.below),
        cloud_bright=_vector(_mix(bright, irradiance.overcast * (0.88 - 0.16 * s.rain) + 0.4 * warm, s.grey) + glow),
        cloud_dark=_vector(irradiance.overcast * (0.5 - 0.06 * s.rain) + 0.2 * warm + 0.5 * glow),
        cover=fixed(s.cover),
        cloud_shadow=fixed(0.5 * _smoothstep(0.1, 0.3, s.cover) * _smoothstep(0.6, 0.4, s.cover)),
        stars=fixed(_smoothstep(-6.0, -14.0, s.altitude) * (1.0 - s.cover)) * 6.0e-3,
        warm=_vector(warm * (1.0 - 0.9 * s.grey)),
        wet=fixed(max(w.wetness / 100.0, min(1.6 * s.rain, 1.0), 0.9 * w.precipitation_deposits / 100.0)),
        puddles=fixed(w.precipitation_deposits / 100.0),
        night=fixed(s.night),
        running=fixed(_running(s)),
        ring_strength=fixed(0.035 * s.rain),
        leaf_motion=fixed(min(1.0, w.wind_intensity / 60.0)),
        gust_shift=fixed(_GUST_SPEED / _LEAF_STEPS * w.wind_intensity / 100.0),
        seed=appearance.seed & 0xFFFFFFFF,
    )
    _set_fog(air, s, irradiance, sunlight)
    _set_tables(air, s, device)
    daylight, response = _daylight(s, sunlight, irradiance.overhead), _response(s)
    lamplight = _STREET_LIGHT * s.night
    light = WeatherLight(air, s.sun, sunlight, daylight, lamplight, response, s.night, s.rain, w.wind_intensity / 100.0)
    # A picture has less dynamic range than the eye: emitters keep their displayed brightness as all else dims.
    gain = light.exposure()
    set_fields(
        air, emissive_gain=fixed(exact.power(_NIGHT_GAIN / gain, 0.8)), signal=fixed(min(_SIGNAL, _SIGNAL_SHOWN / gain))
    )
    return light


def light_at_time(light: WeatherLight, time: float) -> WeatherLight:
    """Return the light with clouds, leaves and rings on the water at a time in seconds.

    It is the same object if none of these has changed.
    """
    moved = _moved(light, time)
    if light.moved == moved:
        return light
    air = copy_struct(light.air)
    _set_moved(air, moved)
    return replace(light, air=air, moved=moved)


def move_air(air: Air, light: WeatherLight, time: float) -> None:
    """Set the clouds, leaves and rings of a light's air in place, to those of a time in seconds."""
    _set_moved(air, _moved(light, time))


def _moved(light: WeatherLight, time: float) -> tuple[float, float, float, float, int, int]:
    """Return the drift of the clouds and of their shadows, and the steps of rings and leaves, at a time in seconds."""
    # Clouds move in steps too small to see; between steps a static camera reuses its sky.
    # Their shadows move in larger steps, at each of which all light of the ground is computed again.
    moved = _CLOUD_SPEED * light.wind * int(_CLOUD_STEPS * time) / _CLOUD_STEPS
    shadow = _CLOUD_SPEED * light.wind * int(_SHADOW_STEPS * time) / _SHADOW_STEPS
    shadow = shadow if light.air.cloud_shadow > 0.0 else 0.0
    ring_step = int(_RING_STEPS * time) if light.rain > 0.0 else 0
    leaf_step = int(_LEAF_STEPS * time + 1e-6) if light.air.leaf_motion > 0.0 else 0
    along, across = _WIND
    drift, cast = (fixed(along * moved), fixed(across * moved)), (fixed(along * shadow), fixed(across * shadow))
    return *drift, *cast, ring_step, leaf_step


def _set_moved(air: Air, moved: tuple[float, float, float, float, int, int]) -> None:
    drift, shadow = wp.vec2f(*moved[:2]), wp.vec2f(*moved[2:4])
    set_fields(air, drift=drift, shadow_drift=shadow, ring_step=moved[4], leaf_step=moved[5])


def transmittance(altitude: float, mie: float = MIE, rayleigh: float = RAYLEIGH) -> Colour:
    """Return the share of sunlight that reaches the ground, by colour; it fades to 0 as the disc sets."""
    haze = haze_of(mie, rayleigh)
    white = np.array([1.0, 1.03, 1.1])
    # Evening light is redder, by dust.
    golden = _mix(np.ones(3), np.array([1.08, 0.86, 0.58]), _smoothstep(28.0, 8.0, altitude))
    left: Colour = golden * white * _attenuation(altitude, _MOLECULES * haze.rayleigh + haze.mie * _AEROSOL)
    # A camera's white balance follows the light of evening, but not all the way.
    left = _desaturate(left, 0.5 * _smoothstep(14.0, 3.0, altitude))
    return left * _smoothstep(-1.2, 0.8, altitude)


def extinction(fog_density: float) -> float:
    """Return the extinction coefficient, 1/m, of a fog density 0 to 100: the visual range falls to 45 m."""
    return 3.912 / MIN_VISUAL_RANGE * (fog_density / 100.0) * (fog_density / 100.0)


def _attenuation(altitude: float, depth: Colour) -> Colour:
    """Return the share of light from an altitude in degrees that is left by an optical depth per air mass."""
    height = max(altitude, -1.5)
    mass = 1.0 / (exact.sin_deg(height) + 0.50572 * exact.power(height + 6.07995, -1.6364))
    return np.array([exact.exp(-float(d) * mass) for d in depth])


def _state_of(appearance: AppearancePlan) -> _State:
    w, altitude = appearance.weather, appearance.sun.altitude
    rain, fog, dust = w.precipitation / 100.0, w.fog_density / 100.0, w.dust_storm / 100.0
    cover = 1.0 - (1.0 - w.cloudiness / 100.0) * (1.0 - 0.6 * rain)
    clouds = 1.0 - _smoothstep(0.1, 0.85, cover) * 0.95
    clear, direct = clouds * (1.0 - 0.75 * rain) * (1.0 - 0.6 * dust), _through_fog(w, altitude)
    return _State(
        weather=w,
        altitude=altitude,
        sun=direction(appearance.sun.azimuth, altitude),
        haze=haze_of(w.mie_scattering_scale, w.rayleigh_scattering_scale),
        rain=rain,
        fog=fog,
        dust=dust,
        cover=cover,
        grey=_smoothstep(0.25, 0.95, cover),
        shine=clear * direct,
        scattered=clear * (1.0 - direct),
        night=1.0 - _smoothstep(LAMPS_ON, LAMPS_OFF, altitude),
        day=sky.brightness(altitude),
    )


def _through_fog(w: Weather, altitude: float) -> float:
    """Return the share of direct sunlight that the fog above a street transmits; the rest becomes diffuse light."""
    layer = min(10.0 / max(w.fog_falloff, 1e-6), _FOG_LAYER)  # metres, e-folding height of the density
    slant = max(exact.sin_deg(max(altitude, 0.0)), 0.1)
    # Drops diffract half of what they extinguish, half of that by little more than the sun's radius: it casts shadows.
    return exact.exp(-0.75 * extinction(w.fog_density) * layer / slant)


def _irradiance(s: _State, clear_sun: Colour) -> _Irradiance:
    sunlight, up = clear_sun * s.shine, max(float(s.sun[2]), 0.0)
    zenith, horizon = _ambient_colours(s.altitude, s.day)
    evening = _smoothstep(24.0, 8.0, s.altitude) * _smoothstep(-4.0, 4.0, s.altitude)
    tint = _mix(np.array([0.82, 0.9, 1.0]), np.array([0.62, 0.78, 1.12]), _smoothstep(8.0, -2.0, s.altitude))
    tint = _mix(tint, np.array([1.02, 0.80, 0.60]), evening)
    overcast = tint * (s.day * (0.95 - 0.35 * s.rain) * (1.0 - 0.3 * s.dust))
    overcast = overcast + clear_sun * (up * (1.0 - s.shine) * 0.32)
    overhead = _mix(_desaturate(0.54 * zenith + 0.33 * horizon, 0.5), overcast, s.grey)
    around = _mix(_desaturate(0.26 * zenith + 0.48 * horizon, 0.5), 0.62 * overcast, s.grey)
    scattered = clear_sun * (up * _DOWNWARD * s.scattered)
    overhead, around = overhead + scattered, around + 0.7 * scattered
    below = 0.25 * (sunlight * up + overhead) * np.array([1.0, 0.96, 0.9])
    # Light of a low sun, reflected by house fronts: most of it comes from walls in the shade.
    walls = 0.035 * _desaturate(sunlight, 0.6) * (1.0 - up)
    overhead = overhead + walls
    sideways = 0.5 * around + 0.5 * below + 0.2 * overhead + walls
    # Clouds reflect the light of the town.
    street = _STREET_LIGHT * s.night * (0.6 + 0.25 * s.cover) * _LAMPLIGHT
    lifted = overhead + (0.3 + 0.3 * s.cover) * street
    veil = _mix(overhead, around, 0.45) + 0.1 * street
    return _Irradiance(lifted, sideways + street, below + street, around, overcast, veil)


def _ambient_colours(altitude: float, day: float) -> tuple[Colour, Colour]:
    """Return the light of zenith and horizon on surfaces, which is less saturated than their visible colours."""
    noon = _smoothstep(-2.0, 26.0, altitude)
    zenith = _mix(np.array([0.22, 0.34, 0.70]), np.array([0.26, 0.48, 0.98]), noon)
    horizon = _mix(np.array([0.94, 0.88, 0.92]), np.array([1.22, 1.38, 1.52]), noon)
    horizon = _mix(horizon, np.array([0.52, 0.5, 0.62]), _smoothstep(-4.0, -12.0, altitude))
    return zenith * day, horizon * day


def _set_fog(air: Any, s: _State, irradiance: _Irradiance, sunlight: Colour) -> None:
    """Set fog, which begins at its distance and thins with height, and haze by rain, dust and air, which is uniform."""
    w = s.weather
    grains, mist = 0.05 * s.dust * s.dust, _RAIN_HAZE * s.rain
    fog, aerosol = extinction(w.fog_density), 0.0001 + 0.0006 * max(s.haze.mie - 0.107, 0.0)
    haze = grains + mist + aerosol
    air.fog, air.haze, air.clear_air = fixed(fog), fixed(haze), fixed(_CLEAR_AIR)
    air.fog_start, air.fog_falloff = fixed(min(w.fog_distance, 1000.0)), fixed(0.1 * w.fog_falloff)
    thick = (fog + grains) / (0.1 * mist + 0.004 + fog + grains)
    dense = _desaturate(_mix(irradiance.around, irradiance.veil, thick), 0.6) * (1.0 - 0.12 * s.fog)
    blue = _mix(sky.gradient(s.altitude, s.haze)[0], 0.8 * irradiance.overcast, s.grey)  # aerial perspective
    dense = dense * (1.0 - 0.25 * s.rain * (1.0 - s.night))  # rain clouds are darker than fog
    plain = _mix(blue, dense, (fog + mist) / (0.002 + fog + mist))
    brown = 0.9 * (irradiance.veil + 0.10 * sunlight) * _DUST
    air.fog_colour = _vector(_mix(plain, brown, grains / (grains + fog + mist + 0.002)))
    scattering = exact.power(w.scattering_intensity, 0.35)  # 1 at CARLA's usual 1, 5 at 100
    about_sun = (0.08 + 0.32 * thick) * sunlight
    about_sun = about_sun + 0.9 * (1.0 - exact.exp(-0.5 * max(s.haze.mie - 0.107, 0.0))) * _unhazed(s)
    air.fog_sun = _vector(scattering * about_sun)
    murk = haze + (fog if w.fog_distance < _GLOW_ENDS else 0.0)
    air.glow_share = fixed(0.25 * scattering * s.night) if murk * scattering > _GLOW_SEEN else 0.0


def _set_tables(air: Any, s: _State, device: str) -> None:
    decay = np.array([exact.exp(-i / 64.0) for i in range(DECAY_STEPS)])
    air.decay = wp.array(decay.astype(np.float32), dtype=wp.float32, device=device)
    mean_decay = [1.0, *((1.0 - value) * 64.0 / i for i, value in enumerate(decay[1:], start=1))]
    air.mean_decay = wp.array(np.array(mean_decay, np.float32), dtype=wp.float32, device=device)
    reach, turns = _SWAY * s.weather.wind_intensity / 100.0, [360.0 * i / SWAY_STEPS for i in range(SWAY_STEPS)]
    sway = np.array([exact.sin_cos_deg(turn) for turn in turns]) * reach
    air.sway = wp.array(_round(sway), dtype=wp.vec2f, device=device)
    rise = np.arange(SKY_ROWS)[:, None] / (SKY_ROWS - 1.0)
    town = 0.045 * _STREET_LIGHT * s.night * _LAMPLIGHT * (0.25 + 0.75 * (1.0 - rise) * (1.0 - rise))
    air.gradient = wp.array(_round(sky.gradient(s.altitude, s.haze) + town), dtype=wp.vec3f, device=device)
    air.halo = wp.array(_round(sky.halo(s.haze, _unhazed(s))), dtype=wp.vec3f, device=device)


def _unhazed(s: _State) -> Colour:
    """Return the sunlight before haze; light that additional molecules scatter stays in the sky."""
    return (
        5.6
        * s.shine
        * _attenuation(s.altitude, _MOLECULES * min(s.haze.rayleigh, 1.0))
        * _smoothstep(-1.2, 0.8, s.altitude)
    )


def _running(s: _State) -> float:
    """Return how bright the head and tail lamps of vehicles are, 0 to 1: on from dusk, in rain, fog and dust."""
    murk = max(_smoothstep(0.08, 0.25, s.rain), _smoothstep(0.15, 0.3, s.fog), _smoothstep(0.1, 0.3, s.dust))
    return max(murk, _smoothstep(*RUNNING_OFF_ON, s.altitude))


def _daylight(s: _State, sunlight: Colour, overhead: Colour) -> float:
    """Return the light of sun and sky to which a camera in a street adapts."""
    # A low sun illuminates the tops of houses; the street, for which the picture is exposed, is in their shade.
    open_street = 0.33 + 0.67 * _smoothstep(4.0, 40.0, s.altitude)
    seen = sunlight * (max(float(s.sun[2]), 0.3) * open_street * _smoothstep(-1.0, 1.0, s.altitude)) + 1.25 * overhead
    return 0.2126 * float(seen[0]) + 0.7152 * float(seen[1]) + 0.0722 * float(seen[2])


def _response(s: _State) -> float:
    """Return the target brightness of a picture: lower at dusk than by day, and in a street at night than at dusk."""
    deep = _smoothstep(-3.0, -13.0, s.altitude)
    clear = 1.0 - 0.12 * _smoothstep(30.0, 12.0, s.altitude) - 0.2 * _smoothstep(9.0, -3.0, s.altitude) + 0.45 * deep
    veiled = (1.0 - 0.2 * s.rain * (1.0 - deep)) * (1.0 - 0.06 * s.fog) * (1.0 - 0.36 * s.dust)
    return clear * veiled * (1.0 + 0.3 * deep * max(s.rain, s.fog) * (1.0 - s.dust))


def _smoothstep(start: float, end: float, x: float) -> float:
    t = min(max((x - start) / (end - start), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def _desaturate(colour: Colour, share: float) -> Colour:
    """Remove a share of a colour's saturation."""
    return colour + (float(colour[0] + colour[1] + colour[2]) / 3.0 - colour) * share


def _mix(a: Colour, b: Colour, t: float) -> Colour:
    return a + (b - a) * t


def _vector(colour: Colour) -> Any:
    """Return a kernel's vector, with components rounded to 12 places (light at night is small)."""
    return wp.vec3f(*(round(float(c), 12) for c in colour))


def _round(table: NDArray[np.float64]) -> NDArray[np.float32]:
    return (np.floor(table * 1e12 + 0.5) / 1e12).astype(np.float32)
