"""Ambient occlusion by the town: the share of the sky that is visible above each place, in a coarse grid.

The static scene is reduced to a height field. From every cell, at four heights, the horizon is followed in sixteen
directions: a horizon of slope t leaves 1 / (1 + t^2) of the light that the sky of that direction sheds on level ground.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum, nonnegative

wp.set_module_options(OPTIONS)

LAYERS = wp.constant(4)
DIRECTIONS = wp.constant(16)
MARCH = wp.constant(13)  # steps along a direction, each longer than the one before
BOUNCE = wp.constant(wp.float32(0.9))  # light of houses and trees that hide the sky, relative to that of the ground
UNITS = wp.constant(wp.float32(100.0))  # heights are in centimetres
FLAT = wp.constant(wp.float32(0.5))  # of a normal's z: surfaces above it look up, those below are walls


@wp.struct
class SkyGrid:
    """The share of the sky that a town leaves to each place."""

    shares: wp.array[wp.float32]  # [layer, row, column], as `fill_houses` writes them
    corner: wp.vec2f  # of the grid, in the world
    cell: wp.float32  # metres
    columns: wp.int32
    rows: wp.int32  # 0: there is no grid


@wp.func
def layer_height(layer: wp.int32) -> wp.float32:
    """Return the height of a layer in metres: 0.5, 4, 11, 26."""
    return wp.where(layer < 2, wp.where(layer == 0, 0.5, 4.0), wp.where(layer == 2, 11.0, 26.0))


@wp.func
def edge(a: wp.vec3f, b: wp.vec3f, x: wp.float32, y: wp.float32) -> wp.float32:
    """Return on which side of an edge, seen from above, a point is."""
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])


@wp.kernel
def raise_heights(
    vertices: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    corner: wp.vec2f,
    cell: wp.float32,
    columns: wp.int32,
    rows: wp.int32,
    out_heights: wp.array[wp.int32],
):
    """Raise the cells whose centre a triangle covers, seen from above, to its highest corner."""
    i = wp.tid()
    t = triangles[i]
    a = vertices[t[0]]
    b = vertices[t[1]]
    c = vertices[t[2]]
    left = (minimum(a[0], minimum(b[0], c[0])) - corner[0]) / cell - 0.5
    right = (maximum(a[0], maximum(b[0], c[0])) - corner[0]) / cell - 0.5
    low = (minimum(a[1], minimum(b[1], c[1])) - corner[1]) / cell - 0.5
    high = (maximum(a[1], maximum(b[1], c[1])) - corner[1]) / cell - 0.5
    x0 = wp.int32(maximum(left, 0.0))
    y0 = wp.int32(maximum(low, 0.0))
    x1 = wp.int32(minimum(maximum(right, -1.0), wp.float32(columns - 1)))
    y1 = wp.int32(minimum(maximum(high, -1.0), wp.float32(rows - 1)))
    top = wp.int32(maximum(a[2], maximum(b[2], c[2])) * UNITS)
    for row in range(y0, y1 + 1):
        for column in range(x0, x1 + 1):
            x = corner[0] + (wp.float32(column) + 0.5) * cell
            y = corner[1] + (wp.float32(row) + 0.5) * cell
            p = edge(a, b, x, y)
            q = edge(b, c, x, y)
            r = edge(c, a, x, y)
            if (p > 0.0 and q > 0.0 and r > 0.0) or (p < 0.0 and q < 0.0 and r < 0.0):
                wp.atomic_max(out_heights, row * columns + column, top)


@wp.kernel
def march_horizons(
    heights: wp.array[wp.int32],
    directions: wp.array[wp.vec2f],
    cell: wp.float32,
    columns: wp.int32,
    rows: wp.int32,
    out_shares: wp.array[wp.float32],
):
    """Write the share of the sky above a cell, at the height of a layer; -1 inside a house, below its roof."""
    i = wp.tid()
    layer = i / (columns * rows)
    row = (i / columns) % rows
    column = i % columns
    own = wp.float32(heights[row * columns + column]) / UNITS
    z = layer_height(layer)
    if own > z + 1.0:
        out_shares[i] = -1.0
        return
    total = wp.float32(0.0)
    for k in range(DIRECTIONS):
        d = directions[k]
        slope = wp.float32(0.0)
        reach = wp.float32(1.0)
        for _step in range(MARCH):
            x = wp.int32(wp.float32(column) + 0.5 + d[0] * reach)
            y = wp.int32(wp.float32(row) + 0.5 + d[1] * reach)
            if x >= 0 and y >= 0 and x < columns and y < rows:
                rise = wp.float32(heights[y * columns + x]) / UNITS - z
                slope = maximum(slope, rise / (reach * cell))
            reach = reach * 1.2 + 0.5
        total = total + 1.0 / (1.0 + slope * slope)
    out_shares[i] = total / wp.float32(DIRECTIONS)


@wp.kernel
def fill_houses(shares: wp.array[wp.float32], columns: wp.int32, rows: wp.int32, out_shares: wp.array[wp.float32]):
    """Write the shares; a cell inside a house has that of the free cells beside it, dimmed, or 1 far from any."""
    i = wp.tid()
    found = shares[i]
    if found < 0.0:
        row = (i / columns) % rows
        column = i % columns
        total = wp.float32(0.0)
        count = wp.float32(0.0)
        for y in range(wp.max(row - 1, 0), wp.min(row + 2, rows)):
            for x in range(wp.max(column - 1, 0), wp.min(column + 2, columns)):
                near = shares[i + (y - row) * columns + x - column]
                if near >= 0.0:
                    total = total + near
                    count = count + 1.0
        found = wp.where(count > 0.0, 0.7 * total / maximum(count, 1.0), 1.0)
    out_shares[i] = found


@wp.func
def layer_share(grid: wp.array[SkyGrid], layer: wp.int32, u: wp.float32, v: wp.float32) -> wp.float32:
    """Return the share of a layer at a place in cells, interpolated."""
    columns = grid[0].columns
    i = wp.int32(u)
    j = wp.int32(v)
    fu = u - wp.float32(i)
    fv = v - wp.float32(j)
    at = nonnegative((layer * grid[0].rows + j) * columns + i)
    low = grid[0].shares[at] + (grid[0].shares[at + 1] - grid[0].shares[at]) * fu
    at = nonnegative(at + columns)
    high = grid[0].shares[at] + (grid[0].shares[at + 1] - grid[0].shares[at]) * fu
    return low + (high - low) * fv


@wp.func
def sky_share(grid: wp.array[SkyGrid], p: wp.vec3f, n: wp.vec3f) -> wp.float32:
    """Return the share of the light of the sky that the town leaves to a point with normal n, 0 to 1."""
    if grid[0].rows == 0:
        return 1.0
    # Before a wall the grid knows the street, not the house.
    cell = grid[0].cell
    u = (p[0] + n[0] * 1.2 * cell - grid[0].corner[0]) / cell - 0.5
    v = (p[1] + n[1] * 1.2 * cell - grid[0].corner[1]) / cell - 0.5
    if u < 0.0 or v < 0.0 or u >= wp.float32(grid[0].columns - 1) or v >= wp.float32(grid[0].rows - 1):
        return 1.0
    z = p[2] + 0.4
    layer = wp.where(z < 4.0, 0, wp.where(z < 11.0, 1, 2))
    start = layer_height(layer)
    share = layer_share(grid, layer, u, v)
    if z > start:
        high = layer_share(grid, layer + 1, u, v)
        share = share + (high - share) * clamp01((z - start) / (layer_height(layer + 1) - start))
    # A wall hides half of the sky itself: the light on walls is relative to what a free wall sees.
    walls = clamp01(1.0 - n[2] / FLAT)
    share = minimum(share * (1.0 + 0.6 * walls), 1.0)
    if p[2] < 3.0:
        foot = 1.0 / (1.0 + 3.0 * maximum(p[2], 0.0))  # the foot of a wall is darkest
        share = share * (1.0 - 0.25 * foot * walls)
    return share
