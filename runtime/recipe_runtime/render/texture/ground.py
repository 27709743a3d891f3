"""Patterns of the ground: asphalt, paving, grass, water."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, noise2, scramble, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.numeric.vectors import normalize
from recipe_runtime.render.texture.detail import Detail, bevel, fade, joint_share, lean, tiles

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
def aggregate(d: Detail, x: wp.float32, y: wp.float32, foot: wp.float32, size: wp.float32, seed: wp.uint32) -> Detail:
    """Add a layer of round stones, one anywhere in each cell of a lattice `size` metres wide."""
    near = fade(size, foot)
    if near > 0.0:
        i = floor(x / size)
        j = floor(y / size)
        code = hash2(i, j, seed)
        radius = 0.16 + 0.26 * unit(scramble(code))
        fx = x / size - wp.float32(i) - radius - (1.0 - 2.0 * radius) * unit(code)
        fy = y / size - wp.float32(j) - radius - (1.0 - 2.0 * radius) * unit(code * wp.uint32(747796405))
        dome = clamp01(3.0 - 3.0 * (fx * fx + fy * fy) / (radius * radius))
        d.tone = d.tone + near * (dome * (0.9 * unit(code * wp.uint32(1403630843)) - 0.3) - 0.04)
        slope = -0.8 * dome * near
        d.normal = lean(d.normal, slope * fx, slope * fy)
    return d


@wp.func
def asphalt(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Asphalt: stones in tar, patches of different age, repairs, and cracks."""
    age = noise2(p[0] * 0.23, p[1] * 0.23, seeds.ASPHALT_AGE) - 0.5
    d.tone = 1.0 + 0.3 * age
    near = fade(0.5, foot)
    if near > 0.0:
        patch = noise2(p[0] * 2.1, p[1] * 2.1, seeds.ASPHALT_PATCH) - 0.5
        d.tone = d.tone + near * (0.2 * patch + repairs(p, foot))
        crack = 1.0 - wp.abs(age + 0.09 * patch - 0.06) / (0.0035 + 0.2 * foot)
        d.tone = d.tone - 0.4 * near * clamp01(crack) * clamp01(0.012 / maximum(foot, 0.004))
    near = fade(0.06, foot)
    if near > 0.0:
        d.tone = d.tone + 0.26 * near * (noise2(p[0] * 17.0, p[1] * 17.0, seeds.ASPHALT_GRAIN) - 0.5)
        d = aggregate(d, 0.8 * p[0] - 0.6 * p[1], 0.6 * p[0] + 0.8 * p[1], foot, 0.026, seeds.ASPHALT_CHIPPINGS)
        d = aggregate(d, 0.92 * p[0] + 0.39 * p[1], 0.92 * p[1] - 0.39 * p[0], foot, 0.011, seeds.ASPHALT_STONE)
    d.parameter = foot
    return d


@wp.func
def lanes(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Asphalt of lanes, darker and smoother where wheels run, with oil in the middle; `wear` is the polish."""
    d = asphalt(d, p, foot)
    at = uv[1] - wp.float32(floor(uv[1])) - 0.5
    beside = wp.abs(at) - 0.24
    middle = clamp01(1.0 - 60.0 * at * at)
    near = fade(1.1, foot)
    run = 0.5 + near * (noise2(uv[0] * 0.11, 3.0 * uv[1], seeds.LANE_RUN) - 0.5)
    wheel = 0.319 + near * (clamp01(1.0 - 70.0 * beside * beside) - 0.319)
    oil = 0.138 + near * (middle * middle - 0.138)
    d.wear = wheel * (0.4 + 0.6 * run)
    d.tone = d.tone * (1.0 - 0.17 * d.wear) - 0.16 * oil * run
    near = fade(0.12, foot)
    if near > 0.0:
        drip = noise2(uv[0] * 1.9, uv[1] * 11.0, seeds.LANE_DRIP)
        d.tone = d.tone - near * (0.5 * middle * clamp01(5.0 * drip - 4.0) + 0.07 * wheel * (drip - 0.5))
    return d


@wp.func
def road_paint(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Paint on asphalt, worn in places: `second` is the share of visible asphalt."""
    d = asphalt(d, p, foot)
    d.second = 0.13
    near = fade(0.32, foot)
    if near > 0.0:
        worn = noise2(p[0] * 3.1, p[1] * 3.1, seeds.PAINT_WEAR) + 0.35 * (d.tone - 1.0)
        d.second = 0.13 + near * (clamp01((worn - 0.6) * 4.0) * 0.8 - 0.13)
    d.tone = 1.0 + 0.25 * (d.tone - 1.0)
    return d


@wp.func
def soil(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Add what a pavement collects: stains, and spots of gum."""
    d.tone = d.tone + 0.18 * (noise2(p[0] * 0.7, p[1] * 0.7, seeds.SLAB_STAIN) - 0.5)
    near = fade(0.12, foot)
    if near > 0.0:
        spill = noise2(p[0] * 2.3, p[1] * 2.3, seeds.SLAB_SPILL)
        d.tone = d.tone - 0.3 * near * clamp01(4.0 * spill - 3.0)
    near = fade(0.05, foot)
    if near > 0.0:
        i = floor(p[0] * 3.1)
        j = floor(p[1] * 3.1)
        code = hash2(i, j, seeds.GUM)
        if unit(code) < 0.25:
            x = p[0] * 3.1 - wp.float32(i) - 0.1 - 0.8 * unit(scramble(code))
            y = p[1] * 3.1 - wp.float32(j) - 0.1 - 0.8 * unit(code * wp.uint32(747796405))
            spot = clamp01((0.055 + 0.05 * unit(code * wp.uint32(1403630843)) - wp.sqrt(x * x + y * y)) * 40.0)
            d.tone = d.tone * (1.0 - 0.22 * spot * near)
        speck = unit(hash2(floor(p[0] * 90.0), floor(p[1] * 90.0), seeds.SLAB_SPECK)) - 0.5
        d.tone = d.tone + 0.16 * speck * fade(0.015, foot)
    d.parameter = foot
    return d


@wp.func
def paving(
    d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32, size: wp.vec2f, gap: wp.float32, bond: wp.float32
) -> Detail:
    """Stones or plates of a size in metres: individual tones and tilts, rounded edges, dark joints, and stains."""
    t = tiles(uv, size[0], size[1], gap, bond, foot)
    d.second = t[0] * 0.75
    d.tone = 1.0 + 0.3 * (t[1] - 0.5) * t[2]
    near = fade(0.5 * size[1], foot)
    if near > 0.0:
        v = uv[1] / size[1]
        u = uv[0] / size[0] + bond * wp.float32(floor(v) & 1)
        edge = 0.25 * fade(6.0 * gap, foot)
        tilt = 0.02 * near * (t[1] - 0.5)
        d.normal = lean(
            d.normal,
            tilt + edge * bevel(u - wp.float32(floor(u)), 2.5 * gap / size[0]),
            edge * bevel(v - wp.float32(floor(v)), 2.5 * gap / size[1]) - tilt,
        )
    return soil(d, p, foot)


@wp.func
def kerb(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Kerb stones, one metre of u each, scraped and dirty near the road; v is the height."""
    d.second = 0.8 * joint_share(uv[0], 0.007, foot)
    stone = unit(hash2(floor(uv[0]), 0, seeds.TILE_TONE)) - 0.5
    d.tone = 1.0 + 0.2 * stone * fade(1.0, foot)
    if d.normal[2] < 0.5:
        d.tone = d.tone - 0.25 * clamp01(1.0 - 9.0 * uv[1])
    return soil(d, p, foot)


@wp.func
def ripples(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """The surface of a basin, tilted by small waves."""
    near = fade(0.3, foot) * 0.09
    a = noise2(p[0] * 4.3, p[1] * 4.3 + 7.0, seeds.RIPPLE_X) - 0.5
    b = noise2(p[0] * 4.3 + 11.0, p[1] * 4.3, seeds.RIPPLE_Y) - 0.5
    d.normal = normalize(d.normal + wp.vec3f(a * near, b * near, 0.0))
    d.tone = 1.0 + 1.2 * near * (a + b)
    return d
