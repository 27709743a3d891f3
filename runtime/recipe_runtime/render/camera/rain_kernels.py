"""Rain: drops that fall through the world, drawn as streaks over the exposure, slanted by the wind.

The drops of a cube repeat periodically in space; each falls at its own speed, and its position follows from the time
alone, so a drop of one frame is lower in the next. A drop adds its cover to the pixels along its streak that lie in
front of the visible surface; covers are integers, so their sum does not depend on the order of drops.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.noise import floor, scramble, unit
from recipe_runtime.render.numeric.scalars import maximum, minimum, nonnegative
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

NEAREST = wp.constant(wp.float32(1.4))  # metres from the camera
FOCUS = wp.constant(wp.float32(5.0))  # metres; nearer drops are blurred, and so fainter


@wp.struct
class Rain:
    """The rain of one frame."""

    key: wp.uint32  # of the seed
    count: wp.int32  # number of drops in the cube
    cube: wp.float32  # metres along its side
    low: wp.vec3d  # low corner of the cube around the camera, in the world
    eye: wp.vec3d
    time: wp.float64  # seconds
    fall: wp.vec3d  # velocity of a drop of medium size in the world, m/s
    streak: wp.vec3f  # its displacement during the exposure, in view space
    depth: wp.float32  # metres from the camera within which drops are drawn
    cover: wp.float32


@wp.func
def wrap_coordinate(start: wp.uint32, moved: wp.float64, low: wp.float64, cube: wp.float32) -> wp.float64:
    """Return a coordinate, within the cube from `low` on, of a drop that has moved from its start, a hash."""
    side = wp.float64(cube)
    t = (wp.float64(unit(start)) * side + moved - low) / side
    i = wp.float64(wp.int64(t))
    if i > t:
        i = i - wp.float64(1.0)
    return low + (t - i) * side


@wp.func
def cover_pixels(
    left: wp.float32,
    y: wp.float32,
    z: wp.float32,
    broad: wp.int32,
    cover: wp.float32,
    depth: wp.array[wp.float32],
    pinhole: Pinhole,
    out_cover: wp.array[wp.int32],
):
    """Add a drop's cover to the pixels of one row, from `left` on, whose surface is behind it at depth z."""
    px = floor(left)
    py = floor(y)
    past = left - wp.float32(px)
    if py >= 0 and py < pinhole.height:
        # Pixels at both sides are covered in part, which antialiases slanted streaks.
        for k in range(broad + 1):
            qx = px + k
            part = wp.float32(1.0)
            if k == 0:
                part = 1.0 - past
            if k == broad:
                part = past
            if qx >= 0 and qx < pinhole.width:
                pixel = nonnegative(py * pinhole.width + qx)
                if depth[pixel] > z:
                    wp.atomic_add(out_cover, pixel, wp.int32(cover * part))


@wp.kernel
def draw_streaks(
    shower: wp.array[Rain],
    depth: wp.array[wp.float32],
    view_from_world: wp.array2d[wp.float32],
    pinhole: Pinhole,
    out_cover: wp.array[wp.int32],
):
    """Draw one drop."""
    i = wp.tid()
    h = scramble(wp.uint32(i) * wp.uint32(0x9E3779B) ^ shower[0].key)
    size = 0.6 + 0.8 * unit(h)
    speed = 0.8 + 0.2 * size  # large drops fall faster
    passed = shower[0].time * wp.float64(speed)
    low = shower[0].low
    cube = shower[0].cube
    h = scramble(h + wp.uint32(0x6D2B79))
    x = wp.float32(wrap_coordinate(h, shower[0].fall[0] * passed, low[0], cube) - shower[0].eye[0])
    h = scramble(h + wp.uint32(0x6D2B79))
    y = wp.float32(wrap_coordinate(h, shower[0].fall[1] * passed, low[1], cube) - shower[0].eye[1])
    h = scramble(h + wp.uint32(0x6D2B79))
    w = wp.float32(wrap_coordinate(h, shower[0].fall[2] * passed, low[2], cube) - shower[0].eye[2])
    z = (view_from_world[0, 8] * x + view_from_world[0, 9] * y) + view_from_world[0, 10] * w
    if z < NEAREST or z > shower[0].depth:
        return
    focal = wp.float32(pinhole.focal)
    vx = (view_from_world[0, 0] * x + view_from_world[0, 1] * y) + view_from_world[0, 2] * w
    vy = (view_from_world[0, 4] * x + view_from_world[0, 5] * y) + view_from_world[0, 6] * w
    x0 = vx / z * focal + wp.float32(pinhole.cx)
    y0 = vy / z * focal + wp.float32(pinhole.cy)
    z1 = maximum(z + shower[0].streak[2] * speed, 0.5)
    x1 = (vx + shower[0].streak[0] * speed) / z1 * focal + wp.float32(pinhole.cx)
    y1 = (vy + shower[0].streak[1] * speed) / z1 * focal + wp.float32(pinhole.cy)
    if maximum(x0, x1) < -3.0 or minimum(x0, x1) > wp.float32(pinhole.width):
        return
    if maximum(y0, y1) < -1.0 or minimum(y0, y1) > wp.float32(pinhole.height):
        return
    dx = x1 - x0
    dy = y1 - y0
    reach = maximum(maximum(dx, -dx), maximum(dy, -dy))
    steps = wp.min(floor(reach) + 1, 400)
    width = 0.003 * size * focal / z  # pixels
    share = minimum(width, 1.0)
    broad = wp.min(floor(width) + 1, 3)
    cover = 65536.0 * shower[0].cover * share * minimum(z / FOCUS, 1.0)
    for s in range(steps):
        t = (wp.float32(s) + 0.5) / wp.float32(steps)
        cover_pixels(x0 + dx * t - 0.5, y0 + dy * t, z, broad, cover, depth, pinhole, out_cover)
