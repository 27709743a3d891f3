"""Triangles on the screen: corners snapped to 1/256 pixel, edge functions, and the cut at the near plane."""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

NEARNESS = wp.constant(wp.float64(1099511627775.0))  # 2^40 - 1
GUARD_BAND = wp.constant(wp.float64(536870912.0))  # 2^29: corners beyond this many 1/256 pixels would overflow


@wp.struct
class Corner:
    """A projected corner: 1/256 pixels, and nearness near / depth in (0, 1]."""

    x: wp.int64
    y: wp.int64
    q: wp.float64


@wp.func
def snap(v: wp.float64) -> wp.int64:
    """The nearest 1/256 pixel, halves up; guarded against overflow."""
    s = wp.max(wp.min(v * wp.float64(256.0) + wp.float64(0.5), GUARD_BAND), -GUARD_BAND)
    i = wp.int64(s)
    if wp.float64(i) > s:
        i = i - wp.int64(1)
    return i


@wp.func
def project(x: wp.float64, y: wp.float64, z: wp.float64, lens: Pinhole) -> Corner:
    """The corner of a point at depth z >= near."""
    scale = lens.focal / z
    c = Corner()
    c.x = snap(lens.cx + x * scale)
    c.y = snap(lens.cy + y * scale)
    c.q = lens.near / z
    return c


@wp.func
def project_vertex(v: wp.vec3f, lens: Pinhole) -> Corner:
    """The corner of a vertex that is not behind the near plane."""
    return project(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]), lens)


@wp.func
def cut_at_near_plane(a: wp.vec3f, b: wp.vec3f, lens: Pinhole) -> Corner:
    """Where the edge from a (in front of the near plane) to b (behind it) meets that plane."""
    za = wp.float64(a[2])
    t = (za - lens.near) / (za - wp.float64(b[2]))
    x = wp.float64(a[0]) + (wp.float64(b[0]) - wp.float64(a[0])) * t
    y = wp.float64(a[1]) + (wp.float64(b[1]) - wp.float64(a[1])) * t
    return project(x, y, lens.near, lens)


@wp.func
def edge_function(ax: wp.int64, ay: wp.int64, bx: wp.int64, by: wp.int64, x: wp.int64, y: wp.int64) -> wp.int64:
    """Twice the area of the triangle a, b, (x, y): positive on the inner side of the edge from a to b."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@wp.func
def top_left_bias(ax: wp.int64, ay: wp.int64, bx: wp.int64, by: wp.int64) -> wp.int64:
    """0 for a top or left edge, which owns its samples; -1 for the others, which do not."""
    if by < ay or (by == ay and bx > ax):
        return wp.int64(0)
    return wp.int64(-1)
