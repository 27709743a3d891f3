"""Lens distortion: the point of the undistorted image that each point of the picture shows.

`recipe_compiler.ir.optics` has the formula. A label is that of the nearest sample of the undistorted image, never a
blend. At the centre the undistorted image has at least twice the picture's resolution, so that sample is within 0.36
pixels of the pixel's centre. Colour is filtered. Without distortion the undistorted image is the picture itself, or the
picture with more samples.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.struct
class Distortion:
    """The mapping from a picture to its undistorted image."""

    k: wp.float64
    kcube: wp.float64
    limit: wp.float64  # radius of the corners in half widths; beyond, the curve is continued by its tangent
    width: wp.int32  # of the picture
    height: wp.int32
    wide: wp.int32  # of the undistorted image
    high: wp.int32
    fine: wp.int32  # samples of the undistorted image along the side of a pixel
    bends: wp.int32


@wp.func
def undistorted_position(x: wp.float64, y: wp.float64, c: Distortion) -> wp.vec2d:
    """Map a point of the picture, in pixels, to the undistorted image, in its samples."""
    dx = x - wp.float64(c.width) * wp.float64(0.5)
    dy = y - wp.float64(c.height) * wp.float64(0.5)
    half = wp.float64(c.width) * wp.float64(0.5)
    square = (dx * dx + dy * dy) / (half * half)
    f = wp.float64(c.fine)
    if c.bends != 0:
        f = f * (wp.float64(1.0) + square * (c.k + c.kcube * wp.sqrt(square)))
    return wp.vec2d(wp.float64(c.wide) * wp.float64(0.5) + f * dx, wp.float64(c.high) * wp.float64(0.5) + f * dy)


@wp.func
def nearest_sample(i: wp.int32, distortion: Distortion) -> wp.int32:
    """Return the number of the undistorted image's sample that is nearest to the centre of pixel number i."""
    p = undistorted_position(
        wp.float64(i % distortion.width) + wp.float64(0.5),
        wp.float64(i / distortion.width) + wp.float64(0.5),
        distortion,
    )
    x = wp.min(wp.max(wp.int32(p[0]), 0), distortion.wide - 1)
    y = wp.min(wp.max(wp.int32(p[1]), 0), distortion.high - 1)
    return y * distortion.wide + x


@wp.kernel
def resample_words(words: wp.array[wp.uint64], distortion: Distortion, out_words: wp.array[wp.uint64]):
    """Copy to each pixel the word of the undistorted image's sample that is nearest to the pixel's centre."""
    i = wp.tid()
    out_words[i] = words[nearest_sample(i, distortion)]


@wp.func
def distort(x: wp.float64, y: wp.float64, c: Distortion) -> wp.vec2d:
    """Map a point that a pinhole camera shows at (x, y), in pixels, to the picture, by Newton's method.

    Beyond the corners the curve is continued by its tangent, so that what lies outside the picture stays outside.
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
