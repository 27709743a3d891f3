"""Motion blur: what a plate's light becomes while the shutter is open, from two poses and no history.

Every sample knows its surface's way on the screen from one frame to the next, and so its way during the exposure. For
each moment of the exposure a sample shows the nearest of what has come to lie on it, and where a surface has moved
away, what its neighbourhood shows behind it. Along the way only one other motion is considered, the longest near by.
The exposure is centred on the frame's time.
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
    """A plate, and how long its exposure is."""

    wide: wp.int32
    high: wp.int32
    frames: wp.float32  # from opening to closing
    most: wp.float32  # samples that a blur is long, at most


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
    """A sample's way on the plate during the exposure; the sky turns with the camera."""
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
    if length > shutter.most:
        vx = vx * (shutter.most / length)
        vy = vy * (shutter.most / length)
    out_motion[i] = wp.vec2f(vx, vy)


@wp.func
def longer(a: wp.vec2f, b: wp.vec2f) -> bool:
    """Whether a is longer than b."""
    return a[0] * a[0] + a[1] * a[1] > b[0] * b[0] + b[1] * b[1]


@wp.kernel
def longest_in_tile(motion: wp.array[wp.vec2f], shutter: Shutter, out_longest: wp.array[wp.vec2f]):
    """A tile's longest way, the first of equals."""
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
    """The longest way that comes into a tile from anywhere."""
    i = wp.tid()
    columns = (shutter.wide + TILE - 1) / TILE
    rows = (shutter.high + TILE - 1) / TILE
    column = i % columns
    row = i / columns
    radius = wp.int32(0.5 * shutter.most) / TILE + 1
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
    """The sample nearest to a place, within the plate."""
    i = wp.int32(wp.min(wp.max(x + 0.5, 0.0), wp.float32(s.wide - 1)))
    j = wp.int32(wp.min(wp.max(y + 0.5, 0.0), wp.float32(s.high - 1)))
    return j * s.wide + i


@wp.func
def lands_on(at: wp.int32, way: wp.vec2f, t: wp.float32, x: wp.float32, y: wp.float32, s: Shutter) -> bool:
    """Whether what a sample sees lies on (x, y) at moment t of the exposure, from -1/2 to 1/2.

    Its place was rounded to a sample, and neighbours on one surface differ in their ways, as when a camera drives.
    """
    dx = wp.float32(at % s.wide) + way[0] * t - x
    dy = wp.float32(at / s.wide) + way[1] * t - y
    slack = 0.75 + 0.05 * wp.abs(t) * wp.sqrt(way[0] * way[0] + way[1] * way[1])
    return dx * dx + dy * dy <= slack * slack


@wp.func
def is_in_front(a: wp.uint64, b: wp.uint64) -> bool:
    """Whether a is well before b: two samples of one surface hardly ever are."""
    nearness = wp.float64(wp.int64(b >> wp.uint64(24)))  # keys grow with it
    return wp.float64(wp.int64(a >> wp.uint64(24))) > nearness * wp.float64(1.02)


@wp.kernel
def average_exposure(
    plate: wp.array[wp.vec3f],
    keys: wp.array[wp.uint64],
    motion: wp.array[wp.vec2f],
    longest: wp.array[wp.vec2f],
    shutter: Shutter,
    out_light: wp.array[wp.vec3f],
):
    """One sample's light, averaged over the moments of the exposure."""
    i = wp.tid()
    row = i / shutter.wide
    column = i - row * shutter.wide
    there = longest[row / TILE * ((shutter.wide + TILE - 1) / TILE) + column / TILE]
    length = wp.sqrt(there[0] * there[0] + there[1] * there[1])
    if length < 0.5:
        out_light[i] = plate[i]
        return
    x = wp.float32(column)
    y = wp.float32(row)
    own = motion[i]
    moments = wp.min(wp.int32(length) + 2, MAX_STEPS)
    here = plate[i]
    total = wp.vec3f(0.0, 0.0, 0.0)  # of differences, so that what does not change stays the same to the bit
    for n in range(moments):
        t = (wp.float32(n) + 0.5) / wp.float32(moments) - 0.5
        # Where something comes from is guessed from one way along, and then found by the way of what is there.
        a = place_at(x - there[0] * t, y - there[1] * t, shutter)
        a = place_at(x - motion[a][0] * t, y - motion[a][1] * t, shutter)
        behind = place_at(x - own[0] * t, y - own[1] * t, shutter)
        b = place_at(x - motion[behind][0] * t, y - motion[behind][1] * t, shutter)
        stays = lands_on(b, motion[b], t, x, y, shutter)
        if lands_on(a, motion[a], t, x, y, shutter) and (not stays or is_in_front(keys[a], keys[b])):
            total = total + (plate[a] - here)
        elif stays:
            total = total + (plate[b] - here)
        elif is_in_front(keys[i], keys[behind]):  # (what is nearer hides the way, and does not belong to it)
            total = total + (plate[behind] - here)
    out_light[i] = here + total * (1.0 / wp.float32(moments))
