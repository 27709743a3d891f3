"""Patterns of plants: leaves, bark, and lawns."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, noise2, noise3, scramble, smoothstep, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum
from recipe_runtime.render.numeric.vectors import normalize
from recipe_runtime.render.texture.detail import Detail, fade

wp.set_module_options(OPTIONS)


@wp.func
def hole(t: wp.float32) -> wp.float32:
    """Return 1 in the gaps between leaves, where noise in [-0.5, 0.5) is lowest."""
    return clamp01(-0.6 - 7.0 * t)


@wp.func
def crown(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Leaves: sprays of different green, dark gaps, and less sky light inside and below the crown."""
    bough = (noise3(p[0] * 1.3, p[1] * 1.3, p[2] * 1.6, seeds.LEAF_BOUGH) - 0.5) * fade(1.5, foot)
    hue = uv[0] * fade(0.5, foot)
    tone = 1.0 + 0.25 * bough + 0.3 * hue
    d.second = clamp01(0.35 + 0.9 * bough + 0.7 * hue)
    near = fade(0.22, foot)
    if near > 0.0:
        twig = noise3(p[0] * 6.3, p[1] * 6.3, p[2] * 7.1, seeds.LEAF_TWIG) - 0.5
        tone = tone + 0.35 * twig * near
        lean = 0.5 * near
        d.normal = normalize(d.normal + wp.vec3f(twig * lean, bough * lean, -0.5 * twig * lean))
        near = fade(0.07, foot)
        if near > 0.0:
            leaf = noise3(p[0] * 19.0, p[1] * 19.0, p[2] * 23.0, seeds.LEAF) - 0.5
            tone = tone + (0.55 * leaf - 0.12 * hole(leaf + 0.3 * twig)) * near
            d.second = clamp01(d.second + 0.5 * leaf * near)
            d.normal = normalize(d.normal + wp.vec3f(0.6 * leaf * near, -0.5 * leaf * near, 0.8 * leaf * near))
            close = fade(0.03, foot)
            if close > 0.0:
                edge = noise3(p[0] * 61.0, p[1] * 61.0, p[2] * 67.0, seeds.LEAF_EDGE) - 0.5
                tone = tone + (0.6 * edge - 0.15 * hole(edge + 0.4 * leaf)) * close
                d.normal = normalize(d.normal + wp.vec3f(0.7 * edge * close, 0.6 * edge * close, -0.5 * edge * close))
    d.tone = maximum(tone, 0.2) * (0.22 + 0.78 * uv[1])
    return d


@wp.func
def bark(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Bark with ribs along the trunk, furrows between them, and lichen on some sides."""
    lichen = noise3(p[0] * 1.7, p[1] * 1.7, p[2] * 0.9, seeds.BARK_LICHEN) - 0.5
    d.tone = 1.0 + 0.35 * lichen * fade(0.8, foot)
    near = fade(0.06, foot)
    if near > 0.0:
        rib = noise3(p[0] * 22.0, p[1] * 22.0, p[2] * 3.4, seeds.BARK_RIB) - 0.5
        d.tone = d.tone + (0.06 + 0.7 * rib - 0.35 * clamp01(-0.3 - 4.0 * rib)) * near
        tilt = 0.7 * rib * near
        d.normal = normalize(d.normal + wp.vec3f(-tilt * d.normal[1], tilt * d.normal[0], 0.3 * tilt))
        close = fade(0.02, foot)
        if close > 0.0:
            flake = noise3(p[0] * 70.0, p[1] * 70.0, p[2] * 21.0, seeds.BARK_FLAKE) - 0.5
            d.tone = d.tone + 0.45 * flake * close
            d.normal = normalize(d.normal + wp.vec3f(-flake * d.normal[1], flake * d.normal[0], 0.4 * flake) * close)
    d.tone = maximum(d.tone, 0.25)
    return d


@wp.func
def birch_bark(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """White bark with dark marks across the trunk, and a dark, furrowed base."""
    old = clamp01(1.0 - p[2] * 0.9) * 0.6
    near = fade(0.12, foot)
    mark = wp.float32(0.27)
    if near > 0.0:
        dash = noise3(p[0] * 5.0, p[1] * 5.0, p[2] * 19.0, seeds.BARK_RIB)
        scar = noise3(p[0] * 9.0, p[1] * 9.0, p[2] * 6.0, seeds.BARK_LICHEN)
        mark = mark + (maximum(smoothstep(0.66, 0.76, dash), smoothstep(0.74, 0.8, scar)) - mark) * near
    d.tone = (1.0 - 0.75 * maximum(mark, old * (0.5 + mark))) * 1.04
    return d


@wp.func
def daisies(p: wp.vec3f, foot: wp.float32) -> wp.float32:
    """Return the share of a pixel that white flowers cover; at most one in a cell of 14 cm."""
    i = floor(p[0] * 7.1)
    j = floor(p[1] * 7.1)
    code = hash2(i, j, seeds.DAISY)
    if unit(code) > 0.3:
        return 0.0
    code = scramble(code)
    x = p[0] * 7.1 - wp.float32(i) - 0.2 - 0.6 * unit(code)
    y = p[1] * 7.1 - wp.float32(j) - 0.2 - 0.6 * unit(scramble(code))
    r = 0.09 - wp.sqrt(x * x + y * y)
    return clamp01(r / (7.1 * maximum(foot, 0.002)) + 0.5)


@wp.func
def mown(p: wp.vec3f, foot: wp.float32) -> wp.float32:
    """Return the tone of a mower's lanes, which bend the blades to and fro, in [-0.5, 0.5]."""
    t = p[0] * 0.9 + p[1] * 0.05
    wave = wp.abs(t - wp.float32(floor(t)) - 0.5) * 2.0  # 0 at the middle of a lane, 1 between lanes
    side = wp.float32(1 - 2 * (floor(t) & 1))
    return 0.5 * side * smoothstep(1.0, 0.75, wave) * fade(1.1, foot)


@wp.func
def lawn(d: Detail, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Grass: dry and lush areas, lanes of a mower, clover, tufts, daisies, and single blades at close range."""
    field = noise2(p[0] * 0.06 + 3.0, p[1] * 0.06, seeds.LAWN_AREA) - 0.5
    patch = (noise2(p[0] * 0.37, p[1] * 0.37, seeds.GRASS_FIELD) - 0.5) * fade(2.5, foot)
    d.tone = 0.95 + 0.2 * field + 0.28 * patch
    d.second = clamp01(0.25 + 0.5 * field + 0.55 * patch)
    near = fade(0.5, foot)
    if near > 0.0:
        tuft = noise2(p[0] * 2.3, p[1] * 2.3, seeds.GRASS_TUFT) - 0.5
        clover = smoothstep(0.12, 0.3, noise2(p[0] * 0.9, p[1] * 0.9, seeds.CLOVER) - 0.5 + 0.35 * tuft) * near
        d.tone = d.tone + 0.2 * tuft * near - 0.16 * clover + 0.1 * mown(p, foot) * clamp01(0.7 + 3.0 * field)
        d.second = clamp01(d.second + 0.4 * tuft * near) * (1.0 - 0.7 * clover)
        near = fade(0.09, foot)
        if near > 0.0:
            clump = noise2(p[0] * 13.0, p[1] * 13.0, seeds.GRASS_BLADE) - 0.5
            d.tone = d.tone + 0.4 * near * clump
            lean = 0.6 * near * clump
            d.normal = normalize(d.normal + wp.vec3f(lean, -0.7 * lean, 0.0))
            near = fade(0.04, foot)
            if near > 0.0:
                turn = 0.4 * p[0] + 2.0 * tuft
                a = noise2((p[0] + 0.3 * p[1]) * 120.0, (p[1] - 0.3 * p[0]) * 22.0 + turn, seeds.GRASS_BLADE_FINE) - 0.5
                b = noise2((p[0] - 0.4 * p[1]) * 26.0, (p[1] + 0.4 * p[0]) * 110.0 + turn, seeds.GRASS_CROSSED) - 0.5
                blade = maximum(a, b)
                d.tone = d.tone + 0.9 * near * (blade - 0.12)
                d.normal = normalize(d.normal + wp.vec3f(a, b, 0.0) * (0.8 * near))
                if patch > -0.1:
                    d.tone = d.tone + 3.0 * near * daisies(p, foot) * clamp01(6.0 * (patch + 0.1))
    d.tone = maximum(d.tone, 0.25)
    return d


@wp.func
def is_plant(pattern: wp.int32) -> bool:
    """Return whether a pattern is one of this module."""
    wood = pattern == Pattern.BARK or pattern == Pattern.BIRCH_BARK
    return wood or pattern == Pattern.FOLIAGE or pattern == Pattern.GRASS


@wp.func
def plant(d: Detail, pattern: wp.int32, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Return the pattern of a plant at a point of the world."""
    if pattern == Pattern.FOLIAGE:
        return crown(d, uv, p, foot)
    elif pattern == Pattern.GRASS:
        return lawn(d, p, foot)
    elif pattern == Pattern.BARK:
        return bark(d, p, foot)
    return birch_bark(d, p, foot)
