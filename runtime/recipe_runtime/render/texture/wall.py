"""Patterns of walls and roofs: masonry, plaster, tiles and boards, with stains."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, noise2, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum
from recipe_runtime.render.texture.detail import Detail, bevel, fade, joint_share, lean, tiles, union_share

wp.set_module_options(OPTIONS)


@wp.func
def apply_stains(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Add rain stains to an upright wall: streaks below its edges, and splashed dirt at its base."""
    if d.normal[2] * d.normal[2] < 0.25:
        low = clamp01(1.0 - uv[1] * 1.1)
        dirt = 0.28 * low * low
        near = fade(0.5, foot)
        if near > 0.0:
            run = noise2(uv[0] * 2.7, uv[1] * 0.28, seeds.WALL_RUN) - 0.5
            dirt = dirt * (1.0 + 0.9 * run * near) + 0.16 * near * run
            near = fade(0.07, foot)
            if near > 0.0:
                streak = noise2(uv[0] * 9.0, uv[1] * 0.5, seeds.WALL_STREAK)
                splash = noise2(uv[0] * 7.0, uv[1] * 7.0, seeds.WALL_SPLASH) - 0.5
                dirt = dirt + near * (0.5 * clamp01(streak - 0.72) + 0.5 * low * low * splash)
        d.tone = d.tone * (1.0 - dirt)
    return d


@wp.func
def roughen(d: Detail, uv: wp.vec2f, scale: wp.float32, slope: wp.float32, foot: wp.float32) -> Detail:
    """Tilt the normal by noise of features 1 / scale metres wide."""
    near = fade(1.0 / scale, foot)
    if near > 0.0:
        a = noise2(uv[0] * scale, uv[1] * scale, seeds.ROUGH_U) - 0.5
        c = noise2(uv[0] * scale + 0.5, uv[1] * scale + 7.3, seeds.ROUGH_V) - 0.5
        d.normal = lean(d.normal, slope * near * a, slope * near * c)
        d.tone = d.tone * (1.0 + 0.5 * slope * near * (a + c))
    return d


@wp.func
def wall(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32, grain: wp.float32) -> Detail:
    """Plaster or concrete: streaks, fine grain and roughness; `parameter` is the footprint, for ground of concrete."""
    stain = noise2((p[0] + p[1]) * 0.6, p[2] * 0.17, seeds.WALL_STAIN) - 0.5
    d.tone = 1.0 + 0.2 * stain
    near = fade(0.08, foot)
    if near > 0.0:
        blotch = noise2(uv[0] * 1.6, uv[1] * 1.6, seeds.WALL_BLOTCH) - 0.5
        fine = noise2(uv[0] * 14.0, uv[1] * 14.0, seeds.WALL_GRAIN) - 0.5
        d.tone = d.tone + (0.1 * blotch + grain * fine) * near
        d = roughen(d, uv, 55.0, 0.2, foot)
    d.parameter = foot
    return apply_stains(d, uv, foot)


@wp.func
def panels(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """A concrete wall of cast panels: joints, tones of the panels, and holes of the formwork's ties."""
    d = wall(d, uv, p, foot, 0.18)
    t = tiles(uv, 2.4, 1.2, 0.018, 0.0, foot)
    near = fade(0.03, foot)
    if near > 0.0:
        x = uv[0] / 1.2 - wp.float32(floor(uv[0] / 1.2)) - 0.5
        y = uv[1] / 1.2 - wp.float32(floor(uv[1] / 1.2)) - 0.5
        d.tone = d.tone * (1.0 - 0.6 * near * clamp01((0.014 - wp.sqrt(x * x + y * y)) * 300.0))
    d.tone = d.tone * (1.0 + 0.12 * (t[1] - 0.5) * t[2]) * (1.0 - 0.55 * t[0])
    return d


@wp.func
def bricks(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Bricks in stretcher bond, some burnt darker, some paler, set before light mortar."""
    t = tiles(uv, 0.25, 0.083, 0.011, 0.5, foot)
    stain = noise2((p[0] + p[1]) * 0.5, p[2] * 0.3, seeds.BRICK_STAIN) - 0.5
    burnt = maximum(t[1] - 0.86, 0.0) * 3.0
    pale = maximum(0.2 - t[1], 0.0) * 1.3
    d.second = maximum(t[0] * 0.7, pale * t[2])
    d.tone = 1.0 + (0.42 * (t[1] - 0.5) - burnt + 0.03) * t[2] + 0.18 * stain
    near = fade(0.06, foot)
    if near > 0.0:
        v = uv[1] / 0.083
        u = uv[0] / 0.25 + 0.5 * wp.float32(floor(v) & 1)
        fu = u - wp.float32(floor(u))
        fv = v - wp.float32(floor(v))
        tilt = 0.1 * (t[1] - 0.5)
        d.normal = lean(d.normal, near * (0.9 * bevel(fu, 0.07) + tilt), near * (0.9 * bevel(fv, 0.2) - tilt))
        d.tone = d.tone * (1.0 - 0.35 * near * clamp01(8.0 * (fv - 0.9)) * (1.0 - t[0]))
        d = roughen(d, uv, 110.0, 0.25, foot)
    return apply_stains(d, uv, foot)


@wp.func
def stones(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Dressed blocks with fine joints, individual tones, rounded edges and a rough face."""
    t = tiles(uv, 0.9, 0.42, 0.014, 0.5, foot)
    d.second = t[0] * 0.75
    d.tone = 1.0 + 0.2 * (t[1] - 0.5) * t[2]
    near = fade(0.1, foot)
    if near > 0.0:
        d.tone = d.tone + 0.14 * near * (noise2(uv[0] * 11.0, uv[1] * 15.0, seeds.STONE_GRAIN) - 0.5)
        v = uv[1] / 0.42
        u = uv[0] / 0.9 + 0.5 * wp.float32(floor(v) & 1)
        edge = 0.8 * near
        d.normal = lean(
            d.normal,
            edge * bevel(u - wp.float32(floor(u)), 0.035) + 0.04 * near * (t[1] - 0.5),
            edge * bevel(v - wp.float32(floor(v)), 0.07),
        )
        d = roughen(d, uv, 38.0, 0.25, foot)
    return apply_stains(d, uv, foot)


@wp.func
def roof_tiles(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Overlapping tiles, rounded across, with a shadow under the course above, and some moss."""
    t = tiles(uv, 0.24, 0.32, 0.0, 0.5, foot)
    d.tone = 1.0 + 0.34 * (t[1] - 0.5) * t[2] + 0.24 * (noise2(p[0] * 0.7, p[1] * 0.7, seeds.ROOF_MOSS) - 0.5)
    d.second = 0.8 * joint_share(uv[1] / 0.32, 0.08, foot / 0.32)
    near = fade(0.24, foot)
    if near > 0.0:
        across = uv[0] / 0.24 + 0.5 * wp.float32(floor(uv[1] / 0.32) & 1)
        round_ = (across - wp.float32(floor(across)) - 0.5) * 2.0
        d.tone = d.tone + near * 0.2 * (0.33 - round_ * round_)
        d.normal = lean(d.normal, -0.7 * near * round_, -0.12 * near)
    return d


@wp.func
def boards(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Horizontal boards, each leaning over the one below, with a dark line under its edge."""
    v = uv[1] / 0.15
    course = floor(v)
    d.second = 0.7 * joint_share(v, 0.045, foot / 0.15)
    near = fade(0.15, foot)
    if near > 0.0:
        along = uv[0] * 0.28 + 0.37 * wp.float32(course & 3)
        board = unit(hash2(floor(along), course, seeds.BOARD_TONE)) - 0.5
        d.tone = 1.0 + near * (0.1 * board + 0.1 * (0.5 - (v - wp.float32(course))))
        d.second = union_share(d.second, 0.5 * near * joint_share(along, 0.0012, 0.28 * foot))
        d.normal = lean(d.normal, 0.0, -0.12 * near)
        fine = fade(0.02, foot)
        if fine > 0.0:
            d.tone = d.tone + 0.1 * fine * (noise2(uv[0] * 4.0, uv[1] * 120.0, seeds.PLANK_GRAIN) - 0.5)
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
        d.normal = lean(d.normal, 0.5 * near * bevel(u - wp.float32(floor(u)), 0.08), 0.0)
    return d
