"""Shadow maps: the nearness of the first surface along each ray of the sun.

A map is an orthographic picture from the sun: u horizontal and v upward in the plane across its rays, nearness along
them. The static scene is drawn once for a sun direction; moving objects are drawn every frame into two maps around the
camera, fine and coarse, whose texels are fixed in the world. Flat ground casts no shadow, so rounding cannot make it
shadow itself.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import box_extent, transform_point
from recipe_runtime.render.raster.triangles import Corner, edge_function, snap, visible_triangle
from recipe_runtime.render.raster.visibility_kernels import fill_triangle
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

UNTOUCHED = wp.constant(8)  # of a tile: no moving object affects its light
TILE = wp.constant(16)  # texels along the side of a tile, the unit of clearing and bounds
MIN_FACING = wp.constant(wp.float32(0.08))  # cosine to the sun below which a surface's slope no longer grows


@wp.struct
class Sunbeam:
    """A shadow map's frame: texel = world . axis + offset, nearness = world . towards + offset, in 0..1."""

    u: wp.vec4f
    v: wp.vec4f
    q: wp.vec4f
    size: wp.int32  # texels along a side; 0: no map
    texel: wp.float32  # metres, the larger side
    depth: wp.float32  # metres from nearness 0 to 1
    depths: wp.array[wp.float32]  # nearness by texel
    bounds: wp.array[wp.vec2f]  # by tile, minimum and maximum nearness that a filter may read


@wp.func
def axis_coordinate(axis: wp.vec4f, p: wp.vec3f) -> wp.float32:
    """Return a coordinate of a point."""
    return ((axis[0] * p[0] + axis[1] * p[1]) + axis[2] * p[2]) + axis[3]


@wp.func
def map_corner(beams: wp.array[Sunbeam], p: wp.vec3f) -> Corner:
    """Return a point in the map, in 1/256 texels."""
    c = Corner()
    c.x = snap(wp.float64(axis_coordinate(beams[0].u, p)))
    c.y = snap(wp.float64(axis_coordinate(beams[0].v, p)))
    c.q = wp.float64(wp.min(wp.max(axis_coordinate(beams[0].q, p), 1.0e-6), 1.0))
    return c


@wp.func
def box_meets_map(
    axis: wp.vec4f, m: wp.array2d[wp.float32], part: wp.int32, c: wp.vec3f, half: wp.vec3f, size: wp.int32
) -> bool:
    """Return whether a box about c may lie within the map, or a filter's width outside, along one of its axes."""
    r = box_extent(m, part, half, wp.vec3f(axis[0], axis[1], axis[2])) + 8.0
    at = axis_coordinate(axis, c)
    return at + r > 0.0 and at - r < wp.float32(size)


@wp.kernel
def cull_casters(
    chunks: wp.array[wp.vec3i],
    chunk_centres: wp.array[wp.vec3f],
    chunk_halves: wp.array[wp.vec3f],
    transforms: wp.array2d[wp.float32],
    beams: wp.array[Sunbeam],
    first_chunk: wp.int32,
    out_visible: wp.array[wp.int32],
):
    """Write 1 for every chunk whose box may overlap the map; `transforms` lead from the parts to the world."""
    i = first_chunk + wp.tid()
    part = chunks[i][2]
    c = transform_point(transforms, part, chunk_centres[i])
    size = beams[0].size
    across = box_meets_map(beams[0].u, transforms, part, c, chunk_halves[i], size)
    out_visible[i] = int(across and box_meets_map(beams[0].v, transforms, part, c, chunk_halves[i], size))


@wp.kernel
def raster_casters(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    chunks: wp.array[wp.vec3i],
    chunk_visible: wp.array[wp.int32],
    casts: wp.array[wp.int32],
    first_chunk: wp.int32,
    beams: wp.array[Sunbeam],
    pinhole: Pinhole,
    out_keys: wp.array[wp.uint64],
    out_used: wp.array[wp.int32],
):
    """Rasterise visible chunks of world-space vertices into the map, front and back faces."""
    i = visible_triangle(wp.tid(), first_chunk, chunks, chunk_visible)
    if i < 0:
        return
    if casts[i] == 0:
        return
    t = triangles[i]
    a = map_corner(beams, vertices[t[0]])
    b = map_corner(beams, vertices[t[1]])
    c = map_corner(beams, vertices[t[2]])
    if edge_function(a.x, a.y, b.x, b.y, c.x, c.y) < wp.int64(0):
        turn = b
        b = c
        c = turn
    fill_triangle(out_keys, pinhole, a, b, c, wp.uint64(0), wp.uint64(0))
    # Mark the tiles that it may touch, including a filter's width.
    side = beams[0].size / TILE
    left = wp.max(int((wp.min(a.x, wp.min(b.x, c.x)) >> wp.int64(8)) - wp.int64(3)) / TILE, 0)
    top = wp.max(int((wp.min(a.y, wp.min(b.y, c.y)) >> wp.int64(8)) - wp.int64(3)) / TILE, 0)
    right = wp.min(int((wp.max(a.x, wp.max(b.x, c.x)) >> wp.int64(8)) + wp.int64(3)) / TILE, side - 1)
    bottom = wp.min(int((wp.max(a.y, wp.max(b.y, c.y)) >> wp.int64(8)) + wp.int64(3)) / TILE, side - 1)
    for y in range(top, bottom + 1):
        for x in range(left, right + 1):
            out_used[y * side + x] = 1


@wp.kernel
def resolve_depths(
    keys: wp.array[wp.uint64],
    used: wp.array[wp.int32],
    used_before: wp.array[wp.int32],
    size: wp.int32,
    rows_per_thread: wp.int32,
    out_depths: wp.array[wp.float32],
):
    """Convert some rows of a used tile from 64-bit keys to float32 nearness in 0..1, and clear the keys.

    `out_depths` must be 0 except in the tiles of `used_before`, which are cleared.
    """
    shares = TILE / rows_per_thread
    tile = wp.tid() / shares
    if used[tile] == 0 and used_before[tile] == 0:
        return
    side = size / TILE
    first = (tile / side) * TILE * size + (tile % side) * TILE
    top = (wp.tid() % shares) * rows_per_thread
    for y in range(top, top + rows_per_thread):
        for x in range(TILE):
            i = first + y * size + x
            out_depths[i] = wp.float32(wp.float64(wp.int64(keys[i] >> wp.uint64(24))) / wp.float64(1099511627775.0))
            keys[i] = wp.uint64(0)


@wp.kernel
def bound_depths(
    depths: wp.array[wp.float32], used: wp.array[wp.int32], size: wp.int32, out_bounds: wp.array[wp.vec2f]
):
    """Write the minimum and maximum nearness that a filter may read from within a tile; most tiles need no filter."""
    tile = wp.tid()
    if used[tile] == 0:
        out_bounds[tile] = wp.vec2f(0.0, 0.0)
        return
    side = size / TILE
    top = (tile / side) * TILE
    left = (tile % side) * TILE
    low = wp.float32(1.0)
    high = wp.float32(0.0)
    for y in range(wp.max(top - 1, 0), wp.min(top + TILE + 2, size)):
        for x in range(wp.max(left - 1, 0), wp.min(left + TILE + 2, size)):
            q = depths[y * size + x]
            low = minimum(low, q)
            high = maximum(high, q)
    out_bounds[tile] = wp.vec2f(low, high)


@wp.func
def map_contains(beams: wp.array[Sunbeam], k: wp.int32, p: wp.vec3f) -> bool:
    """Return whether a point lies within map k, with a margin."""
    u = axis_coordinate(beams[k].u, p)
    v = axis_coordinate(beams[k].v, p)
    end = wp.float32(beams[k].size - 12)
    return u > 12.0 and v > 12.0 and u < end and v < end


@wp.func
def box_unshadowed(beams: wp.array[Sunbeam], k: wp.int32, low: wp.vec3f, high: wp.vec3f) -> bool:
    """Return whether map k shadows no point of a box; False also if that would take long to decide."""
    size = beams[k].size
    if size == 0:
        return True
    middle = (low + high) * 0.5
    half = (high - low) * 0.5
    lift = 2.0 * (0.6 * beams[k].texel + 0.004)
    u = axis_coordinate(beams[k].u, middle)
    v = axis_coordinate(beams[k].v, middle)
    q = axis_coordinate(beams[k].q, middle)
    a = beams[k].u
    du = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + lift / beams[k].texel + 2.0
    a = beams[k].v
    dv = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + lift / beams[k].texel + 2.0
    a = beams[k].q
    dq = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + lift / beams[k].depth
    end = wp.float32(size - 1)
    if u + du < 0.0 or v + dv < 0.0 or u - du > end or v - dv > end:
        return True
    if q - dq <= 0.0:
        return False
    side = size / TILE
    left = int(maximum(u - du, 0.0)) / TILE
    right = int(minimum(u + du, end)) / TILE
    top = int(maximum(v - dv, 0.0)) / TILE
    bottom = int(minimum(v + dv, end)) / TILE
    if (right - left + 1) * (bottom - top + 1) > 1024:
        return False
    for y in range(top, bottom + 1):
        for x in range(left, right + 1):
            if beams[k].bounds[y * side + x][1] > 0.0:
                return False
    return True


@wp.func
def map_contains_box(beams: wp.array[Sunbeam], k: wp.int32, low: wp.vec3f, high: wp.vec3f) -> bool:
    """Return whether every point of a box lies within map k, with a margin."""
    middle = (low + high) * 0.5
    half = (high - low) * 0.5
    a = beams[k].u
    du = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + 13.0
    a = beams[k].v
    dv = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + 13.0
    u = axis_coordinate(beams[k].u, middle)
    v = axis_coordinate(beams[k].v, middle)
    end = wp.float32(beams[k].size)
    return u > du and v > dv and u + du < end and v + dv < end


@wp.kernel
def mark_unshadowed(
    lows: wp.array[wp.vec3f],
    highs: wp.array[wp.vec3f],
    beams: wp.array[Sunbeam],
    needed_bits: wp.int32,
    out_bits: wp.array[wp.int32],
):
    """Set `UNTOUCHED` in a tile with all `needed_bits` whose box no moving object (maps 2, 3) shadows."""
    tile = wp.tid()
    if (out_bits[tile] & needed_bits) != needed_bits:
        return
    low = lows[tile]
    high = highs[tile]
    if not box_unshadowed(beams, 2, low, high):
        return
    # (If the fine map contains the box, the coarse map is not read.)
    untouched = map_contains_box(beams, 2, low, high)
    if not untouched:
        untouched = box_unshadowed(beams, 3, low, high)
    if untouched:
        out_bits[tile] = out_bits[tile] | UNTOUCHED


@wp.func
def surface_slope(beams: wp.array[Sunbeam], k: wp.int32, n: wp.vec3f) -> wp.vec2f:
    """Return how much the nearness of a plane with normal n rises from texel to texel, along u and v of map k."""
    u = beams[k].u
    v = beams[k].v
    q = beams[k].q
    # (The axes are orthogonal, those of u and v as long as a texel is short.)
    facing = maximum((q[0] * n[0] + q[1] * n[1] + q[2] * n[2]) * beams[k].depth, MIN_FACING)
    scale = beams[k].texel * beams[k].texel / (facing * beams[k].depth)
    return wp.vec2f(
        -(u[0] * n[0] + u[1] * n[1] + u[2] * n[2]) * scale, -(v[0] * n[0] + v[1] * n[1] + v[2] * n[2]) * scale
    )


@wp.func
def sun_visibility(beams: wp.array[Sunbeam], k: wp.int32, p: wp.vec3f, n: wp.vec3f) -> wp.float32:
    """Return the share of the sun visible from a point with normal n: nine bilinear taps, so edges are soft."""
    size = beams[k].size
    if size == 0:
        return 1.0
    texel = beams[k].texel
    lift = 0.6 * texel + 0.004
    slope = wp.vec2f(0.0, 0.0)
    if p[2] > 0.3:
        # The filter reads up to two texels away. The more a surface is inclined to the sun, the more the depths there
        # differ: a bias prevents self-shadowing. The ground casts no shadow, so shadows on it need no bias.
        axis = beams[k].q
        facing = (axis[0] * n[0] + axis[1] * n[1] + axis[2] * n[2]) * beams[k].depth
        lift = lift + 1.1 * texel * wp.sqrt(maximum(1.0 - facing * facing, 0.0))
        slope = surface_slope(beams, k, n)
    r = wp.vec3f(p[0] + n[0] * lift, p[1] + n[1] * lift, p[2] + n[2] * lift)
    u = axis_coordinate(beams[k].u, r) - 0.5
    v = axis_coordinate(beams[k].v, r) - 0.5
    end = wp.float32(size - 4)
    if u < 3.0 or v < 3.0 or u > end or v > end:
        return 1.0
    i = int(u)
    j = int(v)
    q = axis_coordinate(beams[k].q, r) + (0.01 + 0.35 * texel) / beams[k].depth
    within = beams[k].bounds[nonnegative((j / TILE) * (size / TILE) + i / TILE)]
    if q >= within[1]:
        return 1.0
    if q + 3.0 * (wp.abs(slope[0]) + wp.abs(slope[1])) < within[0]:
        return 0.0
    # Each texel is compared with the surface's own nearness there, where that is larger.
    fu = u - wp.float32(i)
    fv = v - wp.float32(j)
    total = wp.float32(0.0)
    for y in range(4):
        wy = wp.float32(1.0)
        if y == 0:
            wy = 1.0 - fv
        if y == 3:
            wy = fv
        base = nonnegative((j + y - 1) * size + i - 1)
        level = q + slope[1] * (wp.float32(y) - 1.0 - fv) - slope[0] * fu
        row = wp.float32(0.0)
        if beams[k].depths[base] <= maximum(level - slope[0], q):
            row = row + 1.0 - fu
        if beams[k].depths[base + 1] <= maximum(level, q):
            row = row + 1.0
        if beams[k].depths[base + 2] <= maximum(level + slope[0], q):
            row = row + 1.0
        if beams[k].depths[base + 3] <= maximum(level + 2.0 * slope[0], q):
            row = row + fu
        total = total + row * wy
    return total / 9.0


@wp.func
def moving_shadow(beams: wp.array[Sunbeam], p: wp.vec3f, n: wp.vec3f) -> wp.float32:
    """Return the share of the sun that moving objects leave to a point (maps 2 and 3)."""
    moving = wp.int32(2)
    if not map_contains(beams, moving, p):
        moving = wp.int32(3)
    return sun_visibility(beams, moving, p, n)


@wp.func
def sun_share(beams: wp.array[Sunbeam], p: wp.vec3f, n: wp.vec3f) -> wp.vec2f:
    """Return the share of the sun that reaches a point, and the share that moving objects alone would leave.

    The latter is 1 where the static scene (maps 0 and 1) already blocks the sun.
    """
    still = wp.int32(0)
    if not map_contains(beams, still, p):
        still = wp.int32(1)
    left = sun_visibility(beams, still, p, n)
    moving = wp.float32(1.0)
    if left > 0.0:
        moving = moving_shadow(beams, p, n)
    return wp.vec2f(minimum(left, moving), moving)
