"""The camera: samples into pixels, exposure, tone curve, noise, and 8-bit sRGB by a table.

Every sample is tone-mapped before the pixel's samples are averaged: a bright sky would otherwise eat into the dark
edge before it, and the edge would alias again.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.noise import scramble
from recipe_runtime.render.numeric.scalars import maximum, minimum, nonnegative

wp.set_module_options(OPTIONS)

LEVELS = wp.constant(4096)  # linear levels of the tone table
RIM_STEPS = wp.constant(1024)  # steps of the vignette table
DEVIATES = wp.constant(1024)  # entries of the table of normal deviates
DEVIATE_SHIFT = wp.constant(wp.uint32(22))  # 32 - log2(DEVIATES): the highest bits of a hash are the index


@wp.struct
class Response:
    """The settings of the camera for one frame."""

    exposure: wp.float32
    white: wp.vec3f  # gains of the white balance
    noise: wp.float32
    vignette: wp.float32  # loss of light at one picture width from the centre
    rim: wp.int32  # 1: there is a lens circle
    key: wp.uint32  # of seed, sensor and frame
    width: wp.int32
    height: wp.int32


@wp.func
def tone(x: wp.float32) -> wp.float32:
    """Map light to [0, 1) by a filmic curve: Narkowicz's rational fit to ACES."""
    x = maximum(x, 0.0)
    y = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
    return minimum(y, 1.0)


@wp.func
def inverse_tone(y: wp.float32) -> wp.float32:
    """Return the light, up to 7.2, that `tone` maps to y."""
    a = 2.51 - 2.43 * y
    b = 0.03 - 0.59 * y
    return (wp.sqrt(b * b + 0.56 * a * y) - b) / (2.0 * a)


@wp.func
def lens_circle_gain(rims: wp.array[wp.float32], square: wp.float32) -> wp.float32:
    """Return the gain of the lens circle at a squared distance from the centre, 1 at the corners, interpolated."""
    t = minimum(square, 1.0) * wp.float32(RIM_STEPS)
    i = wp.min(wp.int32(t), RIM_STEPS - 1)
    return rims[i] + (rims[i + 1] - rims[i]) * (t - wp.float32(i))


@wp.func
def vignette_at(x: wp.float32, y: wp.float32, r: Response, rims: wp.array[wp.float32]) -> wp.float32:
    """Return the gain of the vignette at a point, in picture widths from the centre."""
    square = x * x + y * y
    gain = 1.0 - r.vignette * square
    if r.rim != 0:
        tall = wp.float32(r.height) / wp.float32(r.width)
        gain = gain * lens_circle_gain(rims, square * 4.0 / (1.0 + tall * tall))
    return gain


@wp.func
def normal_deviate(table: wp.array[wp.float32], h: wp.uint32) -> wp.float32:
    """Return a standard normal deviate, chosen by the ten highest bits of a hash."""
    return table[wp.int32(h >> DEVIATE_SHIFT)]


@wp.func
def grain(x: wp.float32, deviate: wp.float32, noise: wp.float32) -> wp.float32:
    """Return the noise of a linear value."""
    return noise * deviate * (0.0005 + 0.008 * wp.sqrt(x))


@wp.func
def level(x: wp.float32, deviate: wp.float32, noise: wp.float32) -> wp.int32:
    """Return the index into the tone table of a linear value with noise."""
    t = (x + grain(x, deviate, noise)) * wp.float32(LEVELS - 1) + 0.5
    return nonnegative(wp.int32(minimum(maximum(t, 0.0), wp.float32(LEVELS - 1))))


@wp.func
def record_levels(
    out: wp.array[wp.uint8],
    i: wp.int32,
    red: wp.float32,
    green: wp.float32,
    blue: wp.float32,
    r: Response,
    srgb: wp.array[wp.uint8],
    deviates: wp.array[wp.float32],
):
    """Write a pixel's bytes: noise, from other bits of the pixel's hash for each channel, then the tone table."""
    h = scramble(wp.uint32(i) ^ r.key)
    at = nonnegative(3 * i)
    out[at] = srgb[level(red, normal_deviate(deviates, h), r.noise)]
    out[at + 1] = srgb[level(green, normal_deviate(deviates, h << wp.uint32(10)), r.noise)]
    out[at + 2] = srgb[level(blue, normal_deviate(deviates, h << wp.uint32(20)), r.noise)]


@wp.func
def record_light(
    out: wp.array[wp.vec3f],
    i: wp.int32,
    red: wp.float32,
    green: wp.float32,
    blue: wp.float32,
    r: Response,
    deviates: wp.array[wp.float32],
):
    """Write a pixel's light with noise, of which `record_levels` writes the bytes."""
    h = scramble(wp.uint32(i) ^ r.key)
    out[i] = wp.vec3f(
        red + grain(red, normal_deviate(deviates, h), r.noise),
        green + grain(green, normal_deviate(deviates, h << wp.uint32(10)), r.noise),
        blue + grain(blue, normal_deviate(deviates, h << wp.uint32(20)), r.noise),
    )


@wp.kernel
def vignette_gains(responses: wp.array[Response], lens_circle: wp.array[wp.float32], out_gains: wp.array[wp.float32]):
    """Write the gain of the vignette at every pixel."""
    i = wp.tid()
    r = responses[0]
    x = (wp.float32(i % r.width) + 0.5) / wp.float32(r.width) - 0.5
    y = (wp.float32(i / r.width) + 0.5 - 0.5 * wp.float32(r.height)) / wp.float32(r.width)
    out_gains[i] = vignette_at(x, y, r, lens_circle)


@wp.func
def tone_mapped(
    first: wp.int32,
    count: wp.int32,
    radiance: wp.array[wp.vec3f],
    weights: wp.array[wp.float32],
    rain: wp.int32,
    streak: wp.vec3f,
    gain: wp.float32,
    white: wp.vec3f,
) -> wp.vec3f:
    """Return the mean of a pixel's samples, each exposed and tone-mapped."""
    drops = minimum(wp.float32(rain) * (1.0 / 65536.0), 0.8)
    red = wp.float32(0.0)
    green = wp.float32(0.0)
    blue = wp.float32(0.0)
    for s in range(count):
        c = radiance[first + s]
        w = weights[first + s]
        red = red + w * tone((c[0] + (streak[0] - c[0]) * drops) * gain * white[0])
        green = green + w * tone((c[1] + (streak[1] - c[1]) * drops) * gain * white[1])
        blue = blue + w * tone((c[2] + (streak[2] - c[2]) * drops) * gain * white[2])
    return wp.vec3f(red, green, blue)


@wp.kernel
def develop_pixels(
    radiance: wp.array[wp.vec3f],
    starts: wp.array[wp.int32],
    groups: wp.array[wp.int32],
    weights: wp.array[wp.float32],
    rain_cover: wp.array[wp.int32],
    streak: wp.vec3f,
    responses: wp.array[Response],
    kept_samples: wp.int32,
    out_stale: wp.array[wp.uint8],
    out_levels: wp.array[wp.vec3f],
    gains: wp.array[wp.float32],
    tone_table: wp.array[wp.uint8],
    deviates: wp.array[wp.float32],
    pixels_per_thread: wp.int32,
    out_rgb: wp.array[wp.uint8],
    out_light: wp.array[wp.vec3f],
):
    """Write the three bytes of each pixel, `pixels_per_thread` to a thread; `gains` is what `vignette_gains` writes.

    A pixel that is not stale keeps the levels, before noise, of an earlier frame; its samples are then below
    `kept_samples`. `rain_cover` has a single element if it does not rain. `out_light` may be absent.
    """
    r = responses[0]
    raining = rain_cover.shape[0] > 1
    begin = wp.tid() * pixels_per_thread
    for place in range(begin, wp.min(begin + pixels_per_thread, r.width * r.height)):
        i = nonnegative(place)
        drops = wp.int32(0)
        if raining:
            drops = rain_cover[i]
        fresh = drops != 0 or kept_samples == 0
        if not fresh:
            fresh = out_stale[i] != wp.uint8(0)
        red = wp.float32(0.0)
        green = wp.float32(0.0)
        blue = wp.float32(0.0)
        if fresh:
            first = nonnegative(starts[i])
            gain = r.exposure * gains[i]
            colour = tone_mapped(first, groups[i] & 7, radiance, weights, drops, streak, gain, r.white)
            red = colour[0]
            green = colour[1]
            blue = colour[2]
            if first < kept_samples and drops == 0:
                out_levels[i] = colour
                out_stale[i] = wp.uint8(0)
        else:
            kept = out_levels[i]
            red = kept[0]
            green = kept[1]
            blue = kept[2]
        record_levels(out_rgb, i, red, green, blue, r, tone_table, deviates)
        if out_light:
            record_light(out_light, i, red, green, blue, r, deviates)


@wp.kernel
def expose_samples(
    radiance: wp.array[wp.vec3f],
    starts: wp.array[wp.int32],
    groups: wp.array[wp.int32],
    weights: wp.array[wp.float32],
    rain_cover: wp.array[wp.int32],
    streak: wp.vec3f,
    response: Response,
    out_hdr_image: wp.array[wp.vec3f],
):
    """Write a pixel of the HDR image: light, exposed and balanced, its samples averaged as by `develop_pixels`."""
    i = wp.tid()
    drops = wp.int32(0)
    if rain_cover.shape[0] > 1:
        drops = rain_cover[i]
    colour = tone_mapped(starts[i], groups[i] & 7, radiance, weights, drops, streak, response.exposure, response.white)
    out_hdr_image[i] = wp.vec3f(inverse_tone(colour[0]), inverse_tone(colour[1]), inverse_tone(colour[2]))
