"""Images on surfaces, sampled from mip levels by a pixel's footprint, which prevents aliasing at a distance.

Texture coordinates, and their steps from pixel to pixel (to the right and down), are computed when samples are
evaluated; which image is used depends on the appearance. A sample therefore stores both steps: the longer one as it is,
the shorter one relative to its length.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.noise import floor
from recipe_runtime.render.numeric.scalars import maximum, minimum
from recipe_runtime.render.numeric.vectors import cross, dot

wp.set_module_options(OPTIONS)

MAX_TAPS = wp.constant(8)  # along the longer side of a footprint
_MAX_STEP = wp.constant(wp.float32(1.0e4))  # maximum length of a step, in images


@wp.struct
class ImageAtlas:
    """The images of an appearance.

    Image k has the levels first[k] to first[k + 1], each of half the resolution of the last.
    """

    of_surface: wp.array[wp.int32]  # image of each surface, -1 for none
    first: wp.array[wp.int32]
    repeats: wp.array[wp.int32]
    starts: wp.array[wp.int32]  # of each level, into texels
    widths: wp.array[wp.int32]
    heights: wp.array[wp.int32]
    texels: wp.array[wp.uint32]  # 8-bit sRGB: red, green << 8, blue << 16
    linear: wp.array[wp.float32]  # [256]


@wp.struct
class SurfaceColours:
    """Colours and kinds of the surfaces in one appearance."""

    first: wp.array[wp.vec3f]  # linear albedo
    second: wp.array[wp.vec3f]
    pattern: wp.array[wp.int32]
    awake: wp.array[wp.float32]  # share of the windows that are lit at night
    album: wp.array[ImageAtlas]


@wp.func
def bounded(v: wp.float32) -> wp.float32:
    """Limit the length of a step."""
    return minimum(maximum(v, -_MAX_STEP), _MAX_STEP)


@wp.func
def step_of(e0: wp.float32, e1: wp.float32, e2: wp.float32, t0: wp.vec2f, t1: wp.vec2f, t2: wp.vec2f, uv: wp.vec2f):
    """Return the change of the coordinates' numerator and denominator along one axis of the picture."""
    total = e0 + e1 + e2
    return wp.vec2f(
        e0 * t0[0] + e1 * t1[0] + e2 * t2[0] - uv[0] * total, e0 * t0[1] + e1 * t1[1] + e2 * t2[1] - uv[1] * total
    )


@wp.func
def steps_between_pixels(
    ray: wp.vec3f,
    focal: wp.float32,
    v0: wp.vec3f,
    v1: wp.vec3f,
    v2: wp.vec3f,
    t0: wp.vec2f,
    t1: wp.vec2f,
    t2: wp.vec2f,
    uv: wp.vec2f,
) -> wp.vec4f:
    """Return the steps of texture coordinates from a pixel to the one on its right, and to the one below it.

    A barycentric weight is the dot product of the ray with the cross product of two corners, so its derivative along an
    axis of the picture is a component of that cross product.
    """
    e0 = cross(v1, v2)
    e1 = cross(v2, v0)
    e2 = cross(v0, v1)
    total = dot(ray, e0) + dot(ray, e1) + dot(ray, e2)
    if total * total < 1.0e-30:
        total = wp.float32(1.0e-15)
    scale = 1.0 / (total * focal)
    right = step_of(e0[0], e1[0], e2[0], t0, t1, t2, uv)
    down = step_of(e0[1], e1[1], e2[1], t0, t1, t2, uv)
    return wp.vec4f(
        bounded(right[0] * scale), bounded(right[1] * scale), bounded(down[0] * scale), bounded(down[1] * scale)
    )


@wp.func
def order_steps(s: wp.vec4f) -> wp.vec4f:
    """Return the two steps, the longer one first."""
    if s[2] * s[2] + s[3] * s[3] > s[0] * s[0] + s[1] * s[1]:
        return wp.vec4f(s[2], s[3], s[0], s[1])
    return s


@wp.func
def share_code(share: wp.float32) -> wp.uint32:
    """Encode a share in [-1, 1] in 16 bits."""
    return wp.uint32(wp.int32(minimum(maximum(share, -1.0), 1.0) * 32767.0 + 32768.0))


@wp.func
def share_of(code: wp.uint32) -> wp.float32:
    """Decode the share of `share_code`."""
    return (wp.float32(wp.int32(code & wp.uint32(0xFFFF))) - 32768.0) * (1.0 / 32767.0)


@wp.func
def second_step(steps: wp.vec4f) -> wp.uint32:
    """Encode the shorter step relative to the longer one's length, in 16 bits per component."""
    length = wp.sqrt(steps[0] * steps[0] + steps[1] * steps[1])
    scale = 1.0 / maximum(length, 1.0e-12)
    return share_code(steps[2] * scale) | (share_code(steps[3] * scale) << wp.uint32(16))


@wp.func
def wrap_texel(i: wp.int32, size: wp.int32, repeats: wp.int32) -> wp.int32:
    """Return a texel's index in a row, wrapped or clamped at the ends."""
    if repeats != 0:
        i = i % size
        if i < 0:
            i = i + size
        return i
    return wp.min(wp.max(i, 0), size - 1)


@wp.func
def texel(album: wp.array[ImageAtlas], level: wp.int32, x: wp.int32, y: wp.int32, repeats: wp.int32) -> wp.vec3f:
    """Return one texel, in linear light."""
    w = album[0].widths[level]
    at = album[0].starts[level] + wrap_texel(y, album[0].heights[level], repeats) * w + wrap_texel(x, w, repeats)
    c = album[0].texels[at]
    return wp.vec3f(
        album[0].linear[wp.int32(c & wp.uint32(255))],
        album[0].linear[wp.int32((c >> wp.uint32(8)) & wp.uint32(255))],
        album[0].linear[wp.int32((c >> wp.uint32(16)) & wp.uint32(255))],
    )


@wp.func
def bilinear(album: wp.array[ImageAtlas], level: wp.int32, x: wp.float32, y: wp.float32, repeats: wp.int32) -> wp.vec3f:
    """Interpolate a level bilinearly at a point in texels."""
    px = x - 0.5
    py = y - 0.5
    ix = floor(px)
    iy = floor(py)
    fx = px - wp.float32(ix)
    fy = py - wp.float32(iy)
    top = texel(album, level, ix, iy, repeats) * (1.0 - fx) + texel(album, level, ix + 1, iy, repeats) * fx
    low = texel(album, level, ix, iy + 1, repeats) * (1.0 - fx) + texel(album, level, ix + 1, iy + 1, repeats) * fx
    return top * (1.0 - fy) + low * fy


@wp.func
def wrap_coordinate(t: wp.float32, repeats: wp.int32) -> wp.float32:
    """Wrap or clamp a coordinate to the image."""
    if repeats != 0:
        return t - wp.float32(floor(t))
    return minimum(maximum(t, 0.0), 1.0)


@wp.struct
class TapLine:
    """The taps of an image for a footprint: points on a line, each interpolated in one level or between two."""

    count: wp.int32
    level: wp.int32  # the finer of the two
    finer: wp.float32  # weight of the level above it; 0: only one level
    scale: wp.float32  # texels of the level per texel of the image
    width: wp.float32  # of the image, texels
    height: wp.float32
    across: wp.float32  # length of the line, texels of the image
    along: wp.float32


@wp.func
def tap_line(album: wp.array[ImageAtlas], image: wp.int32, detail: wp.vec4f, code: wp.uint32) -> TapLine:
    """Return the taps for a footprint: along its longer side, each as wide as the shorter side."""
    first = album[0].first[image]
    last = album[0].first[image + 1] - 1
    w = wp.float32(album[0].widths[first])
    h = wp.float32(album[0].heights[first])
    length = wp.sqrt(detail[2] * detail[2] + detail[3] * detail[3])
    ax = detail[2] * w
    ay = detail[3] * h
    bx = share_of(code) * length * w
    by = share_of(code >> wp.uint32(16)) * length * h
    long = wp.sqrt(ax * ax + ay * ay)
    short = wp.sqrt(bx * bx + by * by)
    if short > long:
        swapped = long
        long = short
        short = swapped
        ax = bx
        ay = by
    short = maximum(maximum(short, long / wp.float32(MAX_TAPS)), 1.0)
    taps = wp.max(wp.min(wp.int32(wp.min(long / short, 99.0) + 0.5), MAX_TAPS), 1)
    short = maximum(short, long / wp.float32(taps))
    scale = wp.float32(1.0)
    level = first
    while short >= 2.0 and level < last:
        short = short * 0.5
        scale = scale * 0.5
        level = level + 1
    finer = minimum(short - 1.0, 1.0)  # linear between two levels, in place of the logarithm of the size
    if level == last:
        finer = wp.float32(0.0)
    return TapLine(taps, level, finer, scale, w, h, ax, ay)


@wp.func
def tap_at(line: TapLine, detail: wp.vec4f, repeats: wp.int32, k: wp.int32) -> wp.vec2f:
    """Return the place of a tap, in texels of the line's level."""
    along = (wp.float32(k) + 0.5) / wp.float32(line.count) - 0.5
    return wp.vec2f(
        wrap_coordinate(detail[0] + along * line.across / line.width, repeats) * line.width * line.scale,
        wrap_coordinate(detail[1] + along * line.along / line.height, repeats) * line.height * line.scale,
    )


@wp.func
def image_at(album: wp.array[ImageAtlas], image: wp.int32, detail: wp.vec4f, code: wp.uint32) -> wp.vec3f:
    """Return the mean linear colour of an image over the footprint of a pixel."""
    repeats = album[0].repeats[image]
    line = tap_line(album, image, detail, code)
    total = wp.vec3f(0.0, 0.0, 0.0)
    for k in range(line.count):
        at = tap_at(line, detail, repeats, k)
        colour = bilinear(album, line.level, at[0], at[1], repeats)
        if line.finer > 0.0:
            upper = bilinear(album, line.level + 1, at[0] * 0.5, at[1] * 0.5, repeats)
            colour = colour * (1.0 - line.finer) + upper * line.finer
        total = total + colour
    return total * (1.0 / wp.float32(line.count))
