"""CARLA's weather presets, as numbers.

Source: LibCarla, rpc/WeatherParameters.cpp of release 0.9.16; older releases differ, so plans hold the numbers, never
the name. CARLA marks a parameter as unset with -1: the azimuth of every preset, and of `Default` all but scattering
(1, Mie 0.03, Rayleigh 0.0331, as in every preset) and dust (0). Unset means the engine's own default (Unreal plugin,
FWeatherParameters): wind 0.35, sun altitude 75, fog falloff 0.2, the rest 0.
"""

from __future__ import annotations

PARAMETERS = (
    "cloudiness",
    "precipitation",
    "precipitation_deposits",
    "wind_intensity",
    "sun_azimuth_angle",
    "sun_altitude_angle",
    "fog_density",
    "fog_distance",
    "fog_falloff",
    "wetness",
    "scattering_intensity",
    "mie_scattering_scale",
    "rayleigh_scattering_scale",
    "dust_storm",
)
UNSET = -1.0
ENGINE_DEFAULTS = dict.fromkeys(PARAMETERS, 0.0) | {
    "wind_intensity": 0.35,
    "sun_altitude_angle": 75.0,
    "fog_falloff": 0.2,
    "rayleigh_scattering_scale": 0.0331,
}
_EVERY_PRESET = {
    "sun_azimuth_angle": UNSET,
    "scattering_intensity": 1.0,
    "mie_scattering_scale": 0.03,
    "rayleigh_scattering_scale": 0.0331,
    "dust_storm": 0.0,
}
_COLUMNS = (
    "cloudiness",
    "precipitation",
    "precipitation_deposits",
    "wind_intensity",
    "sun_altitude_angle",
    "fog_density",
    "fog_distance",
    "fog_falloff",
    "wetness",
)
_TABLE = """
Default         -1  -1 -1  -1  -1  -1  -1   -1  -1
ClearNoon        5   0  0  10  45   2 0.75 0.1   0
CloudyNoon      60   0  0  10  45   3 0.75 0.1   0
WetNoon          5   0 50  10  45   3 0.75 0.1   0
WetCloudyNoon   60   0 50  10  45   3 0.75 0.1   0
SoftRainNoon    20  30 50  30  45   3 0.75 0.1   0
MidRainyNoon    60  60 60  60  45   3 0.75 0.1   0
HardRainNoon   100 100 90 100  45   7 0.75 0.1   0
ClearSunset      5   0  0  10  15   2 0.75 0.1   0
CloudySunset    60   0  0  10  15   3 0.75 0.1   0
WetSunset        5   0 50  10  15   2 0.75 0.1   0
WetCloudySunset 60   0 50  10  15   2 0.75 0.1   0
SoftRainSunset  20  30 50  30  15   2 0.75 0.1   0
MidRainSunset   60  60 60  60  15   3 0.75 0.1   0
HardRainSunset 100 100 90 100  15   7 0.75 0.1   0
ClearNight       5   0  0  10 -90  60   75   1   0
CloudyNight     60   0  0  10 -90  60 0.75 0.1   0
WetNight         5   0 50  10 -90  60   75   1  60
WetCloudyNight  60   0 50  10 -90  60 0.75 0.1  60
SoftRainNight   60  30 50  30 -90  60 0.75 0.1  60
MidRainyNight   80  60 60  60 -90  60 0.75 0.1  80
HardRainNight  100 100 90 100 -90 100 0.75 0.1 100
DustStorm      100   0  0 100  45   2 0.75 0.1   0
"""


def _read_table() -> dict[str, dict[str, float]]:
    presets = {}
    for line in _TABLE.strip().splitlines():
        name, *cells = line.split()
        numbers = _EVERY_PRESET | dict(zip(_COLUMNS, map(float, cells), strict=True))
        if name == "DustStorm":
            numbers["dust_storm"] = 100.0
        if name == "Default":
            numbers = dict.fromkeys(PARAMETERS, UNSET) | {k: v for k, v in _EVERY_PRESET.items() if v != UNSET}
        presets[name] = {parameter: numbers[parameter] for parameter in PARAMETERS}
    return presets


PRESETS: dict[str, dict[str, float]] = _read_table()
"""All 23 presets as CARLA has them, unset marks included, in CARLA's order of parameters."""


def preset(name: str) -> dict[str, float]:
    """The parameters of a preset, with defaults for unset ones.

    Raises:
        KeyError: there is no such preset.
    """
    return {p: ENGINE_DEFAULTS[p] if value == UNSET else value for p, value in PRESETS[name].items()}
