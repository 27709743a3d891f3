"""Motion blur of an HDR image, from the poses of two frames; no history is used.

The screen-space motion of every sample follows from the poses of its part in both frames. At each of several moments of
the exposure, a sample shows the nearest surface that has moved onto it; where a surface has moved away, it shows the
background near it. Besides its own motion, a sample considers one other: the longest in its neighbourhood. The exposure
is centred on the frame's time.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.raster.label_kernels import depth_of, triangle_of
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

TILE = wp.constant(16)
MAX_STEPS = wp.constant(96)  # of an exposure, at most


@wp.struct
class Shutter:
    """The size of an HDR image, and the length of its exposure."""

    wide: wp.int32
    high: wp.int32
    frames: wp.float32  # length of the exposure, in intervals between the two frames
    max_length: wp.float32  # of a blur, in samples


@wp.kernel
def screen_motion(
    keys: wp.array[wp.uint64],
    triangles: wp.array[wp.vec3i],
    vertex_part: wp.array[wp.int32],
    then_from_now: wp.array2d[wp.float32],
    pinhole: Pinhole,
    shutter: Shutter,
    out_motion: wp.array[wp.vec2f],
):
    """Write a sample's motion during the exposure, in samples; the sky moves as the camera turns."""
    i = wp.tid()
    key = keys[i]
    x = wp.float32((wp.float64(i % shutter.wide) + wp.float64(0.5) - pinhole.cx) / pinhole.focal)
    y = wp.float32((wp.float64(i / shutter.wide) + wp.float64(0.5) - pinhole.cy) / pinhole.focal)
    m = then_from_now
    part = wp.int32(0)
    away = wp.float32(0.0)
    if key != wp.uint64(0):
        part = vertex_part[triangles[triangle_of(key)][0]]
        away = 1.0 / wp.float32(depth_of(key, pinhole.near))
    px = (m[part, 0] * x + m[part, 1] * y) + m[part, 2] + m[part, 3] * away
    py = (m[part, 4] * x + m[part, 5] * y) + m[part, 6] + m[part, 7] * away
    pz = wp.max((m[part, 8] * x + m[part, 9] * y) + m[part, 10] + m[part, 11] * away, 0.05)
    scale = wp.float32(pinhole.focal) * shutter.frames
    vx = (px / pz - x) * scale
    vy = (py / pz - y) * scale
    length = wp.sqrt(vx * vx + vy * vy)
    if length > shutter.max_length:
        vx = vx * (shutter.max_length / length)
        vy = vy * (shutter.max_length / length)
    out_motion[i] = wp.vec2f(vx, vy)


@wp.func
def longer(a: wp.vec2f, b: wp.vec2f) -> bool:
    """Whether a is longer than b."""
    return a[0] * a[0] + a[1] * a[1] > b[0] * b[0] + b[1] * b[1]


@wp.kernel
def longest_in_tile(motion: wp.array[wp.vec2f], shutter: Shutter, out_longest: wp.array[wp.vec2f]):
    """Write the longest motion in a tile, the first of equals."""
    i = wp.tid()
    columns = (shutter.wide + TILE - 1) / TILE
    x0 = i % columns * TILE
    y0 = i / columns * TILE
    best = wp.vec2f(0.0, 0.0)
    for y in range(y0, wp.min(y0 + TILE, shutter.high)):
        for x in range(x0, wp.min(x0 + TILE, shutter.wide)):
            way = motion[y * shutter.wide + x]
            if longer(way, best):
                best = way
    out_longest[i] = best


@wp.kernel
def longest_around_tile(longest: wp.array[wp.vec2f], shutter: Shutter, out_longest: wp.array[wp.vec2f]):
    """Write the longest motion that reaches a tile from any tile near it."""
    i = wp.tid()
    columns = (shutter.wide + TILE - 1) / TILE
    rows = (shutter.high + TILE - 1) / TILE
    column = i % columns
    row = i / columns
    radius = wp.int32(0.5 * shutter.max_length) / TILE + 1
    best = longest[i]
    for v in range(wp.max(row - radius, 0), wp.min(row + radius, rows - 1) + 1):
        for u in range(wp.max(column - radius, 0), wp.min(column + radius, columns - 1) + 1):
            way = longest[v * columns + u]
            across = wp.float32(wp.max(wp.abs(u - column) - 1, 0) * TILE)
            down = wp.float32(wp.max(wp.abs(v - row) - 1, 0) * TILE)
            comes = across <= 0.5 * wp.abs(way[0]) + 1.0 and down <= 0.5 * wp.abs(way[1]) + 1.0
            if comes and longer(way, best):
                best = way
    out_longest[i] = best


@wp.func
def place_at(x: wp.float32, y: wp.float32, s: Shutter) -> wp.int32:
    """Return the index of the sample nearest to a point, within the image."""
    i = wp.int32(wp.min(wp.max(x + 0.5, 0.0), wp.float32(s.wide - 1)))
    j = wp.int32(wp.min(wp.max(y + 0.5, 0.0), wp.float32(s.high - 1)))
    return j * s.wide + i


@wp.func
def lands_on(at: wp.int32, way: wp.vec2f, t: wp.float32, x: wp.float32, y: wp.float32, s: Shutter) -> bool:
    """Return whether the surface of a sample lies on (x, y) at moment t of the exposure, from -1/2 to 1/2.

    The tolerance covers the rounding to a sample, and the difference of motion between neighbours on one surface.
    """
    dx = wp.float32(at % s.wide) + way[0] * t - x
    dy = wp.float32(at / s.wide) + way[1] * t - y
    slack = 0.75 + 0.05 * wp.abs(t) * wp.sqrt(way[0] * way[0] + way[1] * way[1])
    return dx * dx + dy * dy <= slack * slack


@wp.func
def is_in_front(a: wp.uint64, b: wp.uint64) -> bool:
    """Return whether a is nearer than b by more than neighbouring samples of one surface usually differ."""
    nearness = wp.float64(wp.int64(b >> wp.uint64(24)))  # keys grow with it
    return wp.float64(wp.int64(a >> wp.uint64(24))) > nearness * wp.float64(1.02)


@wp.func
def longest_near(i: wp.int32, longest: wp.array[wp.vec2f], s: Shutter) -> wp.vec2f:
    """Return the longest motion that reaches the tile of a sample."""
    row = i / s.wide
    column = i - row * s.wide
    return longest[row / TILE * ((s.wide + TILE - 1) / TILE) + column / TILE]


@wp.func
def moments_of(there: wp.vec2f) -> wp.int32:
    """Return the moments of the exposure that a sample averages, 0 if nothing near it moves."""
    length = wp.sqrt(there[0] * there[0] + there[1] * there[1])
    if length < 0.5:
        return wp.int32(0)
    return wp.min(wp.int32(length) + 2, MAX_STEPS)


@wp.func
def shown_at_moment(
    i: wp.int32,
    n: wp.int32,
    moments: wp.int32,
    there: wp.vec2f,
    keys: wp.array[wp.uint64],
    motion: wp.array[wp.vec2f],
    shutter: Shutter,
) -> wp.int32:
    """Return the index of the sample whose light sample i shows at moment n of the exposure."""
    row = i / shutter.wide
    x = wp.float32(i - row * shutter.wide)
    y = wp.float32(row)
    own = motion[i]
    t = (wp.float32(n) + 0.5) / wp.float32(moments) - 0.5
    # Estimate the origin from one motion, then correct it by the motion of the surface found there.
    a = place_at(x - there[0] * t, y - there[1] * t, shutter)
    a = place_at(x - motion[a][0] * t, y - motion[a][1] * t, shutter)
    behind = place_at(x - own[0] * t, y - own[1] * t, shutter)
    b = place_at(x - motion[behind][0] * t, y - motion[behind][1] * t, shutter)
    stays = lands_on(b, motion[b], t, x, y, shutter)
    shown = i
    if lands_on(a, motion[a], t, x, y, shutter) and (not stays or is_in_front(keys[a], keys[b])):
        shown = a
    elif stays:
        shown = b
    elif is_in_front(keys[i], keys[behind]):  # a nearer surface hides the origin
        shown = behind
    return shown


@wp.kernel
def average_exposure(
    hdr_image: wp.array[wp.vec3f],
    keys: wp.array[wp.uint64],
    motion: wp.array[wp.vec2f],
    longest: wp.array[wp.vec2f],
    shutter: Shutter,
    out_light: wp.array[wp.vec3f],
):
    """Write a sample's light, averaged over the moments of the exposure."""
    i = wp.tid()
    there = longest_near(i, longest, shutter)
    moments = moments_of(there)
    if moments == 0:
        out_light[i] = hdr_image[i]
        return
    here = hdr_image[i]
    total = wp.vec3f(0.0, 0.0, 0.0)  # of differences, so that unchanged light stays bit-identical
    for n in range(moments):
        shown = shown_at_moment(i, n, moments, there, keys, motion, shutter)
        total = total + (hdr_image[shown] - here)
    out_light[i] = here + total * (1.0 / wp.float32(moments))
