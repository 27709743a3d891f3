"""CARLA's weather presets, as numbers.

Source: LibCarla, rpc/WeatherParameters.cpp of release 0.9.16; older releases differ, so plans hold the numbers, never
the name. CARLA marks a parameter as unset with -1: the azimuth of every preset, and of `Default` all but scattering
(1, Mie 0.03, Rayleigh 0.0331, as in every preset) and dust (0). Unset means the engine's own default (Unreal plugin,
FWeatherParameters).
"""

from __future__ import annotations

from recipe_compiler.ir.weather import PARAMETERS, UNSET

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
    "dust_storm",
)
_TABLE = """
Default         -1  -1 -1  -1  -1  -1  -1   -1  -1    0
ClearNoon        5   0  0  10  45   2 0.75 0.1   0    0
CloudyNoon      60   0  0  10  45   3 0.75 0.1   0    0
WetNoon          5   0 50  10  45   3 0.75 0.1   0    0
WetCloudyNoon   60   0 50  10  45   3 0.75 0.1   0    0
SoftRainNoon    20  30 50  30  45   3 0.75 0.1   0    0
MidRainyNoon    60  60 60  60  45   3 0.75 0.1   0    0
HardRainNoon   100 100 90 100  45   7 0.75 0.1   0    0
ClearSunset      5   0  0  10  15   2 0.75 0.1   0    0
CloudySunset    60   0  0  10  15   3 0.75 0.1   0    0
WetSunset        5   0 50  10  15   2 0.75 0.1   0    0
WetCloudySunset 60   0 50  10  15   2 0.75 0.1   0    0
SoftRainSunset  20  30 50  30  15   2 0.75 0.1   0    0
MidRainSunset   60  60 60  60  15   3 0.75 0.1   0    0
HardRainSunset 100 100 90 100  15   7 0.75 0.1   0    0
ClearNight       5   0  0  10 -90  60   75   1   0    0
CloudyNight     60   0  0  10 -90  60 0.75 0.1   0    0
WetNight         5   0 50  10 -90  60   75   1  60    0
WetCloudyNight  60   0 50  10 -90  60 0.75 0.1  60    0
SoftRainNight   60  30 50  30 -90  60 0.75 0.1  60    0
MidRainyNight   80  60 60  60 -90  60 0.75 0.1  80    0
HardRainNight  100 100 90 100 -90 100 0.75 0.1 100    0
DustStorm      100   0  0 100  45   2 0.75 0.1   0  100
"""


def _presets() -> dict[str, dict[str, float]]:
    presets = {}
    for line in _TABLE.strip().splitlines():
        name, *cells = line.split()
        row = dict(zip(_COLUMNS, map(float, cells), strict=True))
        presets[name] = {parameter: row.get(parameter, PARAMETERS[parameter].usual) for parameter in PARAMETERS}
    return presets


PRESETS: dict[str, dict[str, float]] = _presets()
"""All presets as CARLA has them, unset marks included, in CARLA's order of parameters."""


def preset(name: str) -> dict[str, float]:
    """The parameters of a preset, with defaults for unset ones.

    Raises:
        KeyError: there is no such preset.
    """
    return {p: PARAMETERS[p].engine if value == UNSET else value for p, value in PRESETS[name].items()}
