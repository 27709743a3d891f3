"""Triangles in screen space: corners snapped to 1/256 pixel, edge functions, and clipping at the near plane."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

NEARNESS = wp.constant(wp.float64(1099511627775.0))  # 2^40 - 1
IN_VIEW = wp.constant(1)  # of a chunk that may be in the view
OTHER_LEVEL = wp.constant(-1)  # of a chunk of another version of an object than the one that the picture shows
ROWS = wp.constant(4)  # of samples in a pixel for antialiasing, besides its centre
ROW_PLACES = wp.constant(wp.uint32(0xE6B34D1A))  # of a pixel's rows from its top, 1/256 pixels; a byte each
COLUMN_PLACES = wp.constant(wp.uint32(0xB31AE64D))  # of each row's sample from the pixel's left, likewise
GUARD_BAND = wp.constant(wp.float64(536870912.0))  # 2^29: corners beyond this many 1/256 pixels would overflow


@wp.struct
class Corner:
    """A projected corner: position in 1/256 pixels, and nearness near / depth in (0, 1]."""

    x: wp.int64
    y: wp.int64
    q: wp.float64


@wp.func
def snap(v: wp.float64) -> wp.int64:
    """Round to 1/256 pixel, halves up; values beyond the guard band are clamped."""
    s = wp.max(wp.min(v * wp.float64(256.0) + wp.float64(0.5), GUARD_BAND), -GUARD_BAND)
    i = wp.int64(s)
    if wp.float64(i) > s:
        i = i - wp.int64(1)
    return i


@wp.func
def project(x: wp.float64, y: wp.float64, z: wp.float64, pinhole: Pinhole) -> Corner:
    """Project a point at depth z >= near."""
    scale = pinhole.focal / z
    c = Corner()
    c.x = snap(pinhole.cx + x * scale)
    c.y = snap(pinhole.cy + y * scale)
    c.q = pinhole.near / z
    return c


@wp.func
def project_vertex(v: wp.vec3f, pinhole: Pinhole) -> Corner:
    """Project a vertex that is not behind the near plane."""
    return project(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]), pinhole)


@wp.func
def cut_at_near_plane(a: wp.vec3f, b: wp.vec3f, pinhole: Pinhole) -> Corner:
    """Return the point where the edge from a (in front of the near plane) to b (behind it) meets that plane."""
    za = wp.float64(a[2])
    t = (za - pinhole.near) / (za - wp.float64(b[2]))
    x = wp.float64(a[0]) + (wp.float64(b[0]) - wp.float64(a[0])) * t
    y = wp.float64(a[1]) + (wp.float64(b[1]) - wp.float64(a[1])) * t
    return project(x, y, pinhole.near, pinhole)


@wp.func
def edge_function(ax: wp.int64, ay: wp.int64, bx: wp.int64, by: wp.int64, x: wp.int64, y: wp.int64) -> wp.int64:
    """Return twice the signed area of a, b, (x, y): positive on the inner side of the edge from a to b."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@wp.func
def top_left_bias(ax: wp.int64, ay: wp.int64, bx: wp.int64, by: wp.int64) -> wp.int64:
    """Return 0 for a top or left edge, whose samples belong to the triangle, and -1 for other edges."""
    if by < ay or (by == ay and bx > ax):
        return wp.int64(0)
    return wp.int64(-1)


@wp.struct
class Piece:
    """A triangle clipped at the near plane, or one of the two triangles that the clipped polygon is split into."""

    a: Corner
    b: Corner
    c: Corner
    there: wp.int32


@wp.func
def clipped_piece(pinhole: Pinhole, v0: wp.vec3f, v1: wp.vec3f, v2: wp.vec3f, which: wp.int32) -> Piece:
    """Return piece 0 or 1 of a triangle clipped at the near plane.

    Triangles are counter-clockwise seen from outside, so clockwise on the screen, whose y points down; corners 1 and 2
    are swapped. Back faces then have a negative area, and are dropped.
    """
    a = v0
    b = v2
    c = v1
    piece = Piece()
    near = wp.float32(pinhole.near)
    inside = int(a[2] >= near) + int(b[2] >= near) + int(c[2] >= near)
    if inside == 0 or (which == 1 and inside != 2):
        return piece
    for _turn in range(2):
        if (inside == 1 and a[2] < near) or (inside == 2 and a[2] >= near):
            t = a
            a = b
            b = c
            c = t
    piece.there = 1
    if inside == 2:
        piece.a = cut_at_near_plane(b, a, pinhole)
        piece.b = project_vertex(b, pinhole)
        piece.c = project_vertex(c, pinhole)
        if which == 1:
            piece.b = piece.c
            piece.c = cut_at_near_plane(c, a, pinhole)
    elif inside == 1:
        piece.a = project_vertex(a, pinhole)
        piece.b = cut_at_near_plane(a, b, pinhole)
        piece.c = cut_at_near_plane(a, c, pinhole)
    else:
        piece.a = project_vertex(a, pinhole)
        piece.b = project_vertex(b, pinhole)
        piece.c = project_vertex(c, pinhole)
    return piece


@wp.func
def visible_triangle(
    place: wp.int32, first_chunk: wp.int32, chunks: wp.array[wp.vec3i], chunk_visible: wp.array[wp.int32]
) -> wp.int32:
    """Return the triangle of a thread, with 64 threads per chunk from `first_chunk` on.

    It is -1 if there is none, or if its chunk is not visible.
    """
    n = first_chunk + (place >> 6)
    if chunk_visible[n] != IN_VIEW:
        return -1
    chunk = chunks[n]
    if (place & 63) >= chunk[1]:
        return -1
    return chunk[0] + (place & 63)


@wp.func
def actor_bit(
    triangle: wp.int32,
    triangle_surface: wp.array[wp.int32],
    surface_actor: wp.array[wp.int32],
    first_actor: wp.int32,
) -> wp.uint64:
    """Return the bit of a triangle's actor, one of 64 from `first_actor` on.

    It is 0 for other actors, and if `first_actor` is below 0.
    """
    if first_actor < 0:
        return wp.uint64(0)
    actor = surface_actor[triangle_surface[triangle]] - first_actor
    if actor < 0 or actor >= 64:
        return wp.uint64(0)
    return wp.uint64(1) << wp.uint64(actor)


@wp.func
def place_in_pixel(places: wp.uint32, row: wp.int32) -> wp.int32:
    """Return an entry of ROW_PLACES or COLUMN_PLACES, in 1/256 pixels."""
    return wp.int32((places >> wp.uint32((row & (ROWS - 1)) * 8)) & wp.uint32(255))


@wp.func
def sample_place(rows: wp.int32, row: wp.int32):
    """Return how far a row's samples are from the left edges of their pixels, and the row's y, in 1/256 pixels.

    With its centre, a pixel has five samples, which lie in five rows and five columns: a line of a grid that is turned.
    An edge near an axis passes them one by one, so its coverage has six levels.
    """
    if rows == 1:
        return wp.int64(128), (wp.int64(row) << wp.int64(8)) + wp.int64(128)
    y = (row / ROWS) * 256 + place_in_pixel(ROW_PLACES, row)
    return wp.int64(place_in_pixel(COLUMN_PLACES, row)), wp.int64(y)


@wp.func
def first_row(rows: wp.int32, y: wp.int64) -> wp.int64:
    """Return the first row of samples at or below y, in 1/256 pixels."""
    if rows == 1:
        return (y + wp.int64(127)) >> wp.int64(8)
    rest = wp.int32(y & wp.int64(255))
    above = wp.int32(0)  # rows of y's pixel above it
    for row in range(ROWS):
        if place_in_pixel(ROW_PLACES, row) < rest:
            above = above + 1
    return wp.int64(wp.int32(y >> wp.int64(8)) * ROWS + above)


@wp.func
def sample_box(pinhole: Pinhole, a: Corner, b: Corner, c: Corner):
    """Return the columns of pixels and rows of samples in a triangle's box: left, top, right, bottom, ends included."""
    first = wp.int64(128)  # places of the leftmost and of the rightmost sample of a pixel
    last = wp.int64(128)
    if pinhole.rows == ROWS:
        first = wp.int64(26)
        last = wp.int64(230)
    left = wp.max((wp.min(a.x, wp.min(b.x, c.x)) + wp.int64(255) - last) >> wp.int64(8), wp.int64(0))
    right = wp.min((wp.max(a.x, wp.max(b.x, c.x)) - first) >> wp.int64(8), wp.int64(pinhole.width) - wp.int64(1))
    top = wp.max(first_row(pinhole.rows, wp.min(a.y, wp.min(b.y, c.y))), wp.int64(0))
    bottom = first_row(pinhole.rows, wp.max(a.y, wp.max(b.y, c.y)) + wp.int64(1)) - wp.int64(1)
    return left, top, right, wp.min(bottom, wp.int64(pinhole.height * pinhole.rows) - wp.int64(1))
