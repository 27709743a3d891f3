"""Slots for a frame's samples, assigned without reading a count back to the host.

A pixel with one sample has the slot of its own number. The samples of an edge's pixel stand together behind all those;
each tile takes a stretch there. Which one depends on timing, but a sample's place changes no byte.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.raster.label_kernels import pixel_at
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)


@wp.kernel
def rank_in_tile(counts: wp.array[wp.int32], out_firsts: wp.array[wp.int32], out_wanted: wp.array[wp.int32]):
    """Where an edge's pixel stands within its tile's stretch; `wanted` counts the tile's samples and comes zeroed."""
    at = wp.tid()
    n = counts[at]
    if n > 1:
        out_firsts[at] = wp.atomic_add(out_wanted, at >> 8, n)


@wp.kernel
def reserve_slots(wanted: wp.array[wp.int32], out_stretches: wp.array[wp.int32], out_cursor: wp.array[wp.int32]):
    """A stretch for each tile; the cursor comes zeroed."""
    tile = wp.tid()
    out_stretches[tile] = wp.atomic_add(out_cursor, 0, wanted[tile])


@wp.kernel
def assign_slots(
    tile_corners: wp.array[wp.int32],
    pinhole: Pinhole,
    stretches: wp.array[wp.int32],
    capacity: wp.int32,
    out_counts: wp.array[wp.int32],
    out_firsts: wp.array[wp.int32],
):
    """Every pixel's first slot. Without room it gets none: the cursor shows it, and the frame is drawn again."""
    at = wp.tid()
    n = out_counts[at]
    x, y = pixel_at(tile_corners, at)
    if n == 1:
        out_firsts[at] = y * pinhole.width + x
    elif n > 1:
        first = pinhole.width * pinhole.height + stretches[at >> 8] + out_firsts[at]
        out_firsts[at] = first
        if first + n > capacity:
            out_counts[at] = 0
