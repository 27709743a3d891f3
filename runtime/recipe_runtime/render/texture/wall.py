"""Patterns of walls and roofs: masonry, plaster, tiles and boards, with stains."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, noise2, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum
from recipe_runtime.render.texture.detail import Detail, fade, joint_share, tiles

wp.set_module_options(OPTIONS)


@wp.func
def apply_stains(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Add rain stains to an upright wall: streaks below its edges, and splashed dirt at its base."""
    if d.normal[2] * d.normal[2] < 0.25:
        low = clamp01(1.0 - uv[1] * 1.3)
        dirt = 0.25 * low * low
        near = fade(0.5, foot)
        if near > 0.0:
            run = noise2(uv[0] * 2.7, uv[1] * 0.28, seeds.WALL_RUN) - 0.5
            dirt = dirt * (1.0 + 0.9 * run * near) + 0.11 * near * run
        d.tone = d.tone * (1.0 - dirt)
    return d


@wp.func
def wall(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32, grain: wp.float32) -> Detail:
    """Plaster or concrete: streaks and a fine grain."""
    stain = noise2((p[0] + p[1]) * 0.6, p[2] * 0.17, seeds.WALL_STAIN) - 0.5
    d.tone = 1.0 + 0.16 * stain
    near = fade(0.08, foot)
    if near > 0.0:
        fine = noise2(uv[0] * 14.0, uv[1] * 14.0, seeds.WALL_GRAIN) - 0.5
        d.tone = d.tone + grain * fine * near
    return apply_stains(d, uv, foot)


@wp.func
def bricks(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Bricks in stretcher bond, some darker, with light mortar."""
    t = tiles(uv, 0.25, 0.083, 0.011, 0.5, foot)
    stain = noise2((p[0] + p[1]) * 0.5, p[2] * 0.3, seeds.BRICK_STAIN) - 0.5
    d.second = t[0] * 0.7
    burnt = maximum(t[1] - 0.86, 0.0) * 3.0
    d.tone = 1.0 + (0.34 * (t[1] - 0.5) - burnt + 0.03) * t[2] + 0.16 * stain
    return apply_stains(d, uv, foot)


@wp.func
def stones(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Dressed blocks with fine joints, individual tones, and a slightly darker lower edge."""
    t = tiles(uv, 0.9, 0.42, 0.014, 0.5, foot)
    d.second = t[0] * 0.75
    d.tone = 1.0 + 0.14 * (t[1] - 0.5) * t[2]
    near = fade(0.1, foot)
    if near > 0.0:
        d.tone = d.tone + 0.12 * near * (noise2(uv[0] * 11.0, uv[1] * 15.0, seeds.STONE_GRAIN) - 0.5)
    return apply_stains(d, uv, foot)


@wp.func
def roof_tiles(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Overlapping tiles, rounded across, with a shadow under the course above, and some moss."""
    t = tiles(uv, 0.24, 0.32, 0.0, 0.5, foot)
    d.tone = 1.0 + 0.26 * (t[1] - 0.5) * t[2] + 0.2 * (noise2(p[0] * 0.7, p[1] * 0.7, seeds.ROOF_MOSS) - 0.5)
    d.second = 0.8 * joint_share(uv[1] / 0.32, 0.08, foot / 0.32)
    near = fade(0.24, foot)
    if near > 0.0:
        across = uv[0] / 0.24 + 0.5 * wp.float32(floor(uv[1] / 0.32) & 1)
        round_ = wp.abs(across - wp.float32(floor(across)) - 0.5) * 2.0
        d.tone = d.tone + near * 0.3 * (0.33 - round_ * round_)
    return d


@wp.func
def boards(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Horizontal boards, each overlapping the one below, with a dark line under its edge."""
    v = uv[1] / 0.15
    course = floor(v)
    d.second = 0.7 * joint_share(v, 0.045, foot / 0.15)
    near = fade(0.15, foot)
    if near > 0.0:
        board = unit(hash2(floor(uv[0] * 0.28 + 0.37 * wp.float32(course & 3)), course, seeds.BOARD_TONE)) - 0.5
        d.tone = 1.0 + near * (0.07 * board + 0.1 * (0.5 - (v - wp.float32(course))))
    return apply_stains(d, uv, foot)


@wp.func
def planks(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Upright planks with grain."""
    u = uv[0] / 0.13
    plank = unit(hash2(floor(u), 0, seeds.PLANK_TONE)) - 0.5
    d.second = 0.8 * joint_share(u, 0.035, foot / 0.13)
    d.tone = 1.0 + 0.22 * plank * fade(0.13, foot)
    near = fade(0.03, foot)
    if near > 0.0:
        d.tone = d.tone + 0.3 * near * (noise2(uv[0] * 60.0 + 9.0 * plank, uv[1] * 2.5, seeds.PLANK_GRAIN) - 0.5)
    return d
