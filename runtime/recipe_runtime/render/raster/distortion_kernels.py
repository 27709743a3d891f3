"""The lens: which place of a straight picture, the plate, each place of the picture shows.

`recipe_compiler.ir.optics` has the formula. Labels take the nearest sample of a plate that is at least twice as fine as
the picture, and are never blended, so the ray that they are exact for is within 0.36 of a plate's sample of the
pixel's centre. Colour is filtered. Without a bend the plate is the picture, or the same picture with more samples.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.struct
class Distortion:
    """A picture's way to its plate."""

    k: wp.float64
    kcube: wp.float64
    limit: wp.float64  # half widths from the centre to the corners; the curve goes on straight beyond
    width: wp.int32  # of the picture
    height: wp.int32
    wide: wp.int32  # of the plate
    high: wp.int32
    fine: wp.int32  # the plate's samples along the side of a pixel
    bends: wp.int32


@wp.func
def plate_position(x: wp.float64, y: wp.float64, c: Distortion) -> wp.vec2d:
    """Where on the plate, in its samples, a place of the picture, in pixels, is seen."""
    dx = x - wp.float64(c.width) * wp.float64(0.5)
    dy = y - wp.float64(c.height) * wp.float64(0.5)
    half = wp.float64(c.width) * wp.float64(0.5)
    square = (dx * dx + dy * dy) / (half * half)
    f = wp.float64(c.fine)
    if c.bends != 0:
        f = f * (wp.float64(1.0) + square * (c.k + c.kcube * wp.sqrt(square)))
    return wp.vec2d(wp.float64(c.wide) * wp.float64(0.5) + f * dx, wp.float64(c.high) * wp.float64(0.5) + f * dy)


@wp.kernel
def resample_words(plate: wp.array[wp.uint64], distortion: Distortion, out_words: wp.array[wp.uint64]):
    """A pixel's word: that of the plate's sample nearest to what its centre shows."""
    i = wp.tid()
    p = plate_position(
        wp.float64(i % distortion.width) + wp.float64(0.5),
        wp.float64(i / distortion.width) + wp.float64(0.5),
        distortion,
    )
    x = wp.min(wp.max(wp.int32(p[0]), 0), distortion.wide - 1)
    y = wp.min(wp.max(wp.int32(p[1]), 0), distortion.high - 1)
    out_words[i] = plate[y * distortion.wide + x]


@wp.func
def distort(x: wp.float64, y: wp.float64, c: Distortion) -> wp.vec2d:
    """Where in the picture a place is shown that a pinhole would show at (x, y), in pixels: the inverse, by Newton.

    Beyond the corners the curve is followed in a straight line, so that whatever lies outside stays outside.
    """
    if c.bends == 0:
        return wp.vec2d(x, y)
    half = wp.float64(c.width) * wp.float64(0.5)
    dx = x - half
    dy = y - wp.float64(c.height) * wp.float64(0.5)
    goal = wp.sqrt(dx * dx + dy * dy) / half
    one = wp.float64(1.0)
    end = c.limit * (one + c.limit * c.limit * (c.k + c.kcube * c.limit))
    steep = one + c.limit * c.limit * (wp.float64(3.0) * c.k + wp.float64(4.0) * c.kcube * c.limit)
    r = c.limit + (goal - end) / steep
    if goal < end:
        r = goal * c.limit / end
        for _step in range(12):
            value = r * (one + r * r * (c.k + c.kcube * r)) - goal
            rise = one + r * r * (wp.float64(3.0) * c.k + wp.float64(4.0) * c.kcube * r)
            r = wp.min(wp.max(r - value / rise, wp.float64(0.0)), c.limit)
    scale = one
    if goal > wp.float64(1.0e-12):
        scale = r / goal
    return wp.vec2d(half + dx * scale, wp.float64(c.height) * wp.float64(0.5) + dy * scale)
