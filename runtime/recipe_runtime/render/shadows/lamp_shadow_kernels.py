"""Shadow maps of lamps: perspective pictures from a lamp that hold the nearness (near / depth) of the first surface.

Each of the lamps nearest to the camera has a slot. The first slots are for lamps of the town: each has a map of the
static scene, drawn once, and a map of moving objects, drawn every frame. The other slots are for lamps on moving
objects, which have only a map of moving objects. Flat ground casts no shadow; neither does the object that a lamp is
mounted on.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import box_extent, dot, transform_point
from recipe_runtime.render.raster.triangles import NEARNESS, clipped_piece, edge_function
from recipe_runtime.render.raster.visibility_kernels import fill_triangle
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.shadows.shadow_kernels import axis_coordinate

wp.set_module_options(OPTIONS)

STATIC_SLOTS = wp.constant(6)  # slots of lamps of the town
MOVING_SLOTS = wp.constant(4)  # slots of lamps on moving objects
STATIC_SIZE = wp.constant(768)  # texels along the side of a map of a lamp of the town
MOVING_SIZE = wp.constant(384)  # likewise for a lamp on a moving object, whose cone is narrower
TILE = wp.constant(16)  # texels along the side of a tile, the unit of clearing and bounds
MAX_TILES = wp.constant(2304)  # tiles of the larger maps
MIN_LIFT = wp.constant(wp.float32(0.004))  # metres, minimum normal offset of a shaded point
BIAS = wp.constant(wp.float32(0.01))  # metres, minimum depth bias towards the lamp
EXACT_HEIGHT = wp.constant(wp.float32(0.3))  # metres below which level surfaces are ground, which casts no shadow


@wp.struct
class StaticLampMap:
    """A lamp's map of the static scene."""

    keys: wp.array2d[wp.uint64]  # [1, STATIC_SIZE^2], as in `visibility_kernels`, without the triangle
    nearest: wp.array2d[wp.uint64]  # [1, MAX_TILES], maximum key that a filter may read
    farthest: wp.array2d[wp.uint64]  # [1, MAX_TILES], minimum key


@wp.struct
class LampMaps:
    """The maps of the lamps that cast shadows, by slot. In a lamp's view, z is along its axis, x and y across it."""

    right: wp.array[wp.vec4f]  # x = right . world + offset
    down: wp.array[wp.vec4f]  # y, likewise
    ahead: wp.array[wp.vec4f]  # z, likewise
    lens: wp.array[wp.vec4f]  # texels per unit of x / z, 0 if the slot is unused; near and far plane, metres; unused
    own: wp.array[wp.vec2f]  # first and last part of the object that the lamp is mounted on, which casts no shadow
    fixed: wp.array[StaticLampMap]  # by slot of a lamp of the town
    keys: wp.array2d[wp.uint64]  # [slots, STATIC_SIZE^2], of moving objects
    nearest: wp.array2d[wp.uint64]  # [slots, MAX_TILES]


@wp.func
def map_size(slot: wp.int32) -> wp.int32:
    """Return the texels along the side of a slot's maps."""
    return wp.where(slot < STATIC_SLOTS, STATIC_SIZE, MOVING_SIZE)


@wp.kernel
def clear_lamp_maps(out_keys: wp.array2d[wp.uint64], out_nearest: wp.array2d[wp.uint64]):
    """Clear the tiles in use of all maps, one thread for each tile."""
    slot = wp.tid() / MAX_TILES
    tile = wp.tid() % MAX_TILES
    if out_nearest[slot, tile] == wp.uint64(0):
        return
    out_nearest[slot, tile] = wp.uint64(0)
    size = map_size(slot)
    first = (tile / (size / TILE)) * TILE * size + (tile % (size / TILE)) * TILE
    for y in range(TILE):
        for x in range(TILE):
            out_keys[slot, nonnegative(first + y * size + x)] = wp.uint64(0)


@wp.func
def view_coordinates(right: wp.vec4f, down: wp.vec4f, ahead: wp.vec4f, p: wp.vec3f) -> wp.vec3f:
    """Return the coordinates of a point in the view with the given axes."""
    return wp.vec3f(axis_coordinate(right, p), axis_coordinate(down, p), axis_coordinate(ahead, p))


@wp.func
def view_point(maps: wp.array[LampMaps], slot: wp.int32, p: wp.vec3f) -> wp.vec3f:
    """Return the coordinates of a world-space point in the view of a lamp."""
    return view_coordinates(maps[0].right[slot], maps[0].down[slot], maps[0].ahead[slot], p)


@wp.func
def axis_in_part(axis: wp.vec4f, m: wp.array2d[wp.float32], part: wp.int32) -> wp.vec4f:
    """Return a world-space axis in the frame of a part."""
    return wp.vec4f(
        (axis[0] * m[part, 0] + axis[1] * m[part, 4]) + axis[2] * m[part, 8],
        (axis[0] * m[part, 1] + axis[1] * m[part, 5]) + axis[2] * m[part, 9],
        (axis[0] * m[part, 2] + axis[1] * m[part, 6]) + axis[2] * m[part, 10],
        ((axis[0] * m[part, 3] + axis[1] * m[part, 7]) + axis[2] * m[part, 11]) + axis[3],
    )


@wp.func
def axis_extent(axis: wp.vec4f, m: wp.array2d[wp.float32], part: wp.int32, half: wp.vec3f) -> wp.float32:
    """Return the extent along an axis of a box in a part's frame."""
    return box_extent(m, part, half, wp.vec3f(axis[0], axis[1], axis[2]))


@wp.func
def chunk_casts(
    maps: wp.array[LampMaps],
    slot: wp.int32,
    transforms: wp.array2d[wp.float32],
    part: wp.int32,
    centre: wp.vec3f,
    half: wp.vec3f,
) -> bool:
    """Return whether a chunk of triangles in a part's frame may cast a shadow into a map."""
    lens = maps[0].lens[slot]
    own = maps[0].own[slot]
    if lens[0] <= 0.0 or (wp.float32(part) >= own[0] and wp.float32(part) <= own[1]):
        return False
    c = view_point(maps, slot, transform_point(transforms, part, centre))
    # A margin of a centimetre and four texels covers the rounding.
    end = c[2] + axis_extent(maps[0].ahead[slot], transforms, part, half) + 0.01
    start = c[2] - axis_extent(maps[0].ahead[slot], transforms, part, half) - 0.01
    if end < lens[1] or start > lens[2]:
        return False
    side = end * ((0.5 * wp.float32(map_size(slot)) + 4.0) / lens[0]) + 0.01
    if wp.abs(c[0]) - axis_extent(maps[0].right[slot], transforms, part, half) > side:
        return False
    return wp.abs(c[1]) - axis_extent(maps[0].down[slot], transforms, part, half) <= side


@wp.func
def raise_bounds(
    nearest: wp.array2d[wp.uint64],
    slot: wp.int32,
    left: wp.int32,
    top: wp.int32,
    right: wp.int32,
    bottom: wp.int32,
    key: wp.uint64,
):
    """Raise the bounds of the tiles that overlap a rectangle of texels to at least a key."""
    tiles = map_size(slot) / TILE
    for y in range(wp.max(top, 0) / TILE, wp.min(bottom / TILE, tiles - 1) + 1):
        for x in range(wp.max(left, 0) / TILE, wp.min(right / TILE, tiles - 1) + 1):
            wp.atomic_max(nearest, slot, y * tiles + x, key)


@wp.func
def nearness_key(q: wp.float64) -> wp.uint64:
    """Return the maximum key of a nearness."""
    return (wp.uint64(wp.int64(wp.min(q, wp.float64(1.0)) * NEARNESS)) << wp.uint64(24)) | wp.uint64(0xFFFFFF)


@wp.func
def between_texels(lens: wp.vec4f, a: wp.float32, b: wp.float32, c: wp.float32) -> bool:
    """Return whether the x / z or y / z of a triangle's corners all lie between the same two adjacent texel centres."""
    # (Maps have an even number of texels, so texel centres are half a texel off the axis. 1024 makes numbers positive.)
    low = minimum(a, minimum(b, c)) * lens[0] + 1024.498
    high = maximum(a, maximum(b, c)) * lens[0] + 1024.502
    return low >= 0.0 and high < 4096.0 and int(low) == int(high)


@wp.func
def draw_caster(
    maps: wp.array[LampMaps],
    slot: wp.int32,
    a: wp.vec3f,
    b: wp.vec3f,
    c: wp.vec3f,
    keys: wp.array2d[wp.uint64],
    nearest: wp.array2d[wp.uint64],
):
    """Draw a triangle in a lamp's view, front or back face, and raise the bounds of the tiles that it may touch."""
    lens = maps[0].lens[slot]
    if a[2] > lens[1] and b[2] > lens[1] and c[2] > lens[1]:  # most triangles are small and cover no texel centre
        ra = 1.0 / a[2]
        rb = 1.0 / b[2]
        rc = 1.0 / c[2]
        if between_texels(lens, a[0] * ra, b[0] * rb, c[0] * rc) or between_texels(
            lens, a[1] * ra, b[1] * rb, c[1] * rc
        ):
            return
    size = map_size(slot)
    pinhole = Pinhole()
    pinhole.focal = wp.float64(lens[0])
    pinhole.cx = wp.float64(size / 2)
    pinhole.cy = wp.float64(size / 2)
    pinhole.near = wp.float64(lens[1])
    pinhole.far = wp.float64(lens[2])
    pinhole.width = size
    pinhole.height = size
    pinhole.side = 1
    for which in range(2):
        piece = clipped_piece(pinhole, a, b, c, which)
        if piece.there != 0:
            p = piece.b
            q = piece.c
            if edge_function(piece.a.x, piece.a.y, p.x, p.y, q.x, q.y) < wp.int64(0):
                p = piece.c
                q = piece.b
            fill_triangle(keys[slot], pinhole, piece.a, p, q, wp.uint64(0), wp.uint64(0))
            # (A filter reads up to two texels away.)
            left = int(wp.max(wp.min(piece.a.x, wp.min(p.x, q.x)) >> wp.int64(8), wp.int64(0))) - 3
            top = int(wp.max(wp.min(piece.a.y, wp.min(p.y, q.y)) >> wp.int64(8), wp.int64(0))) - 3
            right = int(wp.max(piece.a.x, wp.max(p.x, q.x)) >> wp.int64(8)) + 3
            bottom = int(wp.max(piece.a.y, wp.max(p.y, q.y)) >> wp.int64(8)) + 3
            bound = nearness_key(wp.max(piece.a.q, wp.max(p.q, q.q)))
            if right >= 0 and bottom >= 0:
                raise_bounds(nearest, slot, left, top, right, bottom, bound)


@wp.kernel
def draw_lamp_casters(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    chunks: wp.array[wp.vec3i],
    chunk_centres: wp.array[wp.vec3f],
    chunk_halves: wp.array[wp.vec3f],
    casts: wp.array[wp.int32],
    transforms: wp.array2d[wp.float32],
    maps: wp.array[LampMaps],
    first_chunk: wp.int32,
    chunk_count: wp.int32,
    threads_per_chunk: wp.int32,
    out_keys: wp.array2d[wp.uint64],
    out_nearest: wp.array2d[wp.uint64],
):
    """Draw chunks into the maps of all slots, which must be clear; `transforms` lead from the parts to the world."""
    share = wp.tid() % threads_per_chunk
    i = first_chunk + (wp.tid() / threads_per_chunk) % chunk_count
    slot = wp.tid() / (threads_per_chunk * chunk_count)
    chunk = chunks[i]
    part = chunk[2]
    if share >= chunk[1]:
        return
    if not chunk_casts(maps, slot, transforms, part, chunk_centres[i], chunk_halves[i]):
        return
    right = axis_in_part(maps[0].right[slot], transforms, part)
    down = axis_in_part(maps[0].down[slot], transforms, part)
    ahead = axis_in_part(maps[0].ahead[slot], transforms, part)
    for k in range(chunk[0] + share, chunk[0] + chunk[1], threads_per_chunk):
        if casts[k] != 0:
            t = triangles[k]
            a = view_coordinates(right, down, ahead, vertices[t[0]])
            b = view_coordinates(right, down, ahead, vertices[t[1]])
            c = view_coordinates(right, down, ahead, vertices[t[2]])
            draw_caster(maps, slot, a, b, c, out_keys, out_nearest)


@wp.kernel
def bound_static_map(
    keys: wp.array2d[wp.uint64], out_nearest: wp.array2d[wp.uint64], out_farthest: wp.array2d[wp.uint64]
):
    """Write the exact bounds of the tiles in use, one thread for each tile."""
    tile = wp.tid()
    if out_nearest[0, tile] == wp.uint64(0):
        return
    top = (tile / (STATIC_SIZE / TILE)) * TILE
    left = (tile % (STATIC_SIZE / TILE)) * TILE
    high = wp.uint64(0)
    low = keys[0, top * STATIC_SIZE + left]
    for y in range(wp.max(top - 1, 0), wp.min(top + TILE + 2, STATIC_SIZE)):
        for x in range(wp.max(left - 1, 0), wp.min(left + TILE + 2, STATIC_SIZE)):
            key = keys[0, nonnegative(y * STATIC_SIZE + x)]
            high = wp.max(high, key)
            low = wp.min(low, key)
    out_nearest[0, tile] = high
    out_farthest[0, tile] = low


@wp.func
def filtered(
    keys: wp.array2d[wp.uint64], row: wp.int32, size: wp.int32, u: wp.float32, v: wp.float32, limit: wp.uint64
):
    """Return the share of a lamp that is visible: percentage-closer filtering with nine bilinear taps."""
    i = int(u)
    j = int(v)
    fu = u - wp.float32(i)
    fv = v - wp.float32(j)
    total = wp.float32(0.0)
    for y in range(4):
        base = nonnegative((j + y - 1) * size + i - 1)
        hidden = wp.where(keys[row, base] > limit, 1.0 - fu, 0.0)
        hidden = hidden + wp.where(keys[row, base + 1] > limit, 1.0, 0.0)
        hidden = hidden + wp.where(keys[row, base + 2] > limit, 1.0, 0.0)
        hidden = hidden + wp.where(keys[row, base + 3] > limit, fu, 0.0)
        weight = wp.where(y == 0, 1.0 - fv, wp.where(y == 3, fv, 1.0))
        total = total + hidden * weight
    return maximum(1.0 - total * (1.0 / 9.0), 0.0)


@wp.func
def texel_at(lens: wp.vec4f, z: wp.float32) -> wp.float32:
    """Return the size of a map's texel, metres, at a depth along the lamp's axis."""
    return maximum(z, lens[1]) / lens[0]


@wp.func
def shadow_point(maps: wp.array[LampMaps], slot: wp.int32, p: wp.vec3f, n: wp.vec3f, to: wp.vec3f) -> wp.vec3f:
    """Return the view coordinates at which a map is read for a point with normal n and unit direction `to` to the lamp.

    The point is offset along its normal. The filter reads up to two texels away: on a surface at a grazing angle the
    depths there differ more, so a larger offset prevents self-shadowing.
    """
    texel = texel_at(maps[0].lens[slot], axis_coordinate(maps[0].ahead[slot], p))
    lift = 0.6 * texel + MIN_LIFT
    if p[2] > EXACT_HEIGHT or n[2] < 0.7:
        facing = dot(n, to)
        lift = lift + 1.4 * texel * wp.sqrt(maximum(1.0 - facing * facing, 0.0))
    return view_point(maps, slot, wp.vec3f(p[0] + n[0] * lift, p[1] + n[1] * lift, p[2] + n[2] * lift))


@wp.func
def lamp_visibility(maps: wp.array[LampMaps], slot: wp.int32, p: wp.vec3f, n: wp.vec3f, to: wp.vec3f) -> wp.vec2f:
    """Return the share of a lamp visible from a point with normal n, and the share that moving objects do not hide.

    The latter is 1 where the static scene already hides the lamp.
    """
    lens = maps[0].lens[slot]
    r = shadow_point(maps, slot, p, n, to)
    left = wp.float32(1.0)
    moving = wp.float32(1.0)
    size = map_size(slot)
    z = r[2]
    if z > lens[1]:
        scale = lens[0] / z
        u = 0.5 * wp.float32(size) + r[0] * scale - 0.5
        v = 0.5 * wp.float32(size) + r[1] * scale - 0.5
        end = wp.float32(size - 4)
        if u >= 3.0 and v >= 3.0 and u <= end and v <= end:
            limit = nearness_key(
                wp.float64(lens[1]) / wp.float64(maximum(z - BIAS - 0.35 * texel_at(lens, z), lens[1]))
            )
            tile = nonnegative((int(v) / TILE) * (size / TILE) + int(u) / TILE)
            if slot < STATIC_SLOTS and maps[0].fixed[slot].nearest[0, tile] > limit:
                left = wp.float32(0.0)
                if maps[0].fixed[slot].farthest[0, tile] <= limit:
                    left = filtered(maps[0].fixed[slot].keys, 0, size, u, v, limit)
            if left > 0.0 and maps[0].nearest[slot, tile] > limit:
                moving = filtered(maps[0].keys, slot, size, u, v, limit)
    return wp.vec2f(minimum(left, moving), moving)


@wp.func
def ratio_range(low: wp.float32, high: wp.float32, near: wp.float32, far: wp.float32):
    """Return the minimum and maximum of x / z for x in low..high and z in near..far, where near > 0."""
    least = wp.where(low < 0.0, low / near, low / far)
    largest = wp.where(high < 0.0, high / far, high / near)
    return least, largest


@wp.func
def box_lit(maps: wp.array[LampMaps], slot: wp.int32, low: wp.vec3f, high: wp.vec3f) -> bool:
    """Return whether no moving object shadows any point of a box; False also if the test would read too many tiles."""
    lens = maps[0].lens[slot]
    half = (high - low) * 0.5
    c = view_point(maps, slot, (low + high) * 0.5)
    a = maps[0].ahead[slot]
    dz = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2]
    lift = 3.0 * texel_at(lens, c[2] + dz) + 2.0 * MIN_LIFT
    z0 = maximum(c[2] - dz - lift, lens[1])
    z1 = c[2] + dz + lift
    if z1 <= lens[1]:
        return True
    a = maps[0].right[slot]
    dx = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + lift
    a = maps[0].down[slot]
    dy = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + lift
    u0, u1 = ratio_range(c[0] - dx, c[0] + dx, z0, z1)
    v0, v1 = ratio_range(c[1] - dy, c[1] + dy, z0, z1)
    size = map_size(slot)
    middle = 0.5 * wp.float32(size)
    end = wp.float32(size - 1)
    left = middle + u0 * lens[0] - 2.0
    right = middle + u1 * lens[0] + 2.0
    top = middle + v0 * lens[0] - 2.0
    bottom = middle + v1 * lens[0] + 2.0
    if right < 0.0 or bottom < 0.0 or left > end or top > end:
        return True
    x0 = int(maximum(left, 0.0)) / TILE
    x1 = int(minimum(right, end)) / TILE
    y0 = int(maximum(top, 0.0)) / TILE
    y1 = int(minimum(bottom, end)) / TILE
    if (x1 - x0 + 1) * (y1 - y0 + 1) > 1024:
        return False
    for y in range(y0, y1 + 1):
        for x in range(x0, x1 + 1):
            if maps[0].nearest[slot, y * (size / TILE) + x] > wp.uint64(0):
                return False
    return True
