"""Shadows: how near to the sun the first thing along each of its rays is.

The sun's rays are a picture of their own: u level, v up in the plane they cross, nearness along them. What stands
still is drawn once for a sun's place; what moves is drawn every frame into two maps about the camera, fine and
coarse, whose texels are fixed in the world. Flat ground casts nothing, so it cannot shadow itself by rounding.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.visibility import Corner, Lens, draw, snap

wp.set_module_options(OPTIONS)

TILE = wp.constant(16)  # texels along the side of a tile that is known to be empty or not


@wp.struct
class Sunbeam:
    """A shadow map's frame: texel = world . axis + offset, nearness = world . towards + offset, in 0..1."""

    u: wp.vec4f
    v: wp.vec4f
    q: wp.vec4f
    size: wp.int32  # texels along a side; 0: no map
    texel: wp.float32  # metres, the larger side
    depth: wp.float32  # metres from nearness 0 to 1


@wp.func
def along(axis: wp.vec4f, p: wp.vec3f) -> wp.float32:
    """A coordinate of a point."""
    return ((axis[0] * p[0] + axis[1] * p[1]) + axis[2] * p[2]) + axis[3]


@wp.func
def corner(beam: Sunbeam, p: wp.vec3f) -> Corner:
    """A point in the map, in 1/256 texel."""
    c = Corner()
    c.x = snap(wp.float64(along(beam.u, p)))
    c.y = snap(wp.float64(along(beam.v, p)))
    c.q = wp.float64(wp.min(wp.max(along(beam.q, p), 1.0e-6), 1.0))
    return c


@wp.kernel
def cast(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    casts: wp.array[wp.int32],
    first: wp.int32,
    beam: Sunbeam,
    lens: Lens,
    keys: wp.array[wp.uint64],
    used: wp.array[wp.int32],
):
    """Draw the triangles first.. of world-space vertices into the map, whichever way they face."""
    i = first + wp.tid()
    if casts[i] == 0:
        return
    t = triangles[i]
    a = corner(beam, vertices[t[0]])
    b = corner(beam, vertices[t[1]])
    c = corner(beam, vertices[t[2]])
    if (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x) < wp.int64(0):
        turn = b
        b = c
        c = turn
    draw(keys, lens, a, b, c, wp.uint64(0), wp.uint64(0))
    # Mark the tiles that it may touch, a filter's width further out.
    side = beam.size / TILE
    left = wp.max(int((wp.min(a.x, wp.min(b.x, c.x)) >> wp.int64(8)) - wp.int64(3)) / TILE, 0)
    top = wp.max(int((wp.min(a.y, wp.min(b.y, c.y)) >> wp.int64(8)) - wp.int64(3)) / TILE, 0)
    right = wp.min(int((wp.max(a.x, wp.max(b.x, c.x)) >> wp.int64(8)) + wp.int64(3)) / TILE, side - 1)
    bottom = wp.min(int((wp.max(a.y, wp.max(b.y, c.y)) >> wp.int64(8)) + wp.int64(3)) / TILE, side - 1)
    for y in range(top, bottom + 1):
        for x in range(left, right + 1):
            used[y * side + x] = 1


@wp.kernel
def nearness(keys: wp.array[wp.uint64], used: wp.array[wp.int32], size: wp.int32, out: wp.array[wp.float32]):
    """One used tile's keys as nearness in 0..1, half as large to keep; `out` comes zeroed."""
    tile = wp.tid()
    if used[tile] == 0:
        return
    side = size / TILE
    first = (tile / side) * TILE * size + (tile % side) * TILE
    for y in range(TILE):
        for x in range(TILE):
            i = first + y * size + x
            out[i] = wp.float32(wp.float64(wp.int64(keys[i] >> wp.uint64(24))) / wp.float64(1099511627775.0))


@wp.func
def holds(beam: Sunbeam, p: wp.vec3f) -> bool:
    """Whether a point lies well within the map."""
    u = along(beam.u, p)
    v = along(beam.v, p)
    edge = wp.float32(beam.size - 12)
    return u > 12.0 and v > 12.0 and u < edge and v < edge


@wp.func
def lit(beam: Sunbeam, depths: wp.array[wp.float32], used: wp.array[wp.int32], p: wp.vec3f, n: wp.vec3f) -> wp.float32:
    """The share of the sun seen from a point with normal n: nine bilinear taps, so that edges are soft and still."""
    if beam.size == 0:
        return 1.0
    lift = 0.6 * beam.texel + 0.004
    r = wp.vec3f(p[0] + n[0] * lift, p[1] + n[1] * lift, p[2] + n[2] * lift)
    u = along(beam.u, r) - 0.5
    v = along(beam.v, r) - 0.5
    edge = wp.float32(beam.size - 4)
    if u < 3.0 or v < 3.0 or u > edge or v > edge:
        return 1.0
    i = int(u)
    j = int(v)
    if used[(j / TILE) * (beam.size / TILE) + i / TILE] == 0:
        return 1.0
    fu = u - wp.float32(i)
    fv = v - wp.float32(j)
    q = along(beam.q, r) + (0.01 + 0.35 * beam.texel) / beam.depth
    total = wp.float32(0.0)
    for y in range(4):
        wy = wp.float32(1.0)
        if y == 0:
            wy = 1.0 - fv
        if y == 3:
            wy = fv
        base = (j + y - 1) * beam.size + i - 1
        row = wp.float32(0.0)
        if depths[base] <= q:
            row = row + 1.0 - fu
        if depths[base + 1] <= q:
            row = row + 1.0
        if depths[base + 2] <= q:
            row = row + 1.0
        if depths[base + 3] <= q:
            row = row + fu
        total = total + row * wy
    return total / 9.0
