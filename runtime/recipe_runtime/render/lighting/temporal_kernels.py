"""Temporal reuse for static cameras: which cached sample radiances are still valid.

The light of an earlier frame stays where it is. A sample is listed if something that moves may affect its light, or
did; all others keep theirs, and no kernel reads them.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash3
from recipe_runtime.render.numeric.scalars import nonnegative
from recipe_runtime.render.shadows.shadow_kernels import UNTOUCHED

wp.set_module_options(OPTIONS)

# What is known of a sample's light:
TOUCHED = wp.constant(wp.uint8(0))  # something that moves took sun or sky away
AT_REST = wp.constant(wp.uint8(1))  # nothing did
SKY = wp.constant(wp.uint8(2))
LEAF = wp.constant(wp.uint8(4))  # and a turn from 0 to 3: nothing did, but leaves stir there


@wp.struct
class PreviousFrame:
    """What is known of an earlier frame's light, which is where this frame's goes."""

    tiles: wp.array[wp.int32]  # what `compare` and `calm` found
    sky: wp.int32  # 1: the clouds are where they were
    known: wp.int32  # samples below this number are the earlier frame's too
    kept: wp.int32  # samples below this number are of what is kept from frame to frame
    stirs: wp.int32  # the time in which leaves stirred
    stale: wp.array[wp.uint8]  # by pixel, if any are kept: not 0 where the light has changed since it was developed


@wp.struct
class DirtySamples:
    """The samples that a kernel's threads work on: those of a list, and then all from `fresh` on."""

    listed: wp.int32  # count of the list; -1: there is no list, and every sample is dirty
    fresh: wp.int32
    samples: wp.array[wp.int32]


@wp.func
def dirty_sample(dirty: wp.array[DirtySamples], thread: wp.int32) -> wp.int32:
    """The sample that a thread works on."""
    i = thread
    listed = dirty[0].listed
    if listed >= 0:
        i = dirty[0].fresh + thread - listed
        if thread < listed:
            i = dirty[0].samples[nonnegative(thread)]
    return nonnegative(i)


@wp.func
def mark_dirty(before: wp.array[PreviousFrame], pixel: wp.int32):
    """Mark a pixel whose light changes: what was developed of it is no longer valid."""
    if before[0].kept > 0:
        before[0].stale[pixel] = wp.uint8(1)


@wp.func
def leaf_phase(p: wp.vec3f) -> wp.int32:
    """The phase 0 to 3 of a place, so that not all leaves move at once."""
    return wp.int32(hash3(floor(p[0] * 2.7), floor(p[1] * 2.7), floor(p[2] * 2.7), seeds.LEAF_PHASE) >> wp.uint32(30))


@wp.func
def leaf_step(turn: wp.int32, now: wp.int32) -> wp.int32:
    """The time step at which leaves of a phase last moved: every fourth, each phase at its own."""
    return ((now + turn) & ~3) - turn


@wp.func
def is_unchanged(known: wp.uint8, calm: wp.bool, still_sky: wp.bool, resting: wp.uint32) -> wp.bool:
    """Whether a sample's light is that of the frame before; `resting` has a bit for every turn of leaves."""
    leaf = known >= LEAF and ((resting >> wp.uint32(known & wp.uint8(3))) & wp.uint32(1)) != wp.uint32(0)
    return wp.where(known == SKY, still_sky, calm and (known == AT_REST or leaf))


@wp.func
def unchanged_leaf_phases(now: wp.int32, then: wp.int32) -> wp.uint32:
    """A bit for every turn whose leaves are as they were."""
    bits = wp.uint32(0)
    for turn in range(4):
        if leaf_step(turn, now) == leaf_step(turn, then):
            bits = bits | (wp.uint32(1) << wp.uint32(turn))
    return bits


@wp.kernel
def collect_dirty(
    firsts: wp.array[wp.int32],
    air: wp.array[Air],
    previous: wp.array[PreviousFrame],
    known: wp.array[wp.uint8],
    out_quiet: wp.array[wp.uint8],
    out_count: wp.array[wp.int32],
    out_samples: wp.array[wp.int32],
):
    """List a tile's samples whose light may change; `out_count` must be 0. Their order changes no byte.

    `out_quiet` is set for a tile whose samples change only if something comes near: it need not be searched again.
    """
    tile = wp.tid()
    bits = previous[0].tiles[tile]
    calm = (bits & UNTOUCHED) != 0
    still_sky = previous[0].sky != 0
    if air[0].glow > 0.0 and (bits & 4) == 0:
        still_sky = False
    still = calm and still_sky
    if still and out_quiet[tile] != wp.uint8(0):
        return
    resting = unchanged_leaf_phases(air[0].stirs, previous[0].stirs)
    first = nonnegative(firsts[tile])
    end = firsts[tile + 1]
    n = wp.int32(0)
    leaves = wp.int32(0)
    for i in range(first, end):
        of_sample = known[nonnegative(i)]
        n = n + wp.where(is_unchanged(of_sample, calm, still_sky, resting), 0, 1)
        leaves = leaves + wp.where(of_sample >= LEAF, 1, 0)
    out_quiet[tile] = wp.where(still and n + leaves == 0, wp.uint8(1), wp.uint8(0))
    if n == 0:
        return
    at = wp.atomic_add(out_count, 0, n)
    for i in range(first, end):
        if not is_unchanged(known[nonnegative(i)], calm, still_sky, resting):
            out_samples[at] = i
            at = at + 1
