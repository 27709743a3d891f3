"""Gain, white balance, vignette and tone tables of a camera's settings.

Computed on the host with exact arithmetic, once for each response.
"""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import CameraResponse
from recipe_compiler.ir.streams import normal_quantile

from recipe_runtime.render.camera.develop_kernels import DEVIATES, RIM_STEPS

_NOON = 1.0 / (100.0 * 16.0 * 16.0)  # the sunny sixteen: 1/100 s at f/16 and ISO 100 ...
_NOON_GAIN = 0.26  # ... exposes clear noon as the automatic exposure does


def gain(response: CameraResponse, automatic: float) -> float:
    """Return the factor of the light; `automatic` is the gain that automatic exposure chooses.

    Manual exposure is proportional to shutter time, sensitivity and area of the aperture,
    iso / (100 shutter_speed fstop^2), so that the sunny-sixteen rule holds at clear noon.
    """
    if response.exposure_mode == "manual":
        light = response.iso / (100.0 * response.shutter_speed * response.fstop * response.fstop)
        automatic = _NOON_GAIN * light / _NOON
    return automatic * exact.power(2.0, response.exposure_compensation)


def noise_strength(response: CameraResponse) -> float:
    """Return the noise relative to a typical camera at ISO 100; it grows with the square root of the sensitivity."""
    return response.noise * float(np.sqrt(response.iso / 100.0))


def white(response: CameraResponse) -> tuple[float, float, float]:
    """Return gains of red, green and blue that show light of `temp` kelvin as white; `tint` reduces green.

    They keep the luminance of white.
    """
    if response.temp == 6500.0 and response.tint == 0.0:
        return 1.0, 1.0, 1.0
    rows = zip(_blackbody(6500.0), _blackbody(response.temp), strict=True)
    red, green, blue = (reference / light for reference, light in rows)
    green = green * (1.0 - 0.3 * response.tint)
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    return red / luminance, green / luminance, blue / luminance


def lens_circle(response: CameraResponse) -> NDArray[np.float32]:
    """Return the vignette: the gain at r^2 = i / RIM_STEPS, r from the centre (0) to the corners (1), [RIM_STEPS + 1].

    It is max(0, 1 - lens_circle_multiplier r^(2 lens_circle_falloff)): a larger falloff restricts it to the rim.
    """
    squares = (i / RIM_STEPS for i in range(RIM_STEPS + 1))
    shade = (exact.power(square, response.lens_circle_falloff) for square in squares)
    return np.array([max(0.0, 1.0 - response.lens_circle_multiplier * s) for s in shade], np.float32)


@lru_cache(maxsize=16)
def encoded(levels: int, gamma: float) -> NDArray[np.float64]:
    """Return the encoded value, 0 to 1, of each linear level: the sRGB curve, its result raised to 2.2 / gamma."""
    top = levels - 1
    values = (_encode(i / top) for i in range(levels))
    if gamma != 2.2:
        values = (exact.power(v, 2.2 / gamma) for v in values)
    return np.array(list(values))


@lru_cache(maxsize=16)
def tone_table(levels: int, gamma: float) -> NDArray[np.uint8]:
    """Return the 8-bit level of each linear level."""
    return np.array([int(255.0 * float(v) + 0.5) for v in encoded(levels, gamma)], np.uint8)


@cache
def deviates() -> NDArray[np.float32]:
    """Return equally likely quantiles of the standard normal distribution, in rising order, [DEVIATES]."""
    values = [normal_quantile((i + 0.5) / DEVIATES) for i in range(DEVIATES)]
    spread = float(np.sqrt(sum(v * v for v in values) / DEVIATES))  # a little below 1: the ends are cut off
    return np.array([v / spread for v in values], np.float32)


def _encode(v: float) -> float:
    return 12.92 * v if v <= 0.0031308 else 1.055 * exact.power(v, 1.0 / 2.4) - 0.055


def _blackbody(kelvin: float) -> tuple[float, float, float]:
    """Return the linear sRGB of a black body's light with Y = 1: cubics of Kim et al., 1667 to 25000 K."""
    t = 1000.0 / max(kelvin, 1667.0)
    if kelvin < 4000.0:
        x = 0.179910 + t * (0.8776956 + t * (-0.2343589 - t * 0.2661239))
    else:
        x = 0.240390 + t * (0.2226347 + t * (2.1070379 - t * 3.0258469))
    if kelvin < 2222.0:
        y = -0.20219683 + x * (2.18555832 + x * (-1.34811020 - x * 1.1063814))
    elif kelvin < 4000.0:
        y = -0.16748867 + x * (2.09137015 + x * (-1.37418593 - x * 0.9549476))
    else:
        y = -0.37001483 + x * (3.75112997 + x * (-5.87338670 + x * 3.0817580))
    big_x, big_z = x / y, (1.0 - x - y) / y
    red = 3.2404542 * big_x - 1.5371385 - 0.4985314 * big_z
    green = -0.9692660 * big_x + 1.8760108 + 0.0415560 * big_z
    blue = 0.0556434 * big_x - 0.2040259 + 1.0572252 * big_z
    return max(red, 0.02), max(green, 0.02), max(blue, 0.02)
