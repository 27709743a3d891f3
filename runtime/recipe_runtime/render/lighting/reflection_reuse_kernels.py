"""Which reflected rays, and which reflected light, of an earlier frame are still valid."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.temporal_kernels import PreviousFrame, mark_dirty
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2
from recipe_runtime.render.numeric.scalars import nonnegative
from recipe_runtime.render.raster.label_kernels import TILE
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

# Rays are cached for pictures of at most this many pixels along a side: the index of a tile is a byte.
MAX_PICTURE_SIDE = wp.constant(255 * 16)


@wp.func
def ring_phase(p: wp.vec3f) -> wp.int32:
    """Return the phase, 0 to 3, at which the rings on a patch of ground change."""
    return wp.int32(hash2(floor(p[0] * 1.9), floor(p[1] * 1.9), seeds.RING_PHASE) >> wp.uint32(30))


@wp.func
def ring_pattern(phase: wp.int32, ring_step: wp.int32) -> wp.int32:
    """Return the seed of a patch's rings, which changes at every fourth time step of its phase."""
    return (ring_step + phase) >> 2


@wp.func
def is_block_unchanged(x0: wp.int32, y0: wp.int32, previous: wp.array[PreviousFrame], pinhole: Pinhole) -> bool:
    """Return whether the light of a block's pixels is unchanged since they were last developed."""
    x1 = wp.min(x0 + 1, pinhole.width - 1)
    top = y0 * pinhole.width
    bottom = wp.min(y0 + 1, pinhole.height - 1) * pinhole.width
    first = previous[0].stale[nonnegative(top + x0)] | previous[0].stale[nonnegative(top + x1)]
    second = previous[0].stale[nonnegative(bottom + x0)] | previous[0].stale[nonnegative(bottom + x1)]
    return (first | second) == wp.uint8(0)


@wp.func
def mark_block_dirty(x0: wp.int32, y0: wp.int32, previous: wp.array[PreviousFrame], pinhole: Pinhole):
    """Mark a block of 2 x 2 pixels whose reflection changes, and the adjacent ones, as dirty."""
    for y in range(wp.max(y0 - 2, 0), wp.min(y0 + 4, pinhole.height)):
        for x in range(wp.max(x0 - 2, 0), wp.min(x0 + 4, pinhole.width)):
            mark_dirty(previous, y * pinhole.width + x)


@wp.func
def packed_tiles(left: wp.int32, top: wp.int32, right: wp.int32, bottom: wp.int32, pinhole: Pinhole) -> wp.uint32:
    """Pack the tiles that overlap a rectangle of pixels and its neighbours into four bytes: at most 255 a side."""
    x0 = wp.uint32(wp.max(left - 1, 0) / TILE)
    y0 = wp.uint32(wp.max(top - 1, 0) / TILE)
    x1 = wp.uint32(wp.min(right + 1, pinhole.width - 1) / TILE)
    y1 = wp.uint32(wp.min(bottom + 1, pinhole.height - 1) / TILE)
    return x0 | (y0 << wp.uint32(8)) | (x1 << wp.uint32(16)) | (y1 << wp.uint32(24))


@wp.func
def no_motion_in(moved: wp.array2d[wp.int32], tiles: wp.uint32) -> wp.bool:
    """Return whether nothing moves in a rectangle of tiles; `moved` is the summed-area table of moving tiles."""
    x0 = wp.int32(tiles & wp.uint32(255))
    y0 = wp.int32((tiles >> wp.uint32(8)) & wp.uint32(255))
    x1 = wp.int32((tiles >> wp.uint32(16)) & wp.uint32(255)) + 1
    y1 = wp.int32(tiles >> wp.uint32(24)) + 1
    return moved[y1, x1] - moved[y0, x1] - moved[y1, x0] + moved[y0, x0] == 0


@wp.kernel
def collect_reflective(
    samples: wp.array[Samples],
    mirror: wp.array[wp.vec2f],
    out_count: wp.array[wp.int32],
    out_samples: wp.array[wp.int32],
):
    """List the samples that reflect anything, with the ring phase of the ground in bits 29 and 30."""
    i = nonnegative(wp.tid())
    if mirror[i][0] > 0.0:
        out_samples[wp.atomic_add(out_count, 0, 1)] = i | (ring_phase(samples[0].positions[i]) << 29)


@wp.kernel
def stale_reflections(
    samples: wp.array[Samples],
    air: wp.array[Air],
    previous: wp.array[PreviousFrame],
    reflective: wp.array[wp.int32],
    previous_ring_step: wp.int32,
    sources: wp.array[wp.vec2i],
    out_count: wp.array[wp.int32],
    out_samples: wp.array[wp.int32],
):
    """List the `reflective` samples whose reflection may differ from the earlier frame's, at `previous_ring_step`.

    It may if the sample's own light or ray has changed, the rings on the water, or one of the two pixels in `sources`
    (-1: outside the picture, -2: unknown). `out_count` must be 0. The order of the list changes no byte.
    """
    entry = reflective[wp.tid()]
    i = nonnegative(entry & 0x1FFFFFFF)
    phase = entry >> 29
    source = sources[i]
    same = ring_pattern(phase, previous_ring_step) == ring_pattern(phase, air[0].ring_step) and source[0] > -2
    if same:
        same = previous[0].stale[nonnegative(samples[0].pixels[i])] == wp.uint8(0)
        if same and source[0] >= 0:
            same = previous[0].stale[nonnegative(source[0])] == wp.uint8(0)
        if same and source[1] >= 0:
            same = previous[0].stale[nonnegative(source[1])] == wp.uint8(0)
    if not same:
        out_samples[wp.atomic_add(out_count, 0, 1)] = i
