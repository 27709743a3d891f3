"""The grid of the sky that a town leaves to each place, computed once for a scene."""

from __future__ import annotations

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows.sky_grid_kernels import (
    DIRECTIONS,
    LAYERS,
    SkyGrid,
    fill_houses,
    march_horizons,
    raise_heights,
)

_CELL, _MOST_CELLS = 2.0, 224  # metres, unless the town is wider than so many cells
_MARGIN = 40.0  # metres around the town


def sky_grid(geometry: Geometry, device: str) -> DeviceArray:
    """Return the grid of a town, a one-element array of `SkyGrid`; it is empty without anything that hides the sky."""
    triangles = geometry.triangles.numpy()
    hides = (geometry.casts.numpy() != 0) & (triangles[:, 0] < geometry.static_vertices)
    if not hides.any():
        none = wp.zeros(1, dtype=wp.float32, device=device)
        return struct_array([set_fields(SkyGrid(), shares=none)], device)
    triangles = triangles[hides]
    corners = geometry.vertices.numpy()[np.unique(triangles)]
    low, high = corners[:, :2].min(axis=0) - _MARGIN, corners[:, :2].max(axis=0) + _MARGIN
    cell = float(np.float32(max(_CELL, float((high - low).max()) / _MOST_CELLS)))
    columns, rows = (int(float(extent) / cell) + 2 for extent in high - low)
    heights = wp.zeros(columns * rows, dtype=wp.int32, device=device)
    shares = wp.empty(int(LAYERS) * columns * rows, dtype=wp.float32, device=device)
    filled = wp.empty_like(shares)
    turns = [exact.sin_cos_deg(360.0 * (k + 0.5) / int(DIRECTIONS)) for k in range(int(DIRECTIONS))]
    grid = {"cell": cell, "columns": columns, "rows": rows}
    corner = wp.vec2f(float(low[0]), float(low[1]))
    mesh = {"vertices": geometry.vertices, "triangles": wp.array(triangles, dtype=wp.vec3i, device=device)}
    launch(raise_heights, len(triangles), device, corner=corner, out_heights=heights, **mesh, **grid)
    directions: DeviceArray = wp.array(np.array(turns, np.float32), dtype=wp.vec2f, device=device)
    launch(march_horizons, shares.size, device, heights=heights, directions=directions, out_shares=shares, **grid)
    launch(fill_houses, shares.size, device, shares=shares, columns=columns, rows=rows, out_shares=filled)
    if device != "cpu":
        wp.synchronize_stream(wp.get_stream(device))  # frames are recorded on streams of their own
    return struct_array([set_fields(SkyGrid(), shares=filled, corner=corner, **grid)], device)
