"""Patterns of glass: rooms behind windows, curtain walls, shop windows, and windows of distant walls.

A line of sight through a pane meets the walls, floor or ceiling of a room (interior mapping), so a window has depth
without triangles.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, noise2, scramble, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.numeric.vectors import dot, normalize
from recipe_runtime.render.texture.detail import Detail, fade, joint_share, union_share

wp.set_module_options(OPTIONS)


@wp.func
def slope_behind(sight: wp.vec3f, normal: wp.vec3f) -> wp.vec3f:
    """Return the slope of a line of sight behind a pane: right and up per unit inwards, and its inward component."""
    inward = maximum(-dot(sight, normal), 0.08)
    right = sight[1] * normal[0] - sight[0] * normal[1]
    return wp.vec3f(right / inward, sight[2] / inward, inward)


@wp.func
def distance_to_wall(at: wp.float32, slope: wp.float32, low: wp.float32, high: wp.float32) -> wp.float32:
    """Return how far inwards a line of sight leaves the interval on this axis."""
    far = wp.float32(99.0)
    if slope > 1.0e-4:
        far = (high - at) / slope
    elif slope < -1.0e-4:
        far = (low - at) / slope
    return far


@wp.func
def room(fu: wp.float32, fv: wp.float32, ray: wp.vec3f, code: wp.uint32) -> wp.float32:
    """Return the brightness of the wall, floor or ceiling that the line of sight meets; lengths are in panes."""
    side = distance_to_wall(fu, ray[0], -0.75, 1.75)
    level = distance_to_wall(fv, ray[1], -0.5, 1.22)
    back = 2.0 + 1.2 * unit(code)
    deep = minimum(back, minimum(side, level))
    x = fu + ray[0] * deep
    y = fv + ray[1] * deep
    bright = wp.float32(0.62)
    if deep == back:
        bright = 0.85
        shelf = unit(scramble(code + wp.uint32(floor(x * 2.0 + 8.0))))
        if y < -0.2 + 0.9 * shelf * shelf:
            bright = 0.38
    elif deep == level:
        bright = 0.28
        if ray[1] > 0.0:
            bright = 1.15
    return bright / (1.0 + 0.14 * deep)


@wp.func
def window(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """A pane: `second` is the share of the frame, `wear` that of the curtain, `tone` the brightness of the room.

    `code` identifies the window, `parameter` is the degree to which it is resolved as a single window. All windows of a
    building are divided alike.
    """
    i = floor(uv[0])
    j = floor(uv[1])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(j)
    w = maximum(foot * 0.65, 0.003)
    d.second = union_share(joint_share(uv[0], 0.055, w), joint_share(uv[1], 0.04, w))
    kind = hash2(i >> 4, 5, seeds.WINDOW_DIVISION) & wp.uint32(3)
    if kind < wp.uint32(3):
        d.second = union_share(d.second, joint_share(uv[0] + 0.5, 0.022, w))
    if kind == wp.uint32(0):
        d.second = union_share(d.second, joint_share(uv[1] + 0.3, 0.018, w))
    elif kind == wp.uint32(3):
        d.second = union_share(d.second, joint_share(uv[1] + 0.5, 0.022, w))
    d.code = hash2(i, j, d.code)
    side = minimum(fu, 1.0 - fu)
    drawn = unit(d.code * wp.uint32(747796405)) * 0.4
    edge = drawn - side
    style = d.code & wp.uint32(7)
    if style < wp.uint32(2):
        edge = -1.0
    elif style == wp.uint32(2):
        edge = fv - (1.0 - 2.0 * drawn)  # a blind, let down
    near = fade(1.3, foot)
    d.wear = 0.27 + (clamp01(edge / maximum(w, 0.02) + 0.5) - 0.27) * near
    d.parameter = near
    d.tone = 0.66
    near = fade(0.5, foot)
    if near > 0.0:
        fold = 0.12 * fade(0.12, foot) * (wp.abs(fu * 11.0 - wp.float32(floor(fu * 11.0)) - 0.5) - 0.25)
        seen = room(fu, fv, slope_behind(sight, d.normal), d.code)
        seen = seen + (0.9 + 3.0 * fold - seen) * d.wear
        d.tone = 0.66 + (seen - 0.66) * near
    # The lintel and the jambs keep the sky from the pane's edges.
    d.tone = d.tone * (0.94 + near * (0.28 * clamp01((1.0 - fv) * 5.0) * clamp01(0.4 + side * 5.0) - 0.22))
    return d


@wp.func
def curtain_wall(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """Floor-to-ceiling glass between thin mullions; `wear` is the share of the panel that hides a floor slab."""
    i = floor(uv[0])
    j = floor(uv[1])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(j)
    w = maximum(foot * 0.5, 0.003)
    d.wear = joint_share(uv[1] - 0.12, 0.13, w)
    d.second = union_share(joint_share(uv[0], 0.028, w), joint_share(uv[1], 0.012, w))
    d.second = union_share(d.second, joint_share(uv[1] - 0.25, 0.012, w))
    pane = hash2(i, j, d.code)
    d.code = hash2(i / 3, j, d.code)  # an office is three panes wide
    d.parameter = fade(3.0, foot)
    d.tone = 0.48
    near = fade(0.6, foot)
    if near > 0.0:
        seen = room((fu + wp.float32(i % 3)) * 0.4, (fv - 0.25) * 0.6, slope_behind(sight, d.normal), d.code)
        d.tone = 0.48 + (seen - 0.48) * near
    d.tone = d.tone + 0.2 * near * (unit(pane) - 0.5)
    # No pane is quite in its neighbours' plane.
    lean = 0.03 * near
    d.normal = normalize(
        d.normal + wp.vec3f(lean * (unit(pane) - 0.5), lean * (unit(pane * wp.uint32(747796405)) - 0.5), 0.0)
    )
    return d


@wp.func
def shop_window(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """One large pane with a display: goods on two shelves, and the shop behind.

    `wear` is the share of the goods' colour, `parameter` selects that colour.
    """
    i = floor(uv[0])
    j = floor(uv[1])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(j)
    w = maximum(foot * 0.4, 0.002)
    d.second = union_share(joint_share(uv[0], 0.022, w), joint_share(uv[1], 0.022, w))
    d.second = union_share(d.second, joint_share(uv[1] + 0.22, 0.012, w))
    d.code = hash2(i >> 4, j, d.code)
    d.parameter = 0.4
    d.tone = 0.62
    near = fade(0.2, foot)
    if near > 0.0:
        ray = slope_behind(sight, d.normal)
        seen = room(0.5 + (fu - 0.5) * 1.4, fv * 1.1, ray, d.code)
        for row in range(2):
            # goods a little behind the pane, and more of them farther in
            deep = 0.14 + 0.5 * wp.float32(row)
            x = (fu + ray[0] * deep + wp.float32(i)) * (11.0 - 3.0 * wp.float32(row))
            y = fv + ray[1] * deep - 0.04 - 0.3 * wp.float32(row)
            goods = hash2(floor(x), row, d.code)
            tall = 0.07 + 0.2 * unit(goods)
            wide = 0.28 + 0.2 * unit(scramble(goods))
            at = wp.abs(x - wp.float32(floor(x)) - 0.5)
            if (goods & wp.uint32(3)) == wp.uint32(0) and y > 0.55 * tall:
                wide = 0.4 * wide  # a bottle's neck
            elif (goods & wp.uint32(3)) == wp.uint32(1):
                wide = wide * (1.1 - 0.8 * y / tall)
            if y > 0.0 and y < tall and at < wide and d.wear == 0.0:
                seen = (0.45 + 0.6 * unit(goods * wp.uint32(747796405))) * (1.15 - at)
                d.wear = 0.35 + 0.65 * unit(goods * wp.uint32(1403630843))
                d.parameter = unit(scramble(goods + wp.uint32(9)))
            elif y <= 0.0 and y > -0.05 and d.wear == 0.0:
                seen = 0.5
        d.tone = 0.62 + (seen - 0.62) * near
    d.wear = 0.15 + (d.wear - 0.15) * near
    d.tone = d.tone * (0.97 + near * (0.2 * clamp01((1.0 - fv) * 4.0) - 0.17))
    return d


@wp.func
def facade(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """A bay of a distant wall: its window, and `second` is the wall around it. It varies between buildings."""
    i = floor(uv[0])
    j = floor(uv[1])
    w = maximum(foot * 0.33, 0.003)
    kind = hash2(i >> 6, 6, seeds.FACADE_BUILDING)  # a building's key: 64 bays go by its name
    beside = 0.1 + 0.2 * unit(kind)
    between = 0.16 + 0.1 * unit(scramble(kind))
    if (kind & wp.uint32(3)) == wp.uint32(0):
        beside = 0.02
    elif (kind & wp.uint32(3)) == wp.uint32(1):
        between = 0.06
    d.second = union_share(joint_share(uv[0], beside, w), joint_share(uv[1] - 0.04, between, w))
    d.second = union_share(d.second, joint_share(uv[0] + 0.5, 0.012, w))
    d.code = hash2(i, j, d.code)
    d.parameter = fade(2.5, foot)
    d.wear = 0.25 + 0.5 * d.parameter * (unit(d.code * wp.uint32(747796405)) - 0.5)
    stain = noise2((p[0] + p[1]) * 0.4, p[2] * 0.1, seeds.FACADE_STAIN) - 0.5
    d.tone = 0.75 + 0.25 * d.second * (1.0 + 0.5 * stain)
    return d
