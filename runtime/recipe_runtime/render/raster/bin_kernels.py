"""Binned rasterisation, for GPUs: large triangles are split among many threads.

One thread draws a small triangle. A large one would make the other threads of its warp wait, so it is split into bins
of rows, which are appended to a list; then groups of threads draw the bins, each group as wide as the triangle. Keys
are combined by maximum and bits by union, so the order does not matter: the result equals that of
`visibility_kernels.raster_keys`.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import BLOCK_SIZE, OPTIONS, wp
from recipe_runtime.render.raster.triangles import (
    NEARNESS,
    Piece,
    actor_bit,
    clipped_piece,
    edge_function,
    sample_box,
    sample_place,
    top_left_bias,
    visible_triangle,
)
from recipe_runtime.render.raster.visibility_kernels import depth_test, fill_triangle, nearness_slopes
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

BIN_ROWS = wp.constant(16)  # of a bin
SMALL_TRIANGLE = wp.constant(wp.int64(256))  # samples in a triangle's box up to which one thread draws it
BIN_THREADS = wp.constant(32)  # threads that share a bin
BIN_GROUPS = wp.constant(4096)
USED_ENTRY = wp.constant(wp.uint64(0x8000000000000000))  # marks an entry that holds a bin


@wp.func
def fill_or_bin(
    keys: wp.array[wp.uint64],
    pinhole: Pinhole,
    piece: Piece,
    triangle: wp.int32,
    which: wp.int32,
    bit: wp.uint64,
    bands: wp.array[wp.uint64],
    taken: wp.array[wp.int32],
):
    """Draw a small triangle, or append the bins of a large one to the list. If the list is full, draw it here."""
    if piece.there == 0 or edge_function(piece.a.x, piece.a.y, piece.b.x, piece.b.y, piece.c.x, piece.c.y) <= wp.int64(
        0
    ):
        return
    left, top, right, bottom = sample_box(pinhole, piece.a, piece.b, piece.c)
    if left > right or top > bottom:
        return
    if (right - left + wp.int64(1)) * (bottom - top + wp.int64(1)) <= SMALL_TRIANGLE:
        fill_triangle(keys, pinhole, piece.a, piece.b, piece.c, wp.uint64(triangle), bit)
        return
    count = int(bottom - top) / BIN_ROWS + 1
    at = wp.atomic_add(taken, 0, count)
    if at + count > bands.shape[0]:
        for k in range(at, bands.shape[0]):
            bands[k] = wp.uint64(0)
        fill_triangle(keys, pinhole, piece.a, piece.b, piece.c, wp.uint64(triangle), bit)
        return
    for k in range(count):
        entry = wp.uint64(triangle) | (wp.uint64(which) << wp.uint64(24)) | (wp.uint64(k) << wp.uint64(25))
        bands[at + k] = USED_ENTRY | entry


@wp.func
def fill_bin(
    keys: wp.array[wp.uint64],
    pinhole: Pinhole,
    piece: Piece,
    triangle: wp.uint64,
    band: wp.int32,
    first: wp.int32,
    bit: wp.uint64,
):
    """Draw one thread's share of a bin; `first` is the thread's number in its group, which is laid out in rows."""
    a = piece.a
    b = piece.b
    c = piece.c
    left, top, right, bottom = sample_box(pinhole, a, b, c)
    slope1, slope2 = nearness_slopes(a, b, c, edge_function(a.x, a.y, b.x, b.y, c.x, c.y))
    rise = wp.float64((c.y - a.y) << wp.int64(8)) * slope1 + wp.float64((a.y - b.y) << wp.int64(8)) * slope2
    limit = NEARNESS * pinhole.near / pinhole.far
    bias0 = top_left_bias(b.x, b.y, c.x, c.y)
    bias1 = top_left_bias(c.x, c.y, a.x, a.y)
    bias2 = top_left_bias(a.x, a.y, b.x, b.y)
    # For a narrow box, a group is narrower and has more rows.
    wide = int(right - left) + 1
    across = wp.int32(BIN_THREADS)
    while across > 4 and across >= wide * 2:
        across = across / 2
    skipped = wp.int64(first % across) << wp.int64(8)  # 1/256 pixels from the left of the box to the thread's column
    y0 = int(top) + band * BIN_ROWS
    y1 = wp.min(y0 + BIN_ROWS - 1, int(bottom))
    stride = wp.int64(across) << wp.int64(8)
    dx0 = -(c.y - b.y) * stride
    dx1 = -(a.y - c.y) * stride
    dx2 = -(b.y - a.y) * stride
    for y in range(y0 + first / across, y1 + 1, BIN_THREADS / across):
        offset, py = sample_place(pinhole.rows, y)
        px = (left << wp.int64(8)) + offset
        w0 = edge_function(b.x, b.y, c.x, c.y, px, py)
        w1 = edge_function(c.x, c.y, a.x, a.y, px, py)
        w2 = edge_function(a.x, a.y, b.x, b.y, px, py)
        q = NEARNESS * a.q + wp.float64(w1) * slope1 + wp.float64(w2) * slope2
        w0 = w0 - (c.y - b.y) * skipped
        w1 = w1 - (a.y - c.y) * skipped
        w2 = w2 - (b.y - a.y) * skipped
        base = y * pinhole.width
        for x in range(int(left) + first % across, int(right) + 1, across):
            if (w0 + bias0) >= wp.int64(0) and (w1 + bias1) >= wp.int64(0) and (w2 + bias2) >= wp.int64(0):
                depth_test(keys, base + x, q + wp.float64(x - int(left)) * rise, limit, triangle, bit)
            w0 = w0 + dx0
            w1 = w1 + dx1
            w2 = w2 + dx2


@wp.kernel(launch_bounds=(BLOCK_SIZE, 5))  # limits registers, so that 5 blocks run at once
def bin_triangles(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    chunks: wp.array[wp.vec3i],
    chunk_visible: wp.array[wp.int32],
    first_chunk: wp.int32,
    triangle_surface: wp.array[wp.int32],
    surface_actor: wp.array[wp.int32],
    first_actor: wp.int32,
    pinhole: Pinhole,
    out_keys: wp.array[wp.uint64],
    out_bins: wp.array[wp.uint64],
    out_bin_count: wp.array[wp.int32],
):
    """Draw small triangles, and list the bins of large ones; `out_bin_count` must be 0.

    The triangles are those of visible chunks from `first_chunk` on. If `first_actor` is below 0, keys are drawn as by
    `raster_keys`, otherwise the actors' bits as by `raster_actor_bits`.
    """
    i = visible_triangle(wp.tid(), first_chunk, chunks, chunk_visible)
    if i < 0:
        return
    bit = actor_bit(i, triangle_surface, surface_actor, first_actor)
    if first_actor >= 0 and bit == wp.uint64(0):
        return
    t = triangles[i]
    for which in range(2):
        piece = clipped_piece(pinhole, vertices[t[0]], vertices[t[1]], vertices[t[2]], which)
        fill_or_bin(out_keys, pinhole, piece, i, which, bit, out_bins, out_bin_count)


@wp.kernel
def raster_bins(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    triangle_surface: wp.array[wp.int32],
    surface_actor: wp.array[wp.int32],
    first_actor: wp.int32,
    pinhole: Pinhole,
    out_keys: wp.array[wp.uint64],
    bins: wp.array[wp.uint64],
    bin_count: wp.array[wp.int32],
):
    """Draw the listed bins, with BIN_GROUPS x BIN_THREADS threads."""
    thread = wp.tid()
    for at in range(thread / BIN_THREADS, wp.min(bin_count[0], bins.shape[0]), wp.int32(BIN_GROUPS)):
        entry = bins[at]
        if entry != wp.uint64(0):
            i = wp.int32(entry & wp.uint64(0xFFFFFF))
            which = wp.int32((entry >> wp.uint64(24)) & wp.uint64(1))
            band = wp.int32((entry & ~USED_ENTRY) >> wp.uint64(25))
            t = triangles[i]
            bit = actor_bit(i, triangle_surface, surface_actor, first_actor)
            piece = clipped_piece(pinhole, vertices[t[0]], vertices[t[1]], vertices[t[2]], which)
            fill_bin(out_keys, pinhole, piece, wp.uint64(i), band, thread % BIN_THREADS, bit)
