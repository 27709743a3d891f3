"""Slots: where a frame's samples go if nobody can stop to count them.

A pixel with one sample has the slot of its own number. The samples of an edge's pixel stand together behind all those;
each tile takes a stretch there, and which one is chance, but a sample's place tells in no byte.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.raster.label_kernels import pixel_at
from recipe_runtime.render.scene.camera import Pinhole

wp.set_module_options(OPTIONS)


@wp.kernel
def rank_in_tile(counts: wp.array[wp.int32], firsts: wp.array[wp.int32], wanted: wp.array[wp.int32]):
    """Where an edge's pixel stands within its tile's stretch; `wanted` counts the tile's samples and comes zeroed."""
    at = wp.tid()
    n = counts[at]
    if n > 1:
        firsts[at] = wp.atomic_add(wanted, at >> 8, n)


@wp.kernel
def reserve_slots(wanted: wp.array[wp.int32], stretches: wp.array[wp.int32], cursor: wp.array[wp.int32]):
    """A stretch for each tile; the cursor comes zeroed."""
    tile = wp.tid()
    stretches[tile] = wp.atomic_add(cursor, 0, wanted[tile])


@wp.kernel
def assign_slots(
    corners: wp.array[wp.int32],
    lens: Pinhole,
    stretches: wp.array[wp.int32],
    room: wp.int32,
    counts: wp.array[wp.int32],
    firsts: wp.array[wp.int32],
):
    """Every pixel's first slot. Those for whom there is no room get none: the cursor tells, and the frame is redone."""
    at = wp.tid()
    n = counts[at]
    x, y = pixel_at(corners, at)
    if n == 1:
        firsts[at] = y * lens.width + x
    elif n > 1:
        first = lens.width * lens.height + stretches[at >> 8] + firsts[at]
        firsts[at] = first
        if first + n > room:
            counts[at] = 0
