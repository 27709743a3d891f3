"""Temporal reuse for static cameras: which cached sample radiances are still valid.

The light of an earlier frame stays where it is. A sample is listed if something that moves may affect its light, or
did; all others keep theirs, and no kernel reads them.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash3
from recipe_runtime.render.numeric.scalars import nonnegative
from recipe_runtime.render.numeric.vectors import dot
from recipe_runtime.render.shadows.shadow_kernels import UNTOUCHED

wp.set_module_options(OPTIONS)

# Reuse classes: what a sample's radiance depends on.
TOUCHED = wp.constant(wp.uint8(0))  # a moving object that takes sun or sky light away
AT_REST = wp.constant(wp.uint8(1))  # static objects only
SKY = wp.constant(wp.uint8(2))  # the sky that the sample shows
LEAF = wp.constant(wp.uint8(4))  # plus a phase, 0 to 3: static objects and the motion of the leaves of that phase
MAX_LEAF_DISTANCE = wp.constant(wp.float32(40.0))  # metres beyond which the motion of leaves is not visible


@wp.struct
class PreviousFrame:
    """What changed since an earlier frame, whose radiances are in the buffers that this frame overwrites."""

    tiles: wp.array[wp.int32]  # by tile, the bits that `compare_tiles` writes
    sky: wp.int32  # 1: the clouds have not moved
    shared_count: wp.int32  # samples below this index are those of the earlier frame
    kept_count: wp.int32  # samples below this index are cached from frame to frame
    leaf_step: wp.int32  # the earlier frame's `Air.leaf_step`
    stale: wp.array[
        wp.uint8
    ]  # by pixel, if samples are cached: not 0 where the light has changed since it was developed
    # By cached sample, if lamps are on: light and highlights of the static lamps of its tile, and whether they are
    # those without moving objects.
    lamp_light: wp.array[wp.vec3f]
    lamp_shine: wp.array[wp.vec3f]
    lamp_known: wp.array[wp.uint8]


@wp.struct
class DirtySamples:
    """The samples that a kernel computes: those of a list, then all from index `fresh` on."""

    listed: wp.int32  # count of the list; -1: there is no list, and every sample is dirty
    fresh: wp.int32
    samples: wp.array[wp.int32]


@wp.func
def dirty_sample(dirty: wp.array[DirtySamples], thread: wp.int32) -> wp.int32:
    """Return the index of the sample that a thread computes."""
    i = thread
    listed = dirty[0].listed
    if listed >= 0:
        i = dirty[0].fresh + thread - listed
        if thread < listed:
            i = dirty[0].samples[nonnegative(thread)]
    return nonnegative(i)


@wp.func
def mark_dirty(previous: wp.array[PreviousFrame], pixel: wp.int32):
    """Mark a pixel whose light changes: its developed level is no longer valid."""
    if previous[0].kept_count > 0:
        previous[0].stale[pixel] = wp.uint8(1)


@wp.func
def leaf_phase(p: wp.vec3f) -> wp.int32:
    """Return the phase, 0 to 3, at which leaves at a place move, so that not all move in the same frame."""
    return wp.int32(hash3(floor(p[0] * 2.7), floor(p[1] * 2.7), floor(p[2] * 2.7), seeds.LEAF_PHASE) >> wp.uint32(30))


@wp.func
def swaying_phase(air: wp.array[Air], pattern: wp.int32, p: wp.vec3f, to_point: wp.vec3f) -> wp.int32:
    """Return the phase of leaves or grass that visibly move in the wind; -1 for everything else."""
    phase = wp.int32(-1)
    swaying = air[0].leaf_motion > 0.0 and (pattern == Pattern.FOLIAGE or pattern == Pattern.GRASS)
    if swaying:
        swaying = dot(to_point, to_point) < MAX_LEAF_DISTANCE * MAX_LEAF_DISTANCE
    if swaying:
        phase = leaf_phase(p)
    return phase


@wp.func
def last_leaf_step(phase: wp.int32, now: wp.int32) -> wp.int32:
    """Return the time step at which leaves of a phase last moved: each phase moves at every fourth step."""
    return ((now + phase) & ~3) - phase


@wp.func
def is_unchanged(reuse_class: wp.uint8, calm: wp.bool, still_sky: wp.bool, resting: wp.uint32) -> wp.bool:
    """Return whether a sample's light is that of the earlier frame.

    Args:
        reuse_class: The sample's reuse class.
        calm: No moving object or lamp affects the sample's tile, now or in the earlier frame.
        still_sky: The sky is unchanged.
        resting: The bits that `unchanged_leaf_phases` returns.
    """
    leaf = reuse_class >= LEAF and ((resting >> wp.uint32(reuse_class & wp.uint8(3))) & wp.uint32(1)) != wp.uint32(0)
    return wp.where(reuse_class == SKY, still_sky, calm and (reuse_class == AT_REST or leaf))


@wp.func
def unchanged_leaf_phases(now: wp.int32, then: wp.int32) -> wp.uint32:
    """Return a bit mask of the phases whose leaves have not moved between two time steps."""
    bits = wp.uint32(0)
    for phase in range(4):
        if last_leaf_step(phase, now) == last_leaf_step(phase, then):
            bits = bits | (wp.uint32(1) << wp.uint32(phase))
    return bits


@wp.kernel
def collect_dirty(
    firsts: wp.array[wp.int32],
    air: wp.array[Air],
    previous: wp.array[PreviousFrame],
    reuse_class: wp.array[wp.uint8],
    out_quiet: wp.array[wp.uint8],
    out_count: wp.array[wp.int32],
    out_samples: wp.array[wp.int32],
):
    """List the samples of a tile whose light may have changed; `out_count` must be 0. Their order changes no byte.

    `out_quiet` is set for a tile in which no sample can change until a moving object comes near: it is skipped until
    then.
    """
    tile = wp.tid()
    bits = previous[0].tiles[tile]
    calm = (bits & UNTOUCHED) != 0
    still_sky = previous[0].sky != 0
    if air[0].glow_share > 0.0 and (bits & 4) == 0:
        still_sky = False
    still = calm and still_sky
    if still and out_quiet[tile] != wp.uint8(0):
        return
    resting = unchanged_leaf_phases(air[0].leaf_step, previous[0].leaf_step)
    first = nonnegative(firsts[tile])
    end = firsts[tile + 1]
    n = wp.int32(0)
    leaves = wp.int32(0)
    for i in range(first, end):
        sample_class = reuse_class[nonnegative(i)]
        n = n + wp.where(is_unchanged(sample_class, calm, still_sky, resting), 0, 1)
        leaves = leaves + wp.where(sample_class >= LEAF, 1, 0)
    out_quiet[tile] = wp.where(still and n + leaves == 0, wp.uint8(1), wp.uint8(0))
    if n == 0:
        return
    at = wp.atomic_add(out_count, 0, n)
    for i in range(first, end):
        if not is_unchanged(reuse_class[nonnegative(i)], calm, still_sky, resting):
            out_samples[at] = i
            at = at + 1
