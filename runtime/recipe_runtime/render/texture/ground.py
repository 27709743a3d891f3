"""Patterns of the ground: asphalt, paving, grass, water."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, noise2, scramble, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.numeric.vectors import normalize
from recipe_runtime.render.texture.detail import Detail, fade, tiles

wp.set_module_options(OPTIONS)


@wp.func
def ground_height(p: wp.vec3f, foot: wp.float32) -> wp.float32:
    """Return the slow unevenness of the ground in world space, in [0, 1); low places collect water."""
    a = noise2(p[0] * 0.45, p[1] * 0.45, seeds.GROUND_HEIGHT)
    level = a * 0.7 + 0.15
    near = fade(0.6, foot)
    if near > 0.0:
        level = level + (noise2(p[0] * 1.7 + 5.1, p[1] * 1.7, seeds.GROUND_HEIGHT_MIDDLE) - 0.5) * 0.42 * near
    near = fade(0.16, foot)
    if near > 0.0:
        level = level + (noise2(p[0] * 6.1, p[1] * 6.1 + 2.0, seeds.GROUND_HEIGHT_FINE) - 0.5) * 0.14 * near
    return level


@wp.func
def repairs(p: wp.vec3f, foot: wp.float32) -> wp.float32:
    """Return the tone of repairs of a road: some rectangles of newer, darker asphalt with a tarred seam."""
    x = p[0] / 4.7
    y = p[1] / 7.3
    i = floor(x)
    j = floor(y)
    code = hash2(i, j, seeds.ASPHALT_REPAIR)
    tone = wp.float32(0.0)
    if unit(code) < 0.16:
        half = 0.14 + 0.24 * unit(scramble(code))
        beside = (half - wp.abs(x - wp.float32(i) - 0.5)) * 4.7
        ends = (0.36 - wp.abs(y - wp.float32(j) - 0.5)) * 7.3
        inner = minimum(beside, ends)
        w = maximum(foot, 0.01)
        seam = clamp01((0.03 - wp.abs(inner)) / w + 0.5) * clamp01(0.06 / w)
        tone = -0.1 * clamp01(inner / w + 0.5) - 0.3 * seam
    return tone


@wp.func
def asphalt(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Asphalt: grains of stone in tar, patches of different age, repairs, and fine cracks."""
    age = noise2(p[0] * 0.23, p[1] * 0.23, seeds.ASPHALT_AGE) - 0.5
    d.tone = 1.0 + 0.3 * age
    near = fade(0.5, foot)
    if near > 0.0:
        patch = noise2(p[0] * 2.1, p[1] * 2.1, seeds.ASPHALT_PATCH) - 0.5
        d.tone = d.tone + near * (0.2 * patch + repairs(p, foot))
        crack = 1.0 - wp.abs(age + 0.09 * patch - 0.06) / (0.0035 + 0.2 * foot)
        d.tone = d.tone - 0.3 * near * clamp01(crack) * clamp01(0.012 / maximum(foot, 0.004))
    near = fade(0.06, foot)
    if near > 0.0:
        d.tone = d.tone + 0.3 * near * (noise2(p[0] * 17.0, p[1] * 17.0, seeds.ASPHALT_GRAIN) - 0.5)
    near = fade(0.018, foot)
    if near > 0.0:
        stone = unit(hash2(floor(p[0] * 55.0), floor(p[1] * 55.0), seeds.ASPHALT_STONE)) - 0.5
        d.tone = d.tone + 0.5 * near * stone
    d.parameter = foot
    return d


@wp.func
def road_paint(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Paint on asphalt, worn in places: `second` is the share of visible asphalt."""
    d = asphalt(d, uv, p, foot)
    d.second = 0.13
    near = fade(0.32, foot)
    if near > 0.0:
        worn = noise2(p[0] * 3.1, p[1] * 3.1, seeds.PAINT_WEAR) + 0.5 * (d.tone - 1.0)
        d.second = 0.13 + near * (clamp01((worn - 0.62) * 3.0) * 0.75 - 0.13)
    d.tone = 1.0 + 0.25 * (d.tone - 1.0)
    return d


@wp.func
def slabs(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Paving stones with individual tones and dark joints."""
    t = tiles(uv, 0.6, 0.4, 0.012, 0.5, foot)
    d.second = t[0] * 0.75
    stain = noise2(p[0] * 0.7, p[1] * 0.7, seeds.SLAB_STAIN) - 0.5
    d.tone = 1.0 + 0.16 * (t[1] - 0.5) * t[2] + 0.16 * stain
    near = fade(0.015, foot)
    if near > 0.0:
        speck = unit(hash2(floor(uv[0] * 70.0), floor(uv[1] * 70.0), seeds.SLAB_SPECK)) - 0.5
        d.tone = d.tone + 0.14 * speck * near
    d.parameter = foot
    return d


@wp.func
def ripples(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """The surface of a basin, tilted by small waves."""
    near = fade(0.3, foot) * 0.09
    a = noise2(p[0] * 4.3, p[1] * 4.3 + 7.0, seeds.RIPPLE_X) - 0.5
    b = noise2(p[0] * 4.3 + 11.0, p[1] * 4.3, seeds.RIPPLE_Y) - 0.5
    d.normal = normalize(d.normal + wp.vec3f(a * near, b * near, 0.0))
    d.tone = 1.0 + 1.2 * near * (a + b)
    return d
