"""The clear sky as two tables, computed on the host: its colour by elevation, and the halo by the angle to the sun.

The colours were chosen after photographs: blue at noon, gold and blue in the evening, an orange band under a deep blue
at dusk. Rayleigh scattering makes the zenith bluer and low suns redder; Mie scattering desaturates the sky and
concentrates light around the sun, by the phase function of Henyey and Greenstein (1941).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact

from recipe_runtime.render.atmosphere.air import HALO_ROWS, SKY_ROWS

Colour = NDArray[np.float64]  # [3] linear RGB
RAYLEIGH, MIE = 0.0331, 0.03  # CARLA's defaults
_BRIGHTNESS: tuple[tuple[float, float], ...] = (
    *((-90, 7e-5), (-18, 7e-5), (-12, 2e-4), (-6, 2.5e-3), (-3, 0.012), (0, 0.06)),
    *((5, 0.22), (15, 0.52), (45, 0.9), (90, 1.0)),
)  # of the sky, by the sun's altitude in degrees
# By the sun's altitude: zenith, horizon, and the light near the horizon below the sun; relative to the brightness.
_COLOURS: tuple[tuple[float, tuple[float, ...]], ...] = (
    (-18, (0.22, 0.34, 0.70, 0.50, 0.52, 0.66, 0.0, 0.0, 0.0)),
    (-10, (0.20, 0.32, 0.74, 0.34, 0.40, 0.64, 0.5, 0.28, 0.16)),
    (-5, (0.12, 0.21, 0.52, 0.20, 0.24, 0.40, 2.3, 0.86, 0.20)),
    (0, (0.09, 0.17, 0.40, 0.28, 0.27, 0.33, 2.0, 0.76, 0.14)),
    (5, (0.09, 0.17, 0.40, 0.36, 0.34, 0.36, 1.3, 0.52, 0.12)),
    (15, (0.12, 0.25, 0.58, 0.52, 0.56, 0.62, 0.8, 0.46, 0.16)),
    (35, (0.25, 0.52, 1.12, 1.20, 1.48, 1.78, 0.1, 0.07, 0.04)),
    (90, (0.24, 0.50, 1.14, 1.20, 1.50, 1.82, 0.0, 0.0, 0.0)),
)


@dataclass(frozen=True)
class Haze:
    """Scattering by the air, relative to CARLA's default air, which has 1 and 0.107."""

    rayleigh: float  # 0: none, 1: default; the square root of CARLA's scale
    mie: float  # optical depth of one air mass


def haze_of(mie: float, rayleigh: float) -> Haze:
    """Return the haze for CARLA's scales, 0 to 5 (Mie) and 0 to 2 (Rayleigh); it grows less than linearly with them."""
    return Haze(exact.power(rayleigh / RAYLEIGH, 0.5), 0.08 + 0.9 * mie / (1.0 + 0.35 * mie))


def brightness(altitude: float) -> float:
    """Return the brightness of the sky by day, twilight and night; 1 with the sun at the zenith."""
    return exact.exp(_log_brightness(altitude))


def gradient(altitude: float, haze: Haze) -> NDArray[np.float64]:
    """Return the sky away from the sun by the square root of the direction's z, horizon first, [SKY_ROWS, 3]."""
    zenith, horizon, _ = _colours(altitude)
    s = haze.rayleigh
    if s > 1.0:
        zenith = zenith * np.array([exact.power(s, e) for e in (-0.4, -0.12, 0.16)])
        low = min(max(1.0 - altitude / 20.0, 0.0), 1.0)  # a low sun's light crosses much air
        horizon = horizon * np.array([exact.power(s, e) for e in (-0.16 + 0.4 * low, -0.06, 0.03 - 0.35 * low)])
    else:  # without Rayleigh scattering the sky is black except for haze
        dark = 0.10 + 0.90 * s
        zenith = zenith * dark + 0.05 * (1.0 - s) * zenith[2]
        horizon = horizon * (0.3 + 0.7 * s)
    pale = haze.mie / (0.6 + haze.mie) - 0.107 / 0.707
    grey = 0.75 * zenith[2] * np.array([0.95, 1.0, 1.06])
    zenith = zenith + (grey - zenith) * max(pale, -0.2)
    rise = np.arange(SKY_ROWS) / (SKY_ROWS - 1.0)
    share = (1.0 - rise) * (1.0 - rise) * (1.0 - 0.45 * rise)
    table: NDArray[np.float64] = brightness(altitude) * (zenith + (horizon - zenith) * share[:, None])
    return table


def halo(haze: Haze, shining: Colour) -> NDArray[np.float64]:
    """Return the halo about the sun by the square of (1 + cosine) / 2, opposite first, [HALO_ROWS, 3].

    `shining` is the sunlight that molecules and clouds transmit.
    """
    cosine = np.sqrt(np.arange(HALO_ROWS) / (HALO_ROWS - 1.0)) * 2.0 - 1.0
    g = 0.84
    x = 1.0 + g * g - 2.0 * g * cosine
    narrow = (1.0 - g * g) / (x * np.sqrt(x))
    scattered = 0.06 * (1.0 - exact.exp(-haze.mie)) * _redder(haze)
    table: NDArray[np.float64] = scattered * narrow[:, None] * shining
    return table


def warmth(altitude: float, haze: Haze) -> Colour:
    """Return the light added near the horizon below a low sun; redder with more Rayleigh scattering."""
    colour: Colour = _colours(altitude)[2] * (brightness(altitude) * min(haze.rayleigh, 1.0)) * _redder(haze)
    return colour


def _redder(haze: Haze) -> Colour:
    return np.array([exact.power(max(haze.rayleigh, 1.0), e) for e in (0.5, 0.2, -0.2)])


def _colours(altitude: float) -> tuple[Colour, Colour, Colour]:
    knots = [(a, np.array(c)) for a, c in _COLOURS]
    found = knots[0][1]
    for (a0, c0), (a1, c1) in pairwise(knots):
        if altitude > a0:
            found = c0 + (c1 - c0) * min((altitude - a0) / (a1 - a0), 1.0)
    return found[0:3], found[3:6], found[6:9]


def _log_brightness(x: float) -> float:
    """Interpolate the logarithm of the sky's brightness linearly."""
    for (x0, y0), (x1, y1) in pairwise(_BRIGHTNESS):
        if x <= x1:
            t = max((x - x0) / (x1 - x0), 0.0)
            return exact.log(y0) + (exact.log(y1) - exact.log(y0)) * t
    return exact.log(_BRIGHTNESS[-1][1])
