"""Boxes about the samples of tiles."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import maximum, minimum
from recipe_runtime.render.raster.label_kernels import TILE, pixel_at
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)


@wp.kernel
def bound_tiles(
    tile_corners: wp.array[wp.int32],
    pinhole: Pinhole,
    starts: wp.array[wp.int32],
    sample_count: wp.int32,
    surfaces: wp.array[wp.int32],
    positions: wp.array[wp.vec3f],
    out_lows: wp.array[wp.vec3f],
    out_highs: wp.array[wp.vec3f],
):
    """Write the world-space box of a tile's samples, which are stored consecutively; samples of the sky are ignored."""
    tile = wp.tid()
    x, y = pixel_at(tile_corners, tile * TILE * TILE)
    begin = starts[y * pinhole.width + x]
    end = sample_count
    if tile + 1 < out_lows.shape[0]:
        x, y = pixel_at(tile_corners, (tile + 1) * TILE * TILE)
        end = starts[y * pinhole.width + x]
    low = wp.vec3f(1.0e9, 1.0e9, 1.0e9)
    high = wp.vec3f(-1.0e9, -1.0e9, -1.0e9)
    for i in range(begin, end):
        if surfaces[i] >= 0:
            p = positions[i]
            low = wp.vec3f(minimum(low[0], p[0]), minimum(low[1], p[1]), minimum(low[2], p[2]))
            high = wp.vec3f(maximum(high[0], p[0]), maximum(high[1], p[1]), maximum(high[2], p[2]))
    if high[0] < low[0]:
        low = wp.vec3f(0.0, 0.0, 0.0)
        high = low
    out_lows[tile] = low
    out_highs[tile] = high
