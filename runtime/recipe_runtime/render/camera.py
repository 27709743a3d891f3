"""The camera: samples into pixels, exposure, tone curve, noise, and 8-bit sRGB by a table.

Every sample is tone-mapped before the pixel's samples are averaged: a bright sky would otherwise eat into the dark
edge before it, and the edge would alias again.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.noise import scramble

wp.set_module_options(OPTIONS)

LEVELS = wp.constant(4096)


@wp.struct
class Response:
    """How light becomes numbers."""

    exposure: wp.float32
    noise: wp.float32
    key: wp.uint32  # of seed, sensor and frame
    width: wp.int32
    height: wp.int32


@wp.func
def tone(x: wp.float32) -> wp.float32:
    """A film-like curve into [0, 1): Narkowicz's rational fit to ACES."""
    x = wp.max(x, 0.0)
    y = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
    return wp.min(y, 1.0)


@wp.func
def bell(h: wp.uint32) -> wp.float32:
    """A nearly normal number of mean 0 and deviation 1: the sum of a hash's four bytes."""
    a = h & wp.uint32(255)
    b = (h >> wp.uint32(8)) & wp.uint32(255)
    c = (h >> wp.uint32(16)) & wp.uint32(255)
    d = h >> wp.uint32(24)
    return (wp.float32(a + b + c + d) - 510.0) * 0.0067658


@wp.func
def level(x: wp.float32, deviate: wp.float32, noise: wp.float32) -> wp.int32:
    """A linear display value with noise, as a place in the sRGB table."""
    grain = noise * deviate * (0.0005 + 0.008 * wp.sqrt(x))
    t = (x + grain) * wp.float32(LEVELS - 1) + 0.5
    return wp.int32(wp.min(wp.max(t, 0.0), wp.float32(LEVELS - 1)))


@wp.kernel
def develop(
    radiance: wp.array[wp.vec3f],
    starts: wp.array[wp.int32],
    groups: wp.array[wp.int32],
    weights: wp.array[wp.float32],
    rain: wp.array[wp.int32],
    streak: wp.vec3f,
    r: Response,
    srgb: wp.array[wp.uint8],
    out: wp.array2d[wp.uint8],
):
    """One pixel's three bytes."""
    i = wp.tid()
    x = (wp.float32(i % r.width) + 0.5) / wp.float32(r.width) - 0.5
    y = (wp.float32(i / r.width) + 0.5 - 0.5 * wp.float32(r.height)) / wp.float32(r.width)
    gain = r.exposure * (1.0 - 0.32 * (x * x + y * y))
    drops = wp.min(wp.float32(rain[i]) * (1.0 / 65536.0), 0.8)
    red = wp.float32(0.0)
    green = wp.float32(0.0)
    blue = wp.float32(0.0)
    first = starts[i]
    for s in range(groups[i] & 7):
        c = radiance[first + s]
        w = weights[first + s]
        red = red + w * tone((c[0] + (streak[0] - c[0]) * drops) * gain)
        green = green + w * tone((c[1] + (streak[1] - c[1]) * drops) * gain)
        blue = blue + w * tone((c[2] + (streak[2] - c[2]) * drops) * gain)
    h = scramble(wp.uint32(i) ^ r.key)
    out[i, 0] = srgb[level(red, bell(h), r.noise)]
    h = scramble(h + wp.uint32(1))
    out[i, 1] = srgb[level(green, bell(h), r.noise)]
    h = scramble(h + wp.uint32(1))
    out[i, 2] = srgb[level(blue, bell(h), r.noise)]
