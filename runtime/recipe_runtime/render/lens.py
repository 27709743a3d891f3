"""The lens: which place of a straight picture, the plate, each place of the picture shows.

`recipe_compiler.optics` has the formula. Labels take the nearest sample of a plate that is at least twice as fine as
the picture, and are never blended, so the sight that they are exact for is within 0.36 of a plate's sample of the
pixel's centre. Colour is filtered. Without a bend the plate is the picture, or the same picture with more samples.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from typing import Any

from recipe_compiler import exact, optics
from recipe_compiler.plan import CameraPlan

from recipe_runtime.render.camera import Response, record_levels, shading_at, tone
from recipe_runtime.render.device import OPTIONS, launch, wp

wp.set_module_options(OPTIONS)


@wp.struct
class Curve:
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


def plate_of(camera: CameraPlan, supersample: int = 1) -> CameraPlan:
    """The pinhole camera that a picture is cut from: itself, if it is one and takes one sample a pixel."""
    if supersample == 1 and not optics.bends(camera):
        return camera
    width, height, fine = optics.plate_size(camera, supersample)
    fov = camera.fov
    if optics.bends(camera):
        sine, cosine = exact.sin_cos_deg(fov / 2.0)
        fov = 2.0 * exact.atan2_deg(sine * width, cosine * camera.width * fine)
    update = {"width": width, "height": height, "fov": fov, "lens_k": 0.0, "lens_kcube": 0.0}
    return camera.model_copy(update=update)


def curve_of(camera: CameraPlan, supersample: int = 1) -> Any:
    """The camera's Curve."""
    curve = Curve()
    curve.k, curve.kcube, curve.limit = camera.lens_k, camera.lens_kcube, optics.corner(camera)
    curve.width, curve.height, curve.bends = camera.width, camera.height, int(optics.bends(camera))
    curve.wide, curve.high, curve.fine = optics.plate_size(camera, supersample)
    return curve


def through_lens(plate: Any, camera: CameraPlan, device: str) -> Any:
    """The 64-bit words (keys or bits) of a picture's pixels, from those of its plate."""
    if not optics.bends(camera):
        return plate
    pixels = camera.width * camera.height
    out = wp.empty(pixels, dtype=wp.uint64, device=device)
    launch(cut_words, pixels, [plate, curve_of(camera), out], device)
    return out


@wp.func
def place_on_plate(x: wp.float64, y: wp.float64, c: Curve) -> wp.vec2d:
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
def cut_words(plate: wp.array[wp.uint64], c: Curve, out: wp.array[wp.uint64]):
    """A pixel's word: that of the plate's sample nearest to what its centre shows."""
    i = wp.tid()
    p = place_on_plate(wp.float64(i % c.width) + wp.float64(0.5), wp.float64(i / c.width) + wp.float64(0.5), c)
    x = wp.min(wp.max(wp.int32(p[0]), 0), c.wide - 1)
    y = wp.min(wp.max(wp.int32(p[1]), 0), c.high - 1)
    out[i] = plate[y * c.wide + x]


@wp.func
def bent(x: wp.float64, y: wp.float64, c: Curve) -> wp.vec2d:
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


@wp.struct
class Finish:
    """How a plate becomes a picture."""

    fringe: wp.float32  # share of the radius by which red and blue part at the corners
    clear: wp.float32  # radius, 1 at the corners, within which they do not
    bloom: wp.float32  # share of the light that is spread
    coarse: wp.int32  # plate samples along the side of one of the spread light's


@wp.func
def between(plate: wp.array[wp.vec3f], px: wp.float64, py: wp.float64, wide: wp.int32, high: wp.int32) -> wp.vec3f:
    """The light at a place of a plate, from the four samples about it."""
    x = wp.min(wp.max(px - wp.float64(0.5), wp.float64(0.0)), wp.float64(wide - 1))
    y = wp.min(wp.max(py - wp.float64(0.5), wp.float64(0.0)), wp.float64(high - 1))
    i = wp.int32(x)
    j = wp.int32(y)
    fx = wp.float32(x - wp.float64(i))
    fy = wp.float32(y - wp.float64(j))
    k = wp.min(i + 1, wide - 1)
    below = wp.min(j + 1, high - 1)
    a = plate[j * wide + i]
    b = plate[j * wide + k]
    c = plate[below * wide + i]
    d = plate[below * wide + k]
    top = a + (b - a) * fx
    foot = c + (d - c) * fx
    return top + (foot - top) * fy


@wp.func
def light_at(plate: wp.array[wp.vec3f], spread: wp.array[wp.vec3f], p: wp.vec2d, c: Curve, f: Finish) -> wp.vec3f:
    """The light at a place of the plate, with its share of what bright places shed."""
    light = between(plate, p[0], p[1], c.wide, c.high)
    if f.bloom > 0.0:
        scale = wp.float64(1.0) / wp.float64(f.coarse)
        wide = (c.wide + f.coarse - 1) / f.coarse
        high = (c.high + f.coarse - 1) / f.coarse
        light = light + (between(spread, p[0] * scale, p[1] * scale, wide, high) - light) * f.bloom
    return light


@wp.kernel
def finish(
    plate: wp.array[wp.vec3f],
    spread: wp.array[wp.vec3f],
    c: Curve,
    f: Finish,
    r: Response,
    rims: wp.array[wp.float32],
    srgb: wp.array[wp.uint8],
    bells: wp.array[wp.float32],
    out: wp.array[wp.uint8],
):
    """One pixel's three bytes from the plate: its samples toned one by one, then averaged, and noise on top."""
    i = wp.tid()
    step = wp.float64(1.0) / wp.float64(c.fine)
    red = wp.float32(0.0)
    green = wp.float32(0.0)
    blue = wp.float32(0.0)
    half = wp.float64(c.width) * wp.float64(0.5)
    middle = wp.float64(c.height) * wp.float64(0.5)
    for s in range(c.fine * c.fine):
        x = wp.float64(i % c.width) + (wp.float64(s % c.fine) + wp.float64(0.5)) * step
        y = wp.float64(i / c.width) + (wp.float64(s / c.fine) + wp.float64(0.5)) * step
        dx = x - half
        dy = y - middle
        light = light_at(plate, spread, place_on_plate(x, y, c), c, f)
        if f.fringe > 0.0:
            radius = wp.float32(wp.sqrt(dx * dx + dy * dy) / (half * c.limit))
            part = wp.float64(f.fringe * wp.max(radius - f.clear, 0.0) / (1.0 - f.clear))
            outward = light_at(plate, spread, place_on_plate(x - dx * part, y - dy * part, c), c, f)
            inward = light_at(plate, spread, place_on_plate(x + dx * part, y + dy * part, c), c, f)
            light = wp.vec3f(outward[0], light[1], inward[2])
        gain = shading_at(wp.float32(dx / (half * wp.float64(2.0))), wp.float32(dy / (half * wp.float64(2.0))), r, rims)
        red = red + tone(light[0] * gain)
        green = green + tone(light[1] * gain)
        blue = blue + tone(light[2] * gain)
    share = 1.0 / wp.float32(c.fine * c.fine)
    record_levels(out, i, red * share, green * share, blue * share, r, srgb, bells)
