"""A colour sensor behind a Bayer mosaic: every pixel measures one colour, and demosaicking estimates the other two.

The mosaic is RGGB: red where row and column are even, blue where both are odd, green elsewhere. The demosaicking is
the linear one of Malvar, He and Cutler (2004). Beyond the border, the picture is mirrored about its outermost pixels,
which continues the mosaic.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.camera.develop_kernels import Response, level, normal_deviate, tone
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.noise import scramble
from recipe_runtime.render.numeric.scalars import maximum, minimum, nonnegative

wp.set_module_options(OPTIONS)

SPREAD = wp.constant(wp.float32(0.2))  # share of a point's light on the pixel at each side, along each axis
SATURATION = wp.constant(wp.float32(7.2))  # the light above which a pixel measures no more; the tone curve ends there
READ_VARIANCE = wp.constant(wp.float32(1.0e-6))  # of the noise in darkness at ISO 100
SHOT_VARIANCE = wp.constant(wp.float32(1.0e-4))  # of the noise that light 1 adds at ISO 100


@wp.func
def mirrored(i: wp.int32, size: wp.int32) -> wp.int32:
    """Return the row or column that stands for one at most two beyond the border."""
    i = wp.where(i < 0, -i, i)
    return wp.where(i < size, i, 2 * size - 2 - i)


@wp.func
def place(x: wp.int32, y: wp.int32, r: Response) -> wp.int32:
    """Return the index of the pixel at a column and a row."""
    return nonnegative(mirrored(y, r.height) * r.width + mirrored(x, r.width))


@wp.func
def spread_row(light: wp.array[wp.vec3f], x: wp.int32, y: wp.int32, colour: wp.int32, r: Response) -> wp.float32:
    """Return a colour's light at a pixel, spread along its row by the lens."""
    sides = light[place(x - 1, y, r)][colour] + light[place(x + 1, y, r)][colour]
    return light[place(x, y, r)][colour] * (1.0 - 2.0 * SPREAD) + sides * SPREAD


@wp.kernel
def measure(
    light: wp.array[wp.vec3f], response: Response, deviates: wp.array[wp.float32], out_mosaic: wp.array[wp.float32]
):
    """Write the light that each pixel of the mosaic measures: that of one colour, with read and shot noise."""
    i = wp.tid()
    r = response
    x = i % r.width
    y = i / r.width
    colour = (x & 1) + (y & 1)  # 0 red, 1 green, 2 blue
    sides = spread_row(light, x, y - 1, colour, r) + spread_row(light, x, y + 1, colour, r)
    exact = spread_row(light, x, y, colour, r) * (1.0 - 2.0 * SPREAD) + sides * SPREAD
    deviation = r.noise * wp.sqrt(READ_VARIANCE + SHOT_VARIANCE * maximum(exact, 0.0))
    noise = deviation * normal_deviate(deviates, scramble(wp.uint32(i) ^ r.key))
    out_mosaic[i] = minimum(exact + noise, SATURATION)  # below 0 as well: a sensor adds an offset, later subtracted


@wp.func
def demosaicked(mosaic: wp.array[wp.float32], x: wp.int32, y: wp.int32, r: Response) -> wp.vec3f:
    """Return the light of a pixel, by the gradient-corrected linear filters of 5 x 5 pixels."""
    own = mosaic[place(x, y, r)]
    across = mosaic[place(x - 1, y, r)] + mosaic[place(x + 1, y, r)]
    along = mosaic[place(x, y - 1, r)] + mosaic[place(x, y + 1, r)]
    far_across = mosaic[place(x - 2, y, r)] + mosaic[place(x + 2, y, r)]
    far_along = mosaic[place(x, y - 2, r)] + mosaic[place(x, y + 2, r)]
    upper = mosaic[place(x - 1, y - 1, r)] + mosaic[place(x + 1, y - 1, r)]
    corners = upper + (mosaic[place(x - 1, y + 1, r)] + mosaic[place(x + 1, y + 1, r)])
    if (x & 1) != (y & 1):
        of_row = (5.0 * own + 4.0 * across - corners - far_across + 0.5 * far_along) * 0.125
        of_column = (5.0 * own + 4.0 * along - corners - far_along + 0.5 * far_across) * 0.125
        if (y & 1) == 0:
            return wp.vec3f(of_row, own, of_column)
        return wp.vec3f(of_column, own, of_row)
    far = far_across + far_along
    green = (4.0 * own + 2.0 * (across + along) - far) * 0.125
    other = (6.0 * own + 2.0 * corners - 1.5 * far) * 0.125
    if (x & 1) == 0:
        return wp.vec3f(own, green, other)
    return wp.vec3f(other, green, own)


@wp.kernel
def develop_mosaic(
    mosaic: wp.array[wp.float32],
    response: Response,
    tone_table: wp.array[wp.uint8],
    out_rgb: wp.array[wp.uint8],
    out_light: wp.array[wp.vec3f],
):
    """Write a pixel's three bytes: demosaicking, then the tone curve. `out_light` may be absent."""
    i = wp.tid()
    light = demosaicked(mosaic, i % response.width, i / response.width, response)
    red = tone(light[0])
    green = tone(light[1])
    blue = tone(light[2])
    at = nonnegative(3 * i)
    out_rgb[at] = tone_table[level(red, 0.0, 0.0)]
    out_rgb[at + 1] = tone_table[level(green, 0.0, 0.0)]
    out_rgb[at + 2] = tone_table[level(blue, 0.0, 0.0)]
    if out_light:
        out_light[i] = wp.vec3f(red, green, blue)
