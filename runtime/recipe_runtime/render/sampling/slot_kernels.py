"""Slots for a frame's samples, assigned on the device without reading a count back to the host.

A pixel with one sample has the slot of its own index. The samples of pixels at edges follow after all those; each tile
reserves a contiguous range there. Which range depends on timing, but the slot of a sample changes no byte.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.raster.label_kernels import pixel_at
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)


@wp.kernel
def rank_in_tile(counts: wp.array[wp.int32], out_firsts: wp.array[wp.int32], out_wanted: wp.array[wp.int32]):
    """Write an edge pixel's offset within its tile's range; `out_wanted` counts the tile's samples and must be 0."""
    at = wp.tid()
    n = counts[at]
    if n > 1:
        out_firsts[at] = wp.atomic_add(out_wanted, at >> 8, n)


@wp.kernel
def reserve_slots(wanted: wp.array[wp.int32], out_stretches: wp.array[wp.int32], out_cursor: wp.array[wp.int32]):
    """Reserve a range of slots for each tile; `out_cursor` must be 0."""
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
    """Write every pixel's first slot.

    A pixel without room gets no slot: then the cursor exceeds the capacity, and the frame is redrawn.
    """
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
