"""Patterns: what a surface looks like close by, drawn from its coordinates and faded where a pixel is wider.

Every pattern gives a tone (the base colour is multiplied by it), a share of the surface's second colour (mortar,
joints, leaves in the sun), a wear, and a height that says where rain collects. All of it is analytic and filtered
by the pixel's footprint, so that nothing aliases at a distance.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.noise import clamp01, hash2, noise2, noise3, unit, whole
from recipe_runtime.render.vectors import direction

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
def asphalt(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Grains of stone in tar, patches that have aged differently, and a few seams."""
    d.tone = 1.0 + 0.3 * (noise2(p[0] * 0.23, p[1] * 0.23, wp.uint32(1)) - 0.5)
    near = fade(0.5, foot)
    if near > 0.0:
        d.tone = d.tone + 0.22 * near * (noise2(p[0] * 2.1, p[1] * 2.1, wp.uint32(2)) - 0.5)
    near = fade(0.06, foot)
    if near > 0.0:
        d.tone = d.tone + 0.35 * near * (noise2(p[0] * 17.0, p[1] * 17.0, wp.uint32(4)) - 0.5)
    near = fade(0.018, foot)
    if near > 0.0:
        stone = unit(hash2(whole(p[0] * 55.0), whole(p[1] * 55.0), wp.uint32(3))) - 0.5
        d.tone = d.tone + 0.55 * near * stone
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
def leaves(d: Detail, p: wp.vec3f, foot: wp.float32, size: wp.float32) -> Detail:
    """Leaves or blades: clumps of light and shade, and a normal for each that leans its own way."""
    s = 1.0 / size
    clump = noise3(p[0] * 1.7, p[1] * 1.7, p[2] * 1.7, wp.uint32(8))
    near = fade(size, foot)
    leaf = wp.float32(0.0)
    if near > 0.0:
        leaf = noise3(p[0] * s + 3.0 * clump, p[1] * s, p[2] * s - 3.0 * clump, wp.uint32(9)) - 0.5
    twig = noise3(p[0] * 5.0, p[1] * 5.0, p[2] * 5.0, wp.uint32(10)) - 0.5
    d.tone = 0.72 + 0.5 * clump + 0.7 * twig * fade(0.2, foot) + 1.1 * leaf * near
    d.second = clamp01(clump * 1.2 - 0.35)
    lean = 0.9 * fade(0.2, foot)
    d.normal = direction(d.normal + wp.vec3f(twig * lean, (clump - 0.5) * lean, leaf * lean * near))
    return d


@wp.func
def window(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A pane with its frame, sill and a curtain; `code` names the window, `wear` is the curtain's share."""
    i = whole(uv[0])
    j = whole(uv[1])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(j)
    w = wp.max(foot, 0.004)
    side = wp.min(fu, 1.0 - fu)
    ends = wp.min(fv, 1.0 - fv)
    edge = clamp01((0.06 - wp.min(side, ends)) / w + 0.5)
    middle = fu - 0.5
    if middle < 0.0:
        middle = -middle
    cross = clamp01((0.022 - middle) / w + 0.5)
    transom = fv - 0.72
    if transom < 0.0:
        transom = -transom
    cross = wp.max(cross, clamp01((0.02 - transom) / w + 0.5))
    d.second = wp.max(edge, cross)
    d.code = hash2(i, j, d.code)
    drawn = unit(d.code * wp.uint32(747796405)) * 0.42
    d.wear = clamp01((drawn - side) / wp.max(w, 0.03) + 0.5)
    if (d.code & wp.uint32(3)) == wp.uint32(0):
        d.wear = 0.0
    d.height = fv
    return d


@wp.func
def wall(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32, grain: wp.float32) -> Detail:
    """Plaster or concrete: weather stains that run down, and a fine grain."""
    stain = noise2((p[0] + p[1]) * 0.6, p[2] * 0.17, wp.uint32(13)) - 0.5
    d.tone = 1.0 + 0.18 * stain
    near = fade(0.08, foot)
    if near > 0.0:
        fine = noise3(p[0] * 13.0, p[1] * 13.0, p[2] * 13.0, wp.uint32(14)) - 0.5
        d.tone = d.tone + grain * fine * near
    return d


@wp.func
def detail_of(
    pattern: wp.int32, uv: wp.vec2f, p: wp.vec3f, normal: wp.vec3f, footprint: wp.vec2f, surface: wp.uint32
) -> Detail:
    """The pattern at a point of the world; `footprint` is a pixel's size there, across and along the sight."""
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
        worn = noise2(p[0] * 3.1, p[1] * 3.1, wp.uint32(15)) + 0.5 * (d.tone - 1.0)
        d.second = clamp01((worn - 0.62) * 3.0) * 0.75
        d.tone = 1.0 + 0.25 * (d.tone - 1.0)
    elif pattern == BRICK:
        t = tiles(uv, 0.25, 0.083, 0.011, 0.5, foot)
        stain = noise2((p[0] + p[1]) * 0.5, p[2] * 0.3, wp.uint32(16)) - 0.5
        d.second = t[0] * 0.8
        d.tone = 1.0 + 0.42 * (t[1] - 0.5) * t[2] + 0.2 * stain
    elif pattern == PLASTER:
        d = wall(d, uv, p, foot, 0.10)
    elif pattern == CONCRETE:
        d = wall(d, uv, p, foot, 0.22)
        d.height = ground_noise(p, foot) + 0.1
    elif pattern == ROOF:
        t = tiles(uv, 0.3, 0.35, 0.02, 0.5, foot)
        d.second = t[0] * 0.5
        d.tone = 1.0 + 0.3 * (t[1] - 0.5) * t[2]
    elif pattern == FOLIAGE:
        d = leaves(d, p, foot, 0.09)
    elif pattern == GRASS:
        d = leaves(d, p, foot, 0.03)
        d.normal = normal
        d.height = ground_noise(p, foot) + 0.15
    elif pattern == BARK:
        rib = noise3(p[0] * 16.0, p[1] * 16.0, p[2] * 3.0, wp.uint32(17)) - 0.5
        d.tone = 1.0 + 0.7 * rib * fade(0.06, foot)
    elif pattern == CLOTH:
        fold = noise2(uv[0] * 5.0, uv[1] * 5.0, surface) - 0.5
        d.tone = 1.0 + 0.22 * fold
    elif pattern == HAIR:
        d.tone = 1.0 + 0.5 * (noise2(uv[0] * 40.0, uv[1] * 8.0, surface) - 0.5) * fade(0.02, foot)
    elif pattern == WINDOW:
        d = window(d, uv, foot)
    return d
