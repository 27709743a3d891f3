"""Labels from the visibility buffer: depth, instance, semantic tag and extents, at pixel centres and never blended."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.raster.distortion_kernels import Distortion, distort
from recipe_runtime.render.raster.triangles import NEARNESS, OTHER_LEVEL, cut_at_near_plane, snap
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

SKY = wp.constant(wp.uint8(Tag.SKY.value))
TILE = wp.constant(16)  # pixels along the side of a tile; labels are computed by tiles
TILE_PIXELS = wp.constant(256)


@wp.func
def pixel_at(corners: wp.array[wp.int32], place: wp.int32):
    """Return column and row of a thread's pixel; 256 threads per tile.

    A tile is given by its first pixel: the column, and the row in the bits from 16 on. The pixel may lie beyond the
    right or the lower border of the picture.
    """
    corner = corners[place >> 8]
    return (corner & 65535) + (place & 15), (corner >> 16) + ((place >> 4) & 15)


@wp.func
def triangle_of(key: wp.uint64) -> wp.int32:
    """Return the triangle's index in a key that is not 0."""
    return wp.int32(key & wp.uint64(16777215))


@wp.func
def depth_of(key: wp.uint64, near: wp.float64) -> wp.float64:
    """Return the depth of a key that is not 0, in metres along the optical axis."""
    return near * NEARNESS / wp.float64(wp.int64(key >> wp.uint64(24)))


@wp.kernel
def label_pixels(
    tile_corners: wp.array[wp.int32],
    keys: wp.array[wp.uint64],
    triangle_surface: wp.array[wp.int32],
    surface_actor: wp.array[wp.int32],
    surface_instance: wp.array[wp.int32],
    surface_tag: wp.array[wp.int32],
    pinhole: Pinhole,
    out_depth: wp.array[wp.float32],
    out_instance: wp.array[wp.uint16],
    out_semantic: wp.array[wp.uint8],
    out_extents: wp.array2d[wp.int32],
):
    """Label the tiles' pixels, and widen the visible extents of the actors.

    An extent is a pixel count and a box: count, x0, y0, x1, y1.
    """
    x, y = pixel_at(tile_corners, wp.tid())
    if x >= pinhole.width or y >= pinhole.height:
        return
    i = y * pinhole.width + x
    key = keys[i]
    if key == wp.uint64(0):
        out_depth[i] = wp.float32(pinhole.far)
        out_instance[i] = wp.uint16(0)
        out_semantic[i] = SKY
        return
    surface = triangle_surface[triangle_of(key)]
    out_depth[i] = wp.float32(depth_of(key, pinhole.near))
    out_instance[i] = wp.uint16(surface_instance[surface])
    out_semantic[i] = wp.uint8(surface_tag[surface])
    actor = surface_actor[surface]
    if actor >= 0:
        count_pixel(out_extents, actor, x, y)


@wp.func
def widen_box(extents: wp.array2d[wp.int32], actor: wp.int32, x: wp.int32, y: wp.int32, size: wp.int32):
    """Widen an actor's box by a point, or by a pixel if `size` is 1; atomics are used only if it lies outside."""
    if x < extents[actor, 1]:
        wp.atomic_min(extents, actor, 1, x)
    if y < extents[actor, 2]:
        wp.atomic_min(extents, actor, 2, y)
    if x + size > extents[actor, 3]:
        wp.atomic_max(extents, actor, 3, x + size)
    if y + size > extents[actor, 4]:
        wp.atomic_max(extents, actor, 4, y + size)


@wp.func
def count_pixel(extents: wp.array2d[wp.int32], actor: wp.int32, x: wp.int32, y: wp.int32):
    """Add a pixel to an actor's extent."""
    wp.atomic_add(extents, actor, 0, 1)
    widen_box(extents, actor, x, y, 1)


@wp.kernel
def count_amodal(
    tile_corners: wp.array[wp.int32],
    bits: wp.array[wp.uint64],
    pinhole: Pinhole,
    first_actor: wp.int32,
    actor_count: wp.int32,
    out_extents: wp.array2d[wp.int32],
):
    """Add the tiles' pixels to the amodal extent of every actor whose bit is set there."""
    x, y = pixel_at(tile_corners, wp.tid())
    if x >= pinhole.width or y >= pinhole.height:
        return
    i = y * pinhole.width + x
    rest = bits[i]
    if rest == wp.uint64(0):
        return
    for a in range(actor_count):
        if ((rest >> wp.uint64(a)) & wp.uint64(1)) != wp.uint64(0):
            count_pixel(out_extents, first_actor + a, x, y)


@wp.kernel
def project_boxes(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    chunks: wp.array[wp.vec3i],
    chunk_visible: wp.array[wp.int32],
    first_chunk: wp.int32,
    part_extent: wp.array[wp.int32],
    pinhole: Pinhole,
    distortion: Distortion,
    out_extents: wp.array2d[wp.int32],
    out_reach: wp.array2d[wp.int32],
):
    """Widen a moving body's unclipped box (1/256 pixels) by the corners of a triangle in front of the near plane.

    There are 64 threads per chunk from `first_chunk` on; the versions of objects that are not shown do not count.

    `out_reach` also contains the points at which the near plane cuts the triangle: together the boxes contain all of
    its pixels.
    """
    n = first_chunk + (wp.tid() >> 6)
    place = wp.tid() & 63
    chunk = chunks[n]
    if chunk_visible[n] == OTHER_LEVEL or place >= chunk[1]:
        return
    t = triangles[chunk[0] + place]
    row = part_extent[chunk[2]]
    for k in range(3):
        v = vertices[t[k]]
        z = wp.float64(v[2])
        if z >= pinhole.near:
            at = distort(
                pinhole.cx + wp.float64(v[0]) * pinhole.focal / z,
                pinhole.cy + wp.float64(v[1]) * pinhole.focal / z,
                distortion,
            )
            x = wp.int32(snap(at[0]))
            y = wp.int32(snap(at[1]))
            widen_box(out_extents, row, x, y, 0)
            for m in range(3):
                behind = vertices[t[m]]
                if wp.float64(behind[2]) < pinhole.near:
                    c = cut_at_near_plane(v, behind, pinhole)
                    widen_box(out_reach, row, wp.int32(c.x), wp.int32(c.y), 0)
