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
def fraction(x: wp.float32) -> wp.float32:
    """Return the part of x above its floor."""
    return x - wp.float32(floor(x))


@wp.func
def room(fu: wp.float32, fv: wp.float32, ray: wp.vec3f, code: wp.uint32, spots: bool) -> wp.float32:
    """Return the brightness of what the line of sight meets in a room; lengths are in panes.

    It has shelves and a picture at the back, and either a pendant lamp or `spots` in the ceiling.
    """
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
        beside = wp.abs(x - 0.1 - 0.8 * unit(code * wp.uint32(747796405)))
        if y < -0.2 + 0.9 * shelf * shelf:
            bright = 0.38
        elif beside < 0.22 and wp.abs(y - 0.72) < 0.16:
            bright = 0.3 + unit(code * wp.uint32(1403630843))
    elif deep == level:
        bright = 0.28
        if ray[1] > 0.0:
            bright = 1.15
            a = fraction(x * 2.0) - 0.5
            c = fraction(deep * 1.6) - 0.5
            if spots and a * a + c * c < 0.035:
                bright = 3.0
    if not spots and deep > 1.1:
        x = fu + ray[0] * 1.1 - 0.5
        y = fv + ray[1] * 1.1 - 0.8
        if x * x + y * y < 0.005:
            bright = 2.0
        elif y > 0.0 and wp.abs(x) < 0.008:
            bright = 0.3
    return bright / (1.0 + 0.14 * deep)


@wp.func
def bend(d: Detail, uv: wp.vec2f, near: wp.float32, pane: wp.uint32, lean: wp.float32) -> Detail:
    """Tilt a pane, because none is quite in its neighbours' plane, and bend it slightly."""
    bow = wp.float32(0.0)
    if near == 1.0:  # at less than a quarter of the distance at which a room begins to show
        bow = 0.012 * (noise2(uv[0] * 3.0, uv[1] * 3.0, seeds.PANE_BOW) - 0.5)
    a = lean * near * (unit(pane) - 0.5) + bow
    c = lean * near * (unit(pane * wp.uint32(747796405)) - 0.5) + bow
    d.normal = normalize(d.normal + wp.vec3f(a, c, bow))
    return d


@wp.func
def furnished(d: Detail, fu: wp.float32, fv: wp.float32, ray: wp.vec3f, drawn: wp.float32, folds: wp.float32) -> Detail:
    """Return the brightness of a room behind its curtain, and of a plant on the sill of some."""
    seen = room(fu, fv, ray, d.code, False)
    d.tone = seen + (0.95 + 3.0 * folds - seen) * d.wear
    if (d.code & wp.uint32(15)) == wp.uint32(5):
        x = wp.abs(fu + ray[0] * 0.14 - 0.3 - drawn)
        y = fv + ray[1] * 0.14
        leaf = 0.1 + 0.14 * noise2(x * 30.0, y * 30.0, d.code)
        high = (y - 0.27) * 0.9
        if x * x + high * high < leaf * leaf:
            d.wear = 2.0
            d.tone = 0.4 + 6.0 * (leaf - 0.1)
        elif x < 0.09 - 0.1 * (0.16 - y) and y < 0.16:
            d.wear = 1.0
            d.tone = 0.45
    return d


@wp.func
def window(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """A pane: `second` is the share of the frame, `tone` the brightness of the room.

    `wear` is the share of the curtain, or 2 for leaves of a plant on the sill. `code` identifies the window,
    `parameter` is the degree to which it is resolved as a single window. All windows of a building are divided alike.
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
    style = d.code & wp.uint32(7)
    fine = fade(0.12, foot)
    folds = 0.12 * fine * (wp.abs(fraction(fu * 11.0 + 0.6 * fv * drawn) - 0.5) - 0.25)
    edge = drawn - side + folds
    sheer = wp.float32(1.0)
    if style < wp.uint32(2):
        edge = -1.0
    elif style == wp.uint32(2):
        edge = fv - (1.0 - 2.0 * drawn)  # a blind, let down
        folds = 0.08 * fine * (fraction(fv * 24.0) - 0.5)
    elif style == wp.uint32(3):
        edge = 1.0  # a net curtain
        sheer = 0.55
    elif style == wp.uint32(4):
        edge = 0.55 - fv  # a net curtain in the lower half
        sheer = 0.7
    resolved = fade(1.3, foot)
    d.wear = 0.31 + (sheer * clamp01(edge / maximum(w, 0.02) + 0.5) - 0.31) * resolved
    d.parameter = resolved
    near = fade(0.5, foot)
    if near > 0.0:
        d = furnished(d, fu, fv, slope_behind(sight, d.normal), drawn, folds)
        d = bend(d, uv, near, d.code, 0.03)
    d.tone = 0.69 + (d.tone - 0.69) * near
    # The lintel and the jambs keep the sky from the pane's edges.
    d.tone = d.tone * (0.94 + resolved * (0.28 * clamp01((1.0 - fv) * 5.0) * clamp01(0.4 + side * 5.0) - 0.22))
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
        seen = room((fu + wp.float32(i % 3)) * 0.4, (fv - 0.25) * 0.6, slope_behind(sight, d.normal), d.code, True)
        d.tone = 0.48 + (seen - 0.48) * near
    d.tone = d.tone + 0.2 * near * (unit(pane) - 0.5)
    return bend(d, uv, near, pane, 0.03)


@wp.func
def shelved(at: wp.vec2f, ray: wp.vec3f, code: wp.uint32) -> wp.vec3f:
    """Return brightness, share and colour of goods on two shelves; a brightness below 0 where there are none.

    `at` is the position in the pane, with the pane's number along u.
    """
    found = wp.vec3f(-1.0, 0.0, 0.0)
    for row in range(2):
        # goods a little behind the pane, and more of them farther in
        deep = 0.14 + 0.5 * wp.float32(row)
        x = (at[0] + ray[0] * deep) * (11.0 - 3.0 * wp.float32(row))
        y = at[1] + ray[1] * deep - 0.04 - 0.3 * wp.float32(row)
        goods = hash2(floor(x), row, code)
        tall = 0.07 + 0.2 * unit(goods)
        wide = 0.28 + 0.2 * unit(scramble(goods))
        beside = wp.abs(fraction(x) - 0.5)
        if (goods & wp.uint32(3)) == wp.uint32(0) and y > 0.55 * tall:
            wide = 0.4 * wide  # a bottle's neck
        elif (goods & wp.uint32(3)) == wp.uint32(1):
            wide = wide * (1.1 - 0.8 * y / tall)
        if found[0] < 0.0 and y > 0.0 and y < tall and beside < wide:
            bright = (0.45 + 0.6 * unit(goods * wp.uint32(747796405))) * (1.15 - beside)
            if wp.abs(y - 0.4 * tall) < 0.16 * tall:
                bright = bright * 1.5  # a label
            share = 0.35 + 0.65 * unit(goods * wp.uint32(1403630843))
            found = wp.vec3f(bright, share, unit(scramble(goods + wp.uint32(9))))
        elif found[0] < 0.0 and y <= 0.0 and y > -0.05:
            found = wp.vec3f(0.5, 0.0, 0.0)
    return found


@wp.func
def dressed(at: wp.vec2f, ray: wp.vec3f, code: wp.uint32) -> wp.vec3f:
    """Return brightness, share and colour of a row of dressed mannequins on a low stage, like `shelved`."""
    x = (at[0] + ray[0] * 0.3) * 3.4
    y = at[1] + ray[1] * 0.3
    doll = hash2(floor(x), 4, code)
    beside = wp.abs(fraction(x) - 0.42 - 0.16 * unit(doll))
    long = 0.24 + 0.26 * unit(scramble(doll))  # the hem
    wide = 0.13 + 0.5 * maximum(0.52 - y, 0.0) * unit(doll * wp.uint32(747796405))
    found = wp.vec3f(-1.0, 0.0, 0.0)
    high = (y - 0.86) / 0.065
    if y < 0.06:
        found = wp.vec3f(0.7, 0.0, 0.0)
    elif (doll & wp.uint32(7)) != wp.uint32(0):
        if y > long and y < 0.76 and beside < wide + 0.07 * clamp01(12.0 * (y - 0.58)):
            found = wp.vec3f(1.25 - 2.6 * beside, 0.9, unit(doll * wp.uint32(1403630843)))
        elif y <= long and wp.abs(beside - 0.06) < 0.045:
            found = wp.vec3f(0.8, 0.5, unit(doll * wp.uint32(1640531527)))
        elif beside * beside * 130.0 + high * high < 1.0 or (y > 0.75 and y < 0.82 and beside < 0.03):
            found = wp.vec3f(1.1, 0.5, 0.2)
    return found


@wp.func
def served(at: wp.vec2f, ray: wp.vec3f, code: wp.uint32) -> wp.vec3f:
    """Return brightness, share and colour of a restaurant's tables and pendant lamps, like `shelved`."""
    x = (at[0] + ray[0] * 0.5) * 2.0
    y = at[1] + ray[1] * 0.5
    beside = wp.abs(fraction(x) - 0.5)
    found = wp.vec3f(-1.0, 0.0, 0.0)
    high = y - 0.74
    chair = wp.abs(beside - 0.4)
    if beside * beside + high * high < 0.012 and high > -0.05:
        found = wp.vec3f(2.6, 0.2, 0.2)
    elif high > 0.0 and beside < 0.008:
        found = wp.vec3f(0.3, 0.0, 0.0)
    elif y > 0.22 and y < 0.26 and beside < 0.3:
        found = wp.vec3f(0.9, 0.6, 0.2)
    elif y < 0.22 and beside < 0.025:
        found = wp.vec3f(0.25, 0.0, 0.0)
    elif (y < 0.15 and chair < 0.08 and y > 0.1) or (y < 0.4 and wp.abs(beside - 0.47) < 0.025):
        found = wp.vec3f(0.5, 0.8, 0.75 + 0.2 * unit(code))
    elif y > 0.26 and y < 0.33 and wp.abs(beside - 0.12) < 0.02:
        found = wp.vec3f(1.6, 0.3, 0.2)
    return found


@wp.func
def shop_window(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """One large pane with a display of goods, clothes or tables, and the shop behind.

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
    d.parameter = 0.2
    d.tone = 0.62
    near = fade(0.2, foot)
    if near > 0.0:
        ray = slope_behind(sight, d.normal)
        seen = room(0.5 + (fu - 0.5) * 1.4, fv * 1.1, ray, d.code, True)
        kind = d.code & wp.uint32(3)
        at = wp.vec2f(uv[0], fv)
        found = wp.vec3f(-1.0, 0.0, 0.0)
        if kind == wp.uint32(0):
            found = dressed(at, ray, d.code)
        elif kind == wp.uint32(1):
            found = served(at, ray, d.code)
        else:
            found = shelved(at, ray, d.code)
        if found[0] >= 0.0:
            seen = found[0]
            d.wear = found[1]
            d.parameter = found[2]
        d.tone = 0.62 + (seen - 0.62) * near
        d = bend(d, uv, near, d.code, 0.01)
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
