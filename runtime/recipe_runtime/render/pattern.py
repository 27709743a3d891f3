"""Patterns: what a surface looks like close by, drawn from its coordinates and faded where a pixel is wider.

Every pattern gives a tone (the base colour is multiplied by it), a share of the surface's second colour (mortar,
joints, leaves in the sun), a wear, and a height that says where rain collects. All of it is analytic and filtered
by the pixel's footprint, so that nothing aliases at a distance.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.noise import clamp01, hash2, noise2, noise3, scramble, unit, whole
from recipe_runtime.render.vectors import direction, inner

wp.set_module_options(OPTIONS)

PLAIN = wp.constant(int(Pattern.PLAIN))
ASPHALT = wp.constant(int(Pattern.ASPHALT))
SLABS = wp.constant(int(Pattern.SLABS))
CONCRETE = wp.constant(int(Pattern.CONCRETE))
BRICK = wp.constant(int(Pattern.BRICK))
PLASTER = wp.constant(int(Pattern.PLASTER))
ROOF = wp.constant(int(Pattern.ROOF))
GRASS = wp.constant(int(Pattern.GRASS))
FOLIAGE = wp.constant(int(Pattern.FOLIAGE))
BARK = wp.constant(int(Pattern.BARK))
METAL = wp.constant(int(Pattern.METAL))
SKIN = wp.constant(int(Pattern.SKIN))
CLOTH = wp.constant(int(Pattern.CLOTH))
ROAD_PAINT = wp.constant(int(Pattern.ROAD_PAINT))
WINDOW = wp.constant(int(Pattern.WINDOW))
HAIR = wp.constant(int(Pattern.HAIR))
CLAPBOARD = wp.constant(int(Pattern.CLAPBOARD))
STONE = wp.constant(int(Pattern.STONE))
WOOD = wp.constant(int(Pattern.WOOD))
WATER = wp.constant(int(Pattern.WATER))
NICHE = wp.constant(int(Pattern.NICHE))
CURTAIN_WALL = wp.constant(int(Pattern.CURTAIN_WALL))
SHOP_WINDOW = wp.constant(int(Pattern.SHOP_WINDOW))
POSTER = wp.constant(int(Pattern.POSTER))
LETTER = wp.constant(int(Pattern.LETTER))
FACADE = wp.constant(int(Pattern.FACADE))


@wp.struct
class Detail:
    """A pattern at a point; `code` is a hash that names the window."""

    tone: wp.float32
    second: wp.float32
    wear: wp.float32
    height: wp.float32
    code: wp.uint32
    normal: wp.vec3f


@wp.func
def fade(width: wp.float32, footprint: wp.float32) -> wp.float32:
    """How much of a feature `width` metres wide is left in pixels `footprint` wide: 1 close by, 0 far off."""
    return clamp01(1.5 - 2.0 * footprint / width)


@wp.func
def joint(t: wp.float32, half: wp.float32, footprint: wp.float32) -> wp.float32:
    """Share of a pixel that lies on joints 2 half wide, one at each whole number; box-filtered, so exact on average."""
    w = wp.max(footprint, 1.0e-4) * 0.5
    low = t - w + half
    high = t + w + half
    a = wp.float32(whole(low)) * 2.0 * half + wp.min(low - wp.float32(whole(low)), 2.0 * half)
    b = wp.float32(whole(high)) * 2.0 * half + wp.min(high - wp.float32(whole(high)), 2.0 * half)
    return clamp01((b - a) / (2.0 * w))


@wp.func
def tiles(
    uv: wp.vec2f, width: wp.float32, height: wp.float32, gap: wp.float32, bond: wp.float32, foot: wp.float32
) -> wp.vec3f:
    """Courses of stones: the share of joint, a tone of the stone in [0, 1), and how much of that tone is left."""
    v = uv[1] / height
    course = whole(v)
    u = uv[0] / width + bond * wp.float32(course & 1)
    mortar = wp.max(joint(u, 0.5 * gap / width, foot / width), joint(v, 0.5 * gap / height, foot / height))
    return wp.vec3f(mortar, unit(hash2(whole(u), course, wp.uint32(77))), fade(height, foot))


@wp.func
def ground_noise(p: wp.vec3f, foot: wp.float32) -> wp.float32:
    """Slow unevenness of the ground in the world, in [0, 1): where water stands."""
    a = noise2(p[0] * 0.45, p[1] * 0.45, wp.uint32(11))
    level = a * 0.7 + 0.15
    near = fade(0.6, foot)
    if near > 0.0:
        level = level + (noise2(p[0] * 1.7 + 5.1, p[1] * 1.7, wp.uint32(12)) - 0.5) * 0.42 * near
    near = fade(0.16, foot)
    if near > 0.0:
        level = level + (noise2(p[0] * 6.1, p[1] * 6.1 + 2.0, wp.uint32(18)) - 0.5) * 0.14 * near
    return level


@wp.func
def mended(p: wp.vec3f, foot: wp.float32) -> wp.float32:
    """What a road's repairs do to its tone: here and there a rectangle of newer, darker asphalt with a tarred seam."""
    x = p[0] / 4.7
    y = p[1] / 7.3
    i = whole(x)
    j = whole(y)
    code = hash2(i, j, wp.uint32(28))
    tone = wp.float32(0.0)
    if unit(code) < 0.16:
        half = 0.14 + 0.24 * unit(scramble(code))
        beside = (half - wp.abs(x - wp.float32(i) - 0.5)) * 4.7
        ends = (0.36 - wp.abs(y - wp.float32(j) - 0.5)) * 7.3
        inner = wp.min(beside, ends)
        w = wp.max(foot, 0.01)
        seam = clamp01((0.03 - wp.abs(inner)) / w + 0.5) * clamp01(0.06 / w)
        tone = -0.1 * clamp01(inner / w + 0.5) - 0.3 * seam
    return tone


@wp.func
def asphalt(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Grains of stone in tar, patches that have aged differently, repairs, and fine cracks."""
    age = noise2(p[0] * 0.23, p[1] * 0.23, wp.uint32(1)) - 0.5
    d.tone = 1.0 + 0.3 * age
    near = fade(0.5, foot)
    if near > 0.0:
        patch = noise2(p[0] * 2.1, p[1] * 2.1, wp.uint32(2)) - 0.5
        d.tone = d.tone + near * (0.2 * patch + mended(p, foot))
        crack = 1.0 - wp.abs(age + 0.09 * patch - 0.06) / (0.0035 + 0.2 * foot)
        d.tone = d.tone - 0.3 * near * clamp01(crack) * clamp01(0.012 / wp.max(foot, 0.004))
    near = fade(0.06, foot)
    if near > 0.0:
        d.tone = d.tone + 0.3 * near * (noise2(p[0] * 17.0, p[1] * 17.0, wp.uint32(4)) - 0.5)
    near = fade(0.018, foot)
    if near > 0.0:
        stone = unit(hash2(whole(p[0] * 55.0), whole(p[1] * 55.0), wp.uint32(3))) - 0.5
        d.tone = d.tone + 0.5 * near * stone
    d.height = ground_noise(p, foot)
    return d


@wp.func
def slabs(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Paving stones, each of its own tone, with dark joints."""
    t = tiles(uv, 0.6, 0.4, 0.012, 0.5, foot)
    d.second = t[0] * 0.75
    stain = noise2(p[0] * 0.7, p[1] * 0.7, wp.uint32(6)) - 0.5
    d.tone = 1.0 + 0.16 * (t[1] - 0.5) * t[2] + 0.16 * stain
    near = fade(0.015, foot)
    if near > 0.0:
        speck = unit(hash2(whole(uv[0] * 70.0), whole(uv[1] * 70.0), wp.uint32(5))) - 0.5
        d.tone = d.tone + 0.14 * speck * near
    d.height = ground_noise(p, foot) + 0.1
    return d


@wp.func
def blades(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Grass: broad changes of colour, tufts, and blades close by."""
    field = noise2(p[0] * 0.13, p[1] * 0.13, wp.uint32(29)) - 0.5
    d.tone = 0.95 + 0.25 * field
    d.second = clamp01(0.3 + 0.5 * field)
    near = fade(0.5, foot)
    if near > 0.0:
        tuft = noise2(p[0] * 2.3, p[1] * 2.3, wp.uint32(8)) - 0.5
        d.tone = d.tone + 0.22 * tuft * near
        d.second = clamp01(d.second + 0.35 * tuft * near)
    near = fade(0.09, foot)
    if near > 0.0:
        d.tone = d.tone + 0.45 * near * (noise2(p[0] * 13.0, p[1] * 13.0, wp.uint32(9)) - 0.5)
    near = fade(0.025, foot)
    if near > 0.0:
        d.tone = d.tone + 0.8 * near * (noise2(p[0] * 70.0, p[1] * 44.0, wp.uint32(10)) - 0.5)
    return d


@wp.func
def hole(t: wp.float32) -> wp.float32:
    """1 in the gaps between leaves, where noise in [-0.5, 0.5) is lowest."""
    return clamp01(-0.6 - 7.0 * t)


@wp.func
def crown(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """A tree's leaves: dark gaps between them, boughs of their own green, and less sky within and below."""
    bough = (noise3(p[0] * 1.3, p[1] * 1.3, p[2] * 1.6, wp.uint32(8)) - 0.5) * fade(1.5, foot)
    twig = noise3(p[0] * 6.3, p[1] * 6.3, p[2] * 7.1, wp.uint32(10)) - 0.5
    near = fade(0.22, foot)
    tone = 1.04 + 0.35 * bough + 0.5 * twig * near
    lean = 0.5 * near
    d.normal = direction(d.normal + wp.vec3f(twig * lean, bough * lean, -0.5 * twig * lean))
    near = fade(0.07, foot)
    if near > 0.0:
        leaf = noise3(p[0] * 19.0, p[1] * 19.0, p[2] * 23.0, wp.uint32(9)) - 0.5
        tone = tone + (0.95 * leaf - 0.3 * hole(leaf + 0.3 * twig)) * near
        d.normal = direction(d.normal + wp.vec3f(0.6 * leaf * near, -0.5 * leaf * near, 0.8 * leaf * near))
    d.tone = wp.max(tone, 0.2) * (0.34 + 0.66 * uv[1])
    d.second = clamp01(0.35 + 1.4 * bough + 0.9 * twig * near)
    return d


@wp.func
def either(a: wp.float32, b: wp.float32) -> wp.float32:
    """The share covered by at least one of two things that lie independently."""
    return a + b - a * b


@wp.func
def behind(sight: wp.vec3f, normal: wp.vec3f) -> wp.vec3f:
    """The sight's slope behind a pane: to the right and up for each unit inwards, and how fast it goes in."""
    inward = wp.max(-inner(sight, normal), 0.08)
    right = sight[1] * normal[0] - sight[0] * normal[1]
    return wp.vec3f(right / inward, sight[2] / inward, inward)


@wp.func
def until(at: wp.float32, slope: wp.float32, low: wp.float32, high: wp.float32) -> wp.float32:
    """How far inwards a sight goes until it leaves the interval on this axis."""
    far = wp.float32(99.0)
    if slope > 1.0e-4:
        far = (high - at) / slope
    elif slope < -1.0e-4:
        far = (low - at) / slope
    return far


@wp.func
def room(fu: wp.float32, fv: wp.float32, ray: wp.vec3f, code: wp.uint32) -> wp.float32:
    """How bright what one sees of a room is, by the wall, floor or ceiling that the sight meets; in parts of a pane."""
    side = until(fu, ray[0], -0.75, 1.75)
    level = until(fv, ray[1], -0.5, 1.22)
    back = 2.0 + 1.2 * unit(code)
    deep = wp.min(back, wp.min(side, level))
    x = fu + ray[0] * deep
    y = fv + ray[1] * deep
    bright = wp.float32(0.62)
    if deep == back:
        bright = 0.85
        shelf = unit(scramble(code + wp.uint32(whole(x * 2.0 + 8.0))))
        if y < -0.2 + 0.9 * shelf * shelf:
            bright = 0.38
    elif deep == level:
        bright = 0.28
        if ray[1] > 0.0:
            bright = 1.15
    return bright / (1.0 + 0.14 * deep)


@wp.func
def window(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """A pane: `second` is its frame's share, `wear` the curtain's, `tone` how bright the room behind it is.

    `code` names the window, `height` is how far it is seen by itself and not as one of many. A building's windows
    are divided alike.
    """
    i = whole(uv[0])
    j = whole(uv[1])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(j)
    w = wp.max(foot * 0.65, 0.003)
    d.second = either(joint(uv[0], 0.055, w), joint(uv[1], 0.04, w))
    kind = hash2(i >> 4, 5, wp.uint32(71)) & wp.uint32(3)
    if kind < wp.uint32(3):
        d.second = either(d.second, joint(uv[0] + 0.5, 0.022, w))
    if kind == wp.uint32(0):
        d.second = either(d.second, joint(uv[1] + 0.3, 0.018, w))
    elif kind == wp.uint32(3):
        d.second = either(d.second, joint(uv[1] + 0.5, 0.022, w))
    d.code = hash2(i, j, d.code)
    side = wp.min(fu, 1.0 - fu)
    drawn = unit(d.code * wp.uint32(747796405)) * 0.4
    edge = drawn - side
    style = d.code & wp.uint32(7)
    if style < wp.uint32(2):
        edge = -1.0
    elif style == wp.uint32(2):
        edge = fv - (1.0 - 2.0 * drawn)  # a blind, let down
    near = fade(1.3, foot)
    d.wear = 0.27 + (clamp01(edge / wp.max(w, 0.02) + 0.5) - 0.27) * near
    d.height = near
    d.tone = 0.66
    near = fade(0.5, foot)
    if near > 0.0:
        fold = 0.12 * fade(0.12, foot) * (wp.abs(fu * 11.0 - wp.float32(whole(fu * 11.0)) - 0.5) - 0.25)
        seen = room(fu, fv, behind(sight, d.normal), d.code)
        seen = seen + (0.9 + 3.0 * fold - seen) * d.wear
        d.tone = 0.66 + (seen - 0.66) * near
    # The lintel and the jambs keep the sky from the pane's edges.
    d.tone = d.tone * (0.94 + near * (0.28 * clamp01((1.0 - fv) * 5.0) * clamp01(0.4 + side * 5.0) - 0.22))
    return d


@wp.func
def curtain_wall(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """Glass from floor to floor between thin mullions; below it, as `wear`, the panel that hides a floor slab."""
    i = whole(uv[0])
    j = whole(uv[1])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(j)
    w = wp.max(foot * 0.5, 0.003)
    d.wear = joint(uv[1] - 0.12, 0.13, w)
    d.second = either(joint(uv[0], 0.028, w), joint(uv[1], 0.012, w))
    d.second = either(d.second, joint(uv[1] - 0.25, 0.012, w))
    pane = hash2(i, j, d.code)
    d.code = hash2(i / 3, j, d.code)  # an office is three panes wide
    d.height = fade(3.0, foot)
    d.tone = 0.48
    near = fade(0.6, foot)
    if near > 0.0:
        seen = room((fu + wp.float32(i % 3)) * 0.4, (fv - 0.25) * 0.6, behind(sight, d.normal), d.code)
        d.tone = 0.48 + (seen - 0.48) * near
    d.tone = d.tone + 0.2 * near * (unit(pane) - 0.5)
    # No pane is quite in its neighbours' plane.
    lean = 0.03 * near
    d.normal = direction(
        d.normal + wp.vec3f(lean * (unit(pane) - 0.5), lean * (unit(pane * wp.uint32(747796405)) - 0.5), 0.0)
    )
    return d


@wp.func
def shop_window(d: Detail, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """One large pane before a display: goods on two shelves, the shop behind; `wear` is their colour's share.

    `height` says which colour.
    """
    i = whole(uv[0])
    j = whole(uv[1])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(j)
    w = wp.max(foot * 0.4, 0.002)
    d.second = either(joint(uv[0], 0.022, w), joint(uv[1], 0.022, w))
    d.second = either(d.second, joint(uv[1] + 0.22, 0.012, w))
    d.code = hash2(i >> 4, j, d.code)
    d.height = 0.4
    d.tone = 0.62
    near = fade(0.2, foot)
    if near > 0.0:
        ray = behind(sight, d.normal)
        seen = room(0.5 + (fu - 0.5) * 1.4, fv * 1.1, ray, d.code)
        for row in range(2):
            # goods a little behind the pane, and more of them farther in
            deep = 0.14 + 0.5 * wp.float32(row)
            x = (fu + ray[0] * deep + wp.float32(i)) * (11.0 - 3.0 * wp.float32(row))
            y = fv + ray[1] * deep - 0.04 - 0.3 * wp.float32(row)
            goods = hash2(whole(x), row, d.code)
            tall = 0.07 + 0.2 * unit(goods)
            wide = 0.28 + 0.2 * unit(scramble(goods))
            at = wp.abs(x - wp.float32(whole(x)) - 0.5)
            if (goods & wp.uint32(3)) == wp.uint32(0) and y > 0.55 * tall:
                wide = 0.4 * wide  # a bottle's neck
            elif (goods & wp.uint32(3)) == wp.uint32(1):
                wide = wide * (1.1 - 0.8 * y / tall)
            if y > 0.0 and y < tall and at < wide and d.wear == 0.0:
                seen = (0.45 + 0.6 * unit(goods * wp.uint32(747796405))) * (1.15 - at)
                d.wear = 0.35 + 0.65 * unit(goods * wp.uint32(1403630843))
                d.height = unit(scramble(goods + wp.uint32(9)))
            elif y <= 0.0 and y > -0.05 and d.wear == 0.0:
                seen = 0.5
        d.tone = 0.62 + (seen - 0.62) * near
    d.wear = 0.15 + (d.wear - 0.15) * near
    d.tone = d.tone * (0.97 + near * (0.2 * clamp01((1.0 - fv) * 4.0) - 0.17))
    return d


@wp.func
def poster(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A printed picture, by its number: a disc over hills, or bands, and lines of type below."""
    i = whole(uv[0])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(whole(uv[1]))
    w = wp.max(foot * 0.25, 0.003)
    code = hash2(i, 3, wp.uint32(91))
    cx = 0.3 + 0.4 * unit(code)
    cy = 0.52 + 0.2 * unit(scramble(code))
    r = 0.1 + 0.14 * unit(scramble(code + wp.uint32(1)))
    x = fu - cx
    y = (fv - cy) * 0.9
    disc = clamp01((r - wp.sqrt(x * x + y * y)) / w + 0.5)
    hill = 0.3 + 0.22 * noise2(fu * 3.0 + wp.float32(i), 0.5, code)
    ground = clamp01((hill - fv) / w + 0.5)
    if (code & wp.uint32(1)) == wp.uint32(1):
        ground = joint(fu * 5.0 + fv * 4.0, 0.5 * (0.2 + 0.4 * unit(code)), w * 6.0) * clamp01((fv - 0.3) / w + 0.5)
    d.second = either(disc, 0.0) * (1.0 - 0.5 * ground)
    d.tone = 1.0 - 0.55 * ground
    if fv < 0.2:
        word = unit(hash2(whole(fu * 24.0), whole(fv * 15.0), code))
        line = joint(fv * 15.0 - 0.5, 0.28, w * 15.0) * clamp01(fu * 14.0 - 1.0) * clamp01(11.0 - fu * 14.0)
        ink = 0.5
        if word < 0.8:
            ink = 0.9
        if word < 0.2:
            ink = 0.0
        ink = 0.6 + (ink - 0.6) * fade(0.04, w)
        d.second = line * ink
        d.tone = 0.75
    margin = either(joint(uv[0], 0.02, w), joint(uv[1], 0.02, w))
    d.second = d.second + (1.0 - d.second) * margin
    d.tone = d.tone + (1.0 - d.tone) * margin
    near = fade(2.0, foot)
    d.second = 0.22 + (d.second - 0.22) * near
    d.tone = 0.84 + (d.tone - 0.84) * near
    return d


@wp.func
def dot(high: wp.int32, low: wp.int32, column: wp.int32, row: wp.int32) -> wp.float32:
    """1 where a letter's dot is inked; rows count from its foot, and nothing is outside."""
    if column < 0 or column > 3 or row < 0 or row > 5:
        return 0.0
    half = high
    place = 4 * (row - 3) + 3 - column
    if row < 3:
        half = low
        place = 4 * row + 3 - column
    return wp.float32((half >> place) & 1)


@wp.func
def letter(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A letter's strokes: its dots, blended into each other, and cut where the blend is half."""
    high = whole(uv[0])
    low = whole(uv[1])
    x = (uv[0] - wp.float32(high)) * 4.0 - 0.5
    y = (uv[1] - wp.float32(low)) * 6.0 - 0.5
    i = whole(x)
    j = whole(y)
    fx = x - wp.float32(i)
    fy = y - wp.float32(j)
    below = dot(high, low, i, j) * (1.0 - fx) + dot(high, low, i + 1, j) * fx
    above = dot(high, low, i, j + 1) * (1.0 - fx) + dot(high, low, i + 1, j + 1) * fx
    ink = below + (above - below) * fy
    sharp = 1.0 / wp.max(foot * 22.0, 0.12)
    d.second = clamp01((ink - 0.42) * wp.max(sharp, 1.0) + 0.42)
    return d


@wp.func
def facade(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """A bay of a distant wall: its window, and as `second` the wall around it. Buildings differ."""
    i = whole(uv[0])
    j = whole(uv[1])
    w = wp.max(foot * 0.33, 0.003)
    kind = hash2(i >> 6, 6, wp.uint32(72))  # a building's key: 64 bays go by its name
    beside = 0.1 + 0.2 * unit(kind)
    between = 0.16 + 0.1 * unit(scramble(kind))
    if (kind & wp.uint32(3)) == wp.uint32(0):
        beside = 0.02
    elif (kind & wp.uint32(3)) == wp.uint32(1):
        between = 0.06
    d.second = either(joint(uv[0], beside, w), joint(uv[1] - 0.04, between, w))
    d.second = either(d.second, joint(uv[0] + 0.5, 0.012, w))
    d.code = hash2(i, j, d.code)
    d.height = fade(2.5, foot)
    d.wear = 0.25 + 0.5 * d.height * (unit(d.code * wp.uint32(747796405)) - 0.5)
    stain = noise2((p[0] + p[1]) * 0.4, p[2] * 0.1, wp.uint32(27)) - 0.5
    d.tone = 0.75 + 0.25 * d.second * (1.0 + 0.5 * stain)
    return d


@wp.func
def weathered(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Years of rain on an upright wall: runs below its edges, and splashed dirt at its foot."""
    if d.normal[2] * d.normal[2] < 0.25:
        low = clamp01(1.0 - uv[1] * 1.3)
        dirt = 0.25 * low * low
        near = fade(0.5, foot)
        if near > 0.0:
            run = noise2(uv[0] * 2.7, uv[1] * 0.28, wp.uint32(19)) - 0.5
            dirt = dirt * (1.0 + 0.9 * run * near) + 0.11 * near * run
        d.tone = d.tone * (1.0 - dirt)
    return d


@wp.func
def wall(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32, grain: wp.float32) -> Detail:
    """Plaster or concrete: weather stains that run down, and a fine grain."""
    stain = noise2((p[0] + p[1]) * 0.6, p[2] * 0.17, wp.uint32(13)) - 0.5
    d.tone = 1.0 + 0.16 * stain
    near = fade(0.08, foot)
    if near > 0.0:
        fine = noise2(uv[0] * 14.0, uv[1] * 14.0, wp.uint32(14)) - 0.5
        d.tone = d.tone + grain * fine * near
    return weathered(d, uv, foot)


@wp.func
def bricks(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Bricks in stretcher bond, some burnt darker, in light mortar."""
    t = tiles(uv, 0.25, 0.083, 0.011, 0.5, foot)
    stain = noise2((p[0] + p[1]) * 0.5, p[2] * 0.3, wp.uint32(16)) - 0.5
    d.second = t[0] * 0.7
    burnt = wp.max(t[1] - 0.86, 0.0) * 3.0
    d.tone = 1.0 + (0.34 * (t[1] - 0.5) - burnt + 0.03) * t[2] + 0.16 * stain
    return weathered(d, uv, foot)


@wp.func
def stones(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Dressed blocks with fine joints; each has its tone, and its lower edge a little shade."""
    t = tiles(uv, 0.9, 0.42, 0.014, 0.5, foot)
    d.second = t[0] * 0.75
    d.tone = 1.0 + 0.14 * (t[1] - 0.5) * t[2]
    near = fade(0.1, foot)
    if near > 0.0:
        d.tone = d.tone + 0.12 * near * (noise2(uv[0] * 11.0, uv[1] * 15.0, wp.uint32(20)) - 0.5)
    return weathered(d, uv, foot)


@wp.func
def roof_tiles(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Overlapping tiles: each rounded across, with a shadow under the course above; moss here and there."""
    t = tiles(uv, 0.24, 0.32, 0.0, 0.5, foot)
    d.tone = 1.0 + 0.26 * (t[1] - 0.5) * t[2] + 0.2 * (noise2(p[0] * 0.7, p[1] * 0.7, wp.uint32(21)) - 0.5)
    d.second = 0.8 * joint(uv[1] / 0.32, 0.08, foot / 0.32)
    near = fade(0.24, foot)
    if near > 0.0:
        across = uv[0] / 0.24 + 0.5 * wp.float32(whole(uv[1] / 0.32) & 1)
        round_ = wp.abs(across - wp.float32(whole(across)) - 0.5) * 2.0
        d.tone = d.tone + near * 0.3 * (0.33 - round_ * round_)
    return d


@wp.func
def boards(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Level boards, each lapping over the one below: a dark line under its edge, and lighter towards it."""
    v = uv[1] / 0.15
    course = whole(v)
    d.second = 0.7 * joint(v, 0.045, foot / 0.15)
    near = fade(0.15, foot)
    if near > 0.0:
        board = unit(hash2(whole(uv[0] * 0.28 + 0.37 * wp.float32(course & 3)), course, wp.uint32(22))) - 0.5
        d.tone = 1.0 + near * (0.07 * board + 0.1 * (0.5 - (v - wp.float32(course))))
    return weathered(d, uv, foot)


@wp.func
def planks(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Upright planks with their grain."""
    u = uv[0] / 0.13
    plank = unit(hash2(whole(u), 0, wp.uint32(23))) - 0.5
    d.second = 0.8 * joint(u, 0.035, foot / 0.13)
    d.tone = 1.0 + 0.22 * plank * fade(0.13, foot)
    near = fade(0.03, foot)
    if near > 0.0:
        d.tone = d.tone + 0.3 * near * (noise2(uv[0] * 60.0 + 9.0 * plank, uv[1] * 2.5, wp.uint32(24)) - 0.5)
    return d


@wp.func
def ripples(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """The surface of a basin, which small waves tilt to and fro."""
    near = fade(0.3, foot) * 0.09
    a = noise2(p[0] * 4.3, p[1] * 4.3 + 7.0, wp.uint32(25)) - 0.5
    b = noise2(p[0] * 4.3 + 11.0, p[1] * 4.3, wp.uint32(26)) - 0.5
    d.normal = direction(d.normal + wp.vec3f(a * near, b * near, 0.0))
    d.tone = 1.0 + 1.2 * near * (a + b)
    return d


@wp.func
def detail_of(
    pattern: wp.int32,
    uv: wp.vec2f,
    p: wp.vec3f,
    normal: wp.vec3f,
    sight: wp.vec3f,
    footprint: wp.vec2f,
    surface: wp.uint32,
) -> Detail:
    """The pattern at a point of the world, seen along the unit direction `sight`.

    `footprint` is a pixel's size there, across and along the sight.
    """
    d = Detail()
    d.tone = 1.0
    d.normal = normal
    d.height = 0.5
    d.code = surface
    foot = 0.5 * (footprint[1] + wp.sqrt(footprint[0] * footprint[1]))
    if pattern == ASPHALT:
        d = asphalt(d, uv, p, foot)
    elif pattern == SLABS:
        d = slabs(d, uv, p, foot)
    elif pattern == ROAD_PAINT:
        d = asphalt(d, uv, p, foot)
        d.second = 0.13
        near = fade(0.32, foot)
        if near > 0.0:
            worn = noise2(p[0] * 3.1, p[1] * 3.1, wp.uint32(15)) + 0.5 * (d.tone - 1.0)
            d.second = 0.13 + near * (clamp01((worn - 0.62) * 3.0) * 0.75 - 0.13)
        d.tone = 1.0 + 0.25 * (d.tone - 1.0)
    elif pattern == BRICK:
        d = bricks(d, uv, p, foot)
    elif pattern == PLASTER:
        d = wall(d, uv, p, foot, 0.10)
    elif pattern == CONCRETE:
        d = wall(d, uv, p, foot, 0.18)
        d.height = ground_noise(p, foot) + 0.1
    elif pattern == FOLIAGE:
        d = crown(d, uv, p, foot)
    elif pattern == GRASS:
        d = blades(d, p, foot)
        d.height = ground_noise(p, foot) + 0.15
    elif pattern == WINDOW:
        d = window(d, uv, sight, foot)
    elif pattern == NICHE:
        d.tone = 1.0 - 0.62 * clamp01(uv[1])
    elif pattern == BARK:
        rib = noise3(p[0] * 16.0, p[1] * 16.0, p[2] * 3.0, wp.uint32(17)) - 0.5
        d.tone = 1.0 + 0.7 * rib * fade(0.06, foot)
    elif pattern == CLOTH:
        fold = noise2(uv[0] * 5.0, uv[1] * 5.0, surface) - 0.5
        d.tone = 1.0 + 0.22 * fold
    elif pattern == HAIR:
        d.tone = 1.0 + 0.5 * (noise2(uv[0] * 40.0, uv[1] * 8.0, surface) - 0.5) * fade(0.02, foot)
    elif pattern == ROOF:
        d = roof_tiles(d, uv, p, foot)
    elif pattern == STONE:
        d = stones(d, uv, foot)
    elif pattern == CLAPBOARD:
        d = boards(d, uv, foot)
    elif pattern == WOOD:
        d = planks(d, uv, foot)
    elif pattern == CURTAIN_WALL:
        d = curtain_wall(d, uv, sight, foot)
    elif pattern == SHOP_WINDOW:
        d = shop_window(d, uv, sight, foot)
    elif pattern == FACADE:
        d = facade(d, uv, p, foot)
    elif pattern == LETTER:
        d = letter(d, uv, foot)
    elif pattern == POSTER:
        d = poster(d, uv, foot)
    elif pattern == WATER:
        d = ripples(d, p, foot)
    return d
