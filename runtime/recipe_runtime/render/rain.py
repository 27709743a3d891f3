"""Rain: drops about the camera, streaked over the exposure, slanted by the wind, other ones every frame.

A drop is a segment of the world. It adds its cover to the pixels along it that lie before what is seen there; covers
are whole numbers, so their sum does not depend on the order of drops.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.noise import scramble, unit, whole
from recipe_runtime.render.observation import depth_of
from recipe_runtime.render.visibility import Lens

wp.set_module_options(OPTIONS)


@wp.struct
class Shower:
    """How it rains in one frame."""

    key: wp.uint32  # of seed and frame
    count: wp.int32
    fall: wp.vec3f  # a drop's way during the exposure, in the camera's frame
    depth: wp.float32  # metres from the camera within which drops are drawn
    cover: wp.float32


@wp.kernel
def streaks(shower: Shower, keys: wp.array[wp.uint64], lens: Lens, rain: wp.array[wp.int32]):
    """Draw one drop."""
    i = wp.tid()
    h = scramble(wp.uint32(i) * wp.uint32(0x9E3779B) ^ shower.key)
    a = unit(h)
    h = scramble(h + wp.uint32(0x6D2B79))
    b = unit(h)
    h = scramble(h + wp.uint32(0x6D2B79))
    c = unit(h)
    h = scramble(h + wp.uint32(0x6D2B79))
    size = 0.6 + 0.8 * unit(h)
    # Spread evenly through the view's pyramid: the cube root of a cube's share, by its own volume's draw.
    z = 0.9 + (shower.depth - 0.9) * wp.max(a, wp.max(b, c))
    h = scramble(h + wp.uint32(0x6D2B79))
    u = unit(h) * 1.2 - 0.1
    h = scramble(h + wp.uint32(0x6D2B79))
    v = unit(h) * 1.3 - 0.2
    focal = wp.float32(lens.focal)
    x0 = u * wp.float32(lens.width)
    y0 = v * wp.float32(lens.height)
    z1 = wp.max(z + shower.fall[2], 0.5)
    wx = (x0 - wp.float32(lens.cx)) / focal * z + shower.fall[0]
    wy = (y0 - wp.float32(lens.cy)) / focal * z + shower.fall[1]
    x1 = wx / z1 * focal + wp.float32(lens.cx)
    y1 = wy / z1 * focal + wp.float32(lens.cy)
    dx = x1 - x0
    dy = y1 - y0
    reach = wp.max(wp.max(dx, -dx), wp.max(dy, -dy))
    steps = wp.min(whole(reach) + 1, 400)
    width = 0.003 * size * focal / z  # pixels
    share = wp.min(width, 1.0)
    broad = wp.min(whole(width) + 1, 3)
    cover = wp.int32(65536.0 * shower.cover * share)
    for s in range(steps):
        t = (wp.float32(s) + 0.5) / wp.float32(steps)
        px = whole(x0 + dx * t)
        py = whole(y0 + dy * t)
        if py >= 0 and py < lens.height:
            for k in range(broad):
                qx = px + k
                if qx >= 0 and qx < lens.width:
                    pixel = py * lens.width + qx
                    key = keys[pixel]
                    if key == wp.uint64(0) or wp.float32(depth_of(key, lens.near)) > z:
                        wp.atomic_add(rain, pixel, cover)
