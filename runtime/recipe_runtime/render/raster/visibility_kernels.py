"""Exact visibility: the nearest triangle of every sample.

Corners are snapped to 1/256 pixel, and integer edge functions with the top-left rule decide which samples a triangle
covers, so triangles that share an edge leave no gap and cover no sample twice. The triangle with the largest 64-bit key
is visible: 40 bits of nearness (near / depth), then 24 bits of the triangle's index. An atomic maximum does not depend
on the order.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import nonnegative
from recipe_runtime.render.numeric.vectors import box_extent, dot, transform_point
from recipe_runtime.render.raster.skin_kernels import blended_point
from recipe_runtime.render.raster.triangles import (
    IN_VIEW,
    NEARNESS,
    OTHER_LEVEL,
    Corner,
    actor_bit,
    clipped_piece,
    edge_function,
    sample_box,
    sample_place,
    top_left_bias,
    visible_triangle,
)
from recipe_runtime.render.scene.level_range import LevelRange
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

SPAN_THRESHOLD = wp.constant(wp.int64(6))  # samples per row from which solving for the span is faster than testing each


@wp.kernel
def transform_vertices(
    vertices: wp.array[wp.vec3f],
    vertex_part: wp.array[wp.int32],
    vertex_skin: wp.array[wp.int32],
    skin_parts: wp.array[wp.vec4i],
    skin_weights: wp.array[wp.vec4f],
    part_origins: wp.array[wp.vec3f],
    transforms: wp.array2d[wp.float32],
    first_vertex: wp.int32,
    out_vertices: wp.array[wp.vec3f],
):
    """Transform vertices from `first_vertex` on by the 3x4 matrices (by rows) of the parts that they follow."""
    i = first_vertex + wp.tid()
    skin = vertex_skin[i]
    if skin < 0:
        out_vertices[i] = transform_point(transforms, vertex_part[i], vertices[i])
    else:
        out_vertices[i] = blended_point(transforms, skin_parts[skin], skin_weights[skin], part_origins, vertices[i])


@wp.kernel
def transform_visible_vertices(
    vertices: wp.array[wp.vec3f],
    chunks: wp.array[wp.vec3i],
    chunk_vertices: wp.array[wp.vec2i],
    chunk_visible: wp.array[wp.int32],
    transforms: wp.array2d[wp.float32],
    out_vertices: wp.array[wp.vec3f],
):
    """Transform the vertices of the visible chunks, as `transform_vertices` does; the others keep their values."""
    n = wp.tid()
    if chunk_visible[n] != IN_VIEW:
        return
    part = chunks[n][2]
    for i in range(chunk_vertices[n][0], chunk_vertices[n][1]):
        out_vertices[i] = transform_point(transforms, part, vertices[i])


@wp.func
def inside_plane(c: wp.vec3f, n: wp.vec3f, r: wp.float32, slack: wp.float32) -> bool:
    """Return whether a box may lie on the inner side of a plane: centre c, normal n, extent r along n."""
    return n[0] * c[0] + n[1] * c[1] + n[2] * c[2] + r > -slack


@wp.kernel
def cull_chunks(
    chunks: wp.array[wp.vec3i],
    chunk_centres: wp.array[wp.vec3f],
    chunk_halves: wp.array[wp.vec3f],
    chunk_level: wp.array[wp.int32],
    levels: wp.array[LevelRange],
    nearer: wp.float32,
    transforms: wp.array2d[wp.float32],
    pinhole: Pinhole,
    out_visible: wp.array[wp.int32],
):
    """Write IN_VIEW for every chunk whose box may overlap the view frustum, otherwise 0.

    OTHER_LEVEL if the picture shows another version of the object. `nearer` is the square of the distance in which the
    reference camera shows objects as large as this one does at one metre.
    """
    i = wp.tid()
    if chunk_level[i] >= 0:
        level = levels[chunk_level[i]]
        anchor = transform_point(transforms, level.part, level.anchor)
        away = dot(anchor, anchor) * nearer
        if away < level.near or away >= level.far:
            out_visible[i] = OTHER_LEVEL
            return
    part = chunks[i][2]
    half = chunk_halves[i]
    c = transform_point(transforms, part, chunk_centres[i])
    f = wp.float32(pinhole.focal)
    deep = box_extent(transforms, part, half, wp.vec3f(0.0, 0.0, 1.0))
    # A margin of a centimetre and a hundredth of a pixel covers the rounding.
    slack = 0.01 * f + 0.01 * (wp.abs(c[2]) + deep)
    left = wp.vec3f(f, 0.0, wp.float32(pinhole.cx))
    right = wp.vec3f(-f, 0.0, wp.float32(pinhole.width) - wp.float32(pinhole.cx))
    top = wp.vec3f(0.0, f, wp.float32(pinhole.cy))
    bottom = wp.vec3f(0.0, -f, wp.float32(pinhole.height) - wp.float32(pinhole.cy))
    ahead = c[2] + deep > 0.99 * wp.float32(pinhole.near) and c[2] - deep < 1.01 * wp.float32(pinhole.far)
    across = inside_plane(c, left, box_extent(transforms, part, half, left), slack)
    across = across and inside_plane(c, right, box_extent(transforms, part, half, right), slack)
    across = across and inside_plane(c, top, box_extent(transforms, part, half, top), slack)
    across = across and inside_plane(c, bottom, box_extent(transforms, part, half, bottom), slack)
    out_visible[i] = wp.where(ahead and across, IN_VIEW, 0)


@wp.func
def first_inside(e: wp.int64, d: wp.int64, last: wp.int64) -> wp.int64:
    """Return the first k >= 0 with e + k d >= 0; a value above `last` if there is none."""
    if e >= wp.int64(0):
        return wp.int64(0)
    if d <= wp.int64(0):
        return last + wp.int64(1)
    return (d - wp.int64(1) - e) / d


@wp.func
def last_inside(e: wp.int64, d: wp.int64, last: wp.int64) -> wp.int64:
    """Return the last k <= `last` with e + k d >= 0, for d < 0; -1 if there is none."""
    if d >= wp.int64(0):
        return last
    if e < wp.int64(0):
        return wp.int64(-1)
    return wp.min(last, e / (-d))


@wp.func
def first_column(
    e0: wp.int64, e1: wp.int64, e2: wp.int64, d0: wp.int64, d1: wp.int64, d2: wp.int64, last: wp.int64
) -> wp.int64:
    """Return the first column of a row inside all three edges."""
    return wp.max(first_inside(e0, d0, last), wp.max(first_inside(e1, d1, last), first_inside(e2, d2, last)))


@wp.func
def last_column(
    e0: wp.int64, e1: wp.int64, e2: wp.int64, d0: wp.int64, d1: wp.int64, d2: wp.int64, last: wp.int64
) -> wp.int64:
    """Return the last column of a row inside all three edges."""
    return wp.min(last_inside(e0, d0, last), wp.min(last_inside(e1, d1, last), last_inside(e2, d2, last)))


@wp.func
def depth_test(
    keys: wp.array[wp.uint64], at: wp.int32, q: wp.float64, limit: wp.float64, triangle: wp.uint64, bit: wp.uint64
):
    """Combine a triangle at nearness q, in units of 1 / NEARNESS, with a sample's key unless it is beyond the limit."""
    if bit != wp.uint64(0):
        wp.atomic_or(keys, at, bit)
    elif q > limit:
        nearness = wp.uint64(wp.int64(wp.min(q, NEARNESS)))
        wp.atomic_max(keys, at, (nearness << wp.uint64(24)) | triangle)


@wp.func
def edge_steps(a: Corner, b: Corner):
    """Return the increments of an edge's function per column, and the edge's bias."""
    return (a.y - b.y) << wp.int64(8), top_left_bias(a.x, a.y, b.x, b.y)


@wp.func
def nearness_slopes(a: Corner, b: Corner, c: Corner, area: wp.int64):
    """Return the nearness that a triangle's second and third weight add per unit, in units of 1 / NEARNESS."""
    inverse = NEARNESS / wp.float64(area)
    return (b.q - a.q) * inverse, (c.q - a.q) * inverse


@wp.func
def fill_span(
    keys: wp.array[wp.uint64],
    first: wp.int32,
    last: wp.int32,
    column: wp.float64,
    q0: wp.float64,
    step: wp.float64,
    limit: wp.float64,
    triangle: wp.uint64,
    bit: wp.uint64,
):
    """Depth-test a triangle at the samples first..last, all inside it; their nearness is q0 + column step."""
    at = first
    k = column
    while at <= last:
        depth_test(keys, at, q0 + k * step, limit, triangle, bit)
        k = k + wp.float64(1.0)
        at = nonnegative(at + 1)


@wp.func
def fill_triangle(
    keys: wp.array[wp.uint64],
    pinhole: Pinhole,
    a: Corner,
    b: Corner,
    c: Corner,
    triangle: wp.uint64,
    bit: wp.uint64,
):
    """Rasterise one front-facing triangle: its key by maximum or, if `bit` is not 0, that bit by union."""
    area = edge_function(a.x, a.y, b.x, b.y, c.x, c.y)
    if area <= wp.int64(0):
        return
    left, top, right, bottom = sample_box(pinhole, a, b, c)
    if left > right or top > bottom:
        return
    dx0, bias0 = edge_steps(b, c)
    dx1, bias1 = edge_steps(c, a)
    dx2, bias2 = edge_steps(a, b)
    # Nearness is linear on the screen: at the left of a row it follows from the integer weights, then from the column.
    slope1, slope2 = nearness_slopes(a, b, c, area)
    across = wp.float64(dx1) * slope1 + wp.float64(dx2) * slope2
    limit = NEARNESS * pinhole.near / pinhole.far
    span = right - left
    for y in range(int(top), int(bottom) + 1):
        offset, py = sample_place(pinhole.rows, y)
        px = (left << wp.int64(8)) + offset
        w0 = edge_function(b.x, b.y, c.x, c.y, px, py)
        w1 = edge_function(c.x, c.y, a.x, a.y, px, py)
        w2 = edge_function(a.x, a.y, b.x, b.y, px, py)
        q = NEARNESS * a.q + wp.float64(w1) * slope1 + wp.float64(w2) * slope2
        k0 = wp.int64(0)
        k1 = span
        if span > SPAN_THRESHOLD:
            k0 = first_column(w0 + bias0, w1 + bias1, w2 + bias2, dx0, dx1, dx2, span)
            k1 = last_column(w0 + bias0, w1 + bias1, w2 + bias2, dx0, dx1, dx2, span)
        w0 = w0 + k0 * dx0
        w1 = w1 + k0 * dx1
        w2 = w2 + k0 * dx2
        if span <= SPAN_THRESHOLD:  # samples that do not belong to the triangle have values below 0
            w0 = w0 + bias0
            w1 = w1 + bias1
            w2 = w2 + bias2
        base = y * pinhole.width + int(left)
        at = nonnegative(base + int(k0))
        last = base + int(k1)
        if span > SPAN_THRESHOLD:  # all of these are inside
            fill_span(keys, at, last, wp.float64(k0), q, across, limit, triangle, bit)
        else:
            while at <= last:
                if (w0 | w1 | w2) >= wp.int64(0):
                    depth_test(keys, at, q + wp.float64(at - base) * across, limit, triangle, bit)
                w0 = w0 + dx0
                w1 = w1 + dx1
                w2 = w2 + dx2
                at = nonnegative(at + 1)


@wp.func
def clip_and_fill(
    keys: wp.array[wp.uint64],
    pinhole: Pinhole,
    v0: wp.vec3f,
    v1: wp.vec3f,
    v2: wp.vec3f,
    triangle: wp.uint64,
    bit: wp.uint64,
):
    """Clip a triangle at the near plane, which leaves none, one or two triangles, and rasterise them."""
    for which in range(2):
        piece = clipped_piece(pinhole, v0, v1, v2, which)
        if piece.there != 0:
            fill_triangle(keys, pinhole, piece.a, piece.b, piece.c, triangle, bit)


@wp.kernel
def raster_keys(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    chunks: wp.array[wp.vec3i],
    chunk_visible: wp.array[wp.int32],
    first_chunk: wp.int32,
    pinhole: Pinhole,
    out_keys: wp.array[wp.uint64],
):
    """Rasterise visible chunks from `first_chunk` on into the keys, 64 threads per chunk.

    Vertices are in view space: x right, y down, z forward.
    """
    i = visible_triangle(wp.tid(), first_chunk, chunks, chunk_visible)
    if i < 0:
        return
    t = triangles[i]
    clip_and_fill(out_keys, pinhole, vertices[t[0]], vertices[t[1]], vertices[t[2]], wp.uint64(i), wp.uint64(0))


@wp.kernel
def raster_actor_bits(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    triangle_surface: wp.array[wp.int32],
    surface_actor: wp.array[wp.int32],
    chunks: wp.array[wp.vec3i],
    chunk_visible: wp.array[wp.int32],
    first_chunk: wp.int32,
    first_actor: wp.int32,
    pinhole: Pinhole,
    out_bits: wp.array[wp.uint64],
):
    """Set bit a - first_actor of every sample that actor a would cover without occlusion; 64 actors per launch."""
    i = visible_triangle(wp.tid(), first_chunk, chunks, chunk_visible)
    if i < 0:
        return
    bit = actor_bit(i, triangle_surface, surface_actor, first_actor)
    if bit == wp.uint64(0):
        return
    t = triangles[i]
    clip_and_fill(out_bits, pinhole, vertices[t[0]], vertices[t[1]], vertices[t[2]], wp.uint64(i), bit)
