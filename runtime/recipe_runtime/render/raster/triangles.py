"""Triangles on the screen: corners snapped to 1/256 pixel, edge functions, and the cut at the near plane."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
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


@wp.struct
class Piece:
    """A triangle clipped at the near plane, or one of the two that it falls into."""

    a: Corner
    b: Corner
    c: Corner
    there: wp.int32


@wp.func
def clipped_piece(lens: Pinhole, v0: wp.vec3f, v1: wp.vec3f, v2: wp.vec3f, which: wp.int32) -> Piece:
    """Piece 0 or 1 of a triangle clipped at the near plane.

    It is counter-clockwise seen from outside, hence clockwise in a picture whose y points down once corners 1 and 2
    change places; a face seen from behind has a negative area then, and is dropped.
    """
    a = v0
    b = v2
    c = v1
    piece = Piece()
    near = wp.float32(lens.near)
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
        piece.a = cut_at_near_plane(b, a, lens)
        piece.b = project_vertex(b, lens)
        piece.c = project_vertex(c, lens)
        if which == 1:
            piece.b = piece.c
            piece.c = cut_at_near_plane(c, a, lens)
    elif inside == 1:
        piece.a = project_vertex(a, lens)
        piece.b = cut_at_near_plane(a, b, lens)
        piece.c = cut_at_near_plane(a, c, lens)
    else:
        piece.a = project_vertex(a, lens)
        piece.b = project_vertex(b, lens)
        piece.c = project_vertex(c, lens)
    return piece


@wp.func
def visible_triangle(
    place: wp.int32, first_chunk: wp.int32, chunks: wp.array[wp.vec3i], chunk_visible: wp.array[wp.int32]
) -> wp.int32:
    """The triangle of a place, 64 to a chunk from `first_chunk` on; -1 if there is none or its chunk is not visible."""
    n = first_chunk + (place >> 6)
    if chunk_visible[n] == 0:
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
    """The bit of a triangle's actor, of the 64 from the first on; 0 for any other, or if keys are drawn (below 0)."""
    if first_actor < 0:
        return wp.uint64(0)
    actor = surface_actor[triangle_surface[triangle]] - first_actor
    if actor < 0 or actor >= 64:
        return wp.uint64(0)
    return wp.uint64(1) << wp.uint64(actor)


@wp.func
def sample_box(lens: Pinhole, a: Corner, b: Corner, c: Corner):
    """The columns and rows of the samples that a triangle's box holds: left, top, right, bottom, ends inside."""
    step = wp.int64(256) / wp.int64(lens.side)
    half = step / wp.int64(2)
    shift = wp.int64(8)
    if lens.side == 2:
        shift = wp.int64(7)
    up = step - wp.int64(1) - half
    left = wp.max((wp.min(a.x, wp.min(b.x, c.x)) + up) >> shift, wp.int64(0))
    top = wp.max((wp.min(a.y, wp.min(b.y, c.y)) + up) >> shift, wp.int64(0))
    right = wp.min((wp.max(a.x, wp.max(b.x, c.x)) - half) >> shift, wp.int64(lens.width * lens.side) - wp.int64(1))
    bottom = wp.min((wp.max(a.y, wp.max(b.y, c.y)) - half) >> shift, wp.int64(lens.height * lens.side) - wp.int64(1))
    return left, top, right, bottom
