"""Recall: what a camera at rest knows of the frame before, and which samples it must ask again.

The light of an earlier frame stays where it is. A sample is listed if something that moves may have a part in its
light, or had one; all others are as they were, and nobody looks at them.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.air import Air
from recipe_runtime.render.bounds import index
from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.shadow import UNTOUCHED

wp.set_module_options(OPTIONS)

# What is known of a sample's light:
TOUCHED = wp.constant(wp.uint8(0))  # something that moves took the sun away
RESTLESS = wp.constant(wp.uint8(1))  # nothing did, but the surface itself stirs
AT_REST = wp.constant(wp.uint8(2))  # nor does it
SKY = wp.constant(wp.uint8(3))


@wp.struct
class Before:
    """What is known of an earlier frame's light, which is where this frame's goes."""

    tiles: wp.array[wp.int32]  # what `compare` and `calm` found
    sky: wp.int32  # 1: the clouds are where they were
    known: wp.int32  # samples below this number are the earlier frame's too
    kept: wp.int32  # samples below this number are of what is kept from frame to frame
    stale: wp.array[wp.uint8]  # by pixel, if any are kept: not 0 where the light has changed since it was developed


@wp.struct
class Asked:
    """Which samples a kernel's threads are for: those of a list, and then all from `fresh` on."""

    listed: wp.int32  # -1: there is no list, and every sample is asked
    fresh: wp.int32
    samples: wp.array[wp.int32]


@wp.func
def asked_of(asked: wp.array[Asked], thread: wp.int32) -> wp.int32:
    """The sample that a thread is for."""
    i = thread
    listed = asked[0].listed
    if listed >= 0:
        if thread < listed:
            i = asked[0].samples[index(thread)]
        else:
            i = asked[0].fresh + thread - listed
    return index(i)


@wp.func
def spoil(before: wp.array[Before], pixel: wp.int32):
    """The pixel's light changes: what was developed of it no longer holds."""
    if before[0].kept > 0:
        before[0].stale[pixel] = wp.uint8(1)


@wp.func
def rests(known: wp.uint8, calm: wp.bool, still_sky: wp.bool) -> wp.bool:
    """Whether a sample's light is that of the frame before, whatever its sample sees."""
    return wp.where(known == SKY, still_sky, calm and known == AT_REST)


@wp.kernel
def enlist(
    firsts: wp.array[wp.int32],
    air: wp.array[Air],
    before: wp.array[Before],
    known: wp.array[wp.uint8],
    count: wp.array[wp.int32],
    listed: wp.array[wp.int32],
):
    """List a tile's samples whose light may change; `count` comes zeroed. Their order tells in no byte."""
    tile = wp.tid()
    bits = before[0].tiles[tile]
    calm = (bits & UNTOUCHED) != 0
    still_sky = before[0].sky != 0
    if air[0].glow > 0.0 and (bits & 4) == 0:
        still_sky = False
    first = index(firsts[tile])
    end = firsts[tile + 1]
    n = wp.int32(0)
    for i in range(first, end):
        n = n + wp.where(rests(known[index(i)], calm, still_sky), 0, 1)
    if n == 0:
        return
    at = wp.atomic_add(count, 0, n)
    for i in range(first, end):
        if not rests(known[index(i)], calm, still_sky):
            listed[at] = i
            at = at + 1
