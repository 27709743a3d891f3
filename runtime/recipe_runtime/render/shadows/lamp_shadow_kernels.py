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
from recipe_runtime.render.numeric.vectors import box_extent, transform_point
from recipe_runtime.render.raster.triangles import NEARNESS, Corner, clipped_piece, edge_function, sample_box
from recipe_runtime.render.raster.visibility_kernels import fill_triangle
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.shadows.shadow_kernels import axis_coordinate

wp.set_module_options(OPTIONS)

STATIC_SLOTS = wp.constant(4)  # slots of lamps of the town
MOVING_SLOTS = wp.constant(2)  # slots of lamps on moving objects; the two headlights of a vehicle share one
STATIC_SIZE = wp.constant(768)  # texels along the side of a map of a lamp of the town
MOVING_SIZE = wp.constant(256)  # likewise for a lamp on a moving object, whose cone is narrower
TILE = wp.constant(16)  # texels along the side of a tile, the unit of clearing and bounds
MAX_TILES = wp.constant(2304)  # tiles of the larger maps


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
    lens: wp.array[
        wp.vec4f
    ]  # texels per unit of x / z, 0 if the slot is unused; near and far plane, metres; its inverse
    own: wp.array[wp.vec2f]  # first and last part of the object that the lamp is mounted on, which casts no shadow
    fixed: wp.array[StaticLampMap]  # by slot of a lamp of the town
    keys: wp.array2d[wp.uint64]  # [slots, STATIC_SIZE^2], of moving objects
    nearest: wp.array2d[wp.uint64]  # [slots, MAX_TILES], bounds as those of `StaticLampMap`
    farthest: wp.array2d[wp.uint64]  # likewise; not set where `nearest` is 0


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
def mark_tiles(
    marks: wp.array2d[wp.uint64],
    slot: wp.int32,
    left: wp.int32,
    top: wp.int32,
    right: wp.int32,
    bottom: wp.int32,
):
    """Mark the tiles from which a filter may read a rectangle of texels, ends included."""
    tiles = map_size(slot) / TILE
    for y in range(wp.max(top - 2, 0) / TILE, wp.min((bottom + 1) / TILE, tiles - 1) + 1):
        for x in range(wp.max(left - 2, 0) / TILE, wp.min((right + 1) / TILE, tiles - 1) + 1):
            marks[slot, nonnegative(y * tiles + x)] = wp.uint64(1)


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
def map_corner(x: wp.float32, y: wp.float32, nearness: wp.float32) -> Corner:
    """Return a corner from its coordinates in texels."""
    c = Corner()
    c.x = wp.int64(minimum(maximum(x, -1.0e6), 1.0e6) * 256.0 + 0.5)
    c.y = wp.int64(minimum(maximum(y, -1.0e6), 1.0e6) * 256.0 + 0.5)
    c.q = wp.float64(nearness)
    return c


@wp.func
def draw_piece(
    keys: wp.array2d[wp.uint64],
    marks: wp.array2d[wp.uint64],
    slot: wp.int32,
    pinhole: Pinhole,
    a: Corner,
    b: Corner,
    c: Corner,
):
    """Draw a projected triangle, front or back face, and mark the tiles that it may touch."""
    left, top, right, bottom = sample_box(pinhole, a, b, c)
    if left <= right and top <= bottom:
        if edge_function(a.x, a.y, b.x, b.y, c.x, c.y) > wp.int64(0):
            fill_triangle(keys[slot], pinhole, a, b, c, wp.uint64(0), wp.uint64(0))
        else:
            fill_triangle(keys[slot], pinhole, a, c, b, wp.uint64(0), wp.uint64(0))
        mark_tiles(marks, slot, int(left), int(top), int(right), int(bottom))


@wp.func
def draw_caster(
    maps: wp.array[LampMaps],
    slot: wp.int32,
    a: wp.vec3f,
    b: wp.vec3f,
    c: wp.vec3f,
    keys: wp.array2d[wp.uint64],
    marks: wp.array2d[wp.uint64],
):
    """Draw a triangle in a lamp's view, front or back face, and mark the tiles that it may touch."""
    lens = maps[0].lens[slot]
    size = map_size(slot)
    pinhole = Pinhole()
    pinhole.focal = wp.float64(lens[0])
    pinhole.cx = wp.float64(size / 2)
    pinhole.cy = wp.float64(size / 2)
    pinhole.near = wp.float64(lens[1])
    pinhole.far = wp.float64(lens[2])
    pinhole.width = size
    pinhole.height = size
    pinhole.rows = 1
    if a[2] > lens[1] and b[2] > lens[1] and c[2] > lens[1]:  # most triangles are small and cover no texel centre
        ra = 1.0 / a[2]
        rb = 1.0 / b[2]
        rc = 1.0 / c[2]
        if between_texels(lens, a[0] * ra, b[0] * rb, c[0] * rc) or between_texels(
            lens, a[1] * ra, b[1] * rb, c[1] * rc
        ):
            return
        mid = wp.float32(size / 2)
        ka = map_corner(a[0] * ra * lens[0] + mid, a[1] * ra * lens[0] + mid, ra * lens[1])
        kb = map_corner(b[0] * rb * lens[0] + mid, b[1] * rb * lens[0] + mid, rb * lens[1])
        kc = map_corner(c[0] * rc * lens[0] + mid, c[1] * rc * lens[0] + mid, rc * lens[1])
        draw_piece(keys, marks, slot, pinhole, ka, kb, kc)
        return
    for which in range(2):
        piece = clipped_piece(pinhole, a, b, c, which)
        if piece.there != 0:
            draw_piece(keys, marks, slot, pinhole, piece.a, piece.b, piece.c)


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
    out_marks: wp.array2d[wp.uint64],
):
    """Draw chunks of world-space vertices into the maps of all slots, which must be clear.

    `transforms` lead from the parts to the world.
    Tiles that a filter may read are marked in `out_marks`, and keep a mark of 0 otherwise.
    """
    share = wp.tid() % threads_per_chunk
    i = first_chunk + (wp.tid() / threads_per_chunk) % chunk_count
    slot = wp.tid() / (threads_per_chunk * chunk_count)
    chunk = chunks[i]
    part = chunk[2]
    if share >= chunk[1]:
        return
    if not chunk_casts(maps, slot, transforms, part, chunk_centres[i], chunk_halves[i]):
        return
    right = maps[0].right[slot]
    down = maps[0].down[slot]
    ahead = maps[0].ahead[slot]
    for k in range(chunk[0] + share, chunk[0] + chunk[1], threads_per_chunk):
        if casts[k] != 0:
            t = triangles[k]
            a = view_coordinates(right, down, ahead, vertices[t[0]])
            b = view_coordinates(right, down, ahead, vertices[t[1]])
            c = view_coordinates(right, down, ahead, vertices[t[2]])
            draw_caster(maps, slot, a, b, c, out_keys, out_marks)


@wp.kernel
def bound_lamp_maps(
    keys: wp.array2d[wp.uint64], out_nearest: wp.array2d[wp.uint64], out_farthest: wp.array2d[wp.uint64]
):
    """Write the bounds of the tiles that are marked in `out_nearest`, one thread for each tile of all maps."""
    slot = wp.tid() / MAX_TILES
    tile = wp.tid() % MAX_TILES
    if out_nearest[slot, tile] == wp.uint64(0):
        return
    size = map_size(slot)
    top = (tile / (size / TILE)) * TILE
    left = (tile % (size / TILE)) * TILE
    high = wp.uint64(0)
    low = keys[slot, top * size + left]
    for y in range(wp.max(top - 1, 0), wp.min(top + TILE + 2, size)):
        for x in range(wp.max(left - 1, 0), wp.min(left + TILE + 2, size)):
            key = keys[slot, nonnegative(y * size + x)]
            high = wp.max(high, key)
            low = wp.min(low, key)
    out_nearest[slot, tile] = high
    out_farthest[slot, tile] = low
