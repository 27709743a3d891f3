"""Shading: the light that leaves each sample towards the eye, after the air between.

Sun, sky, bounced light and lamps fall on a surface; a coat of paint, glass or water reflects the sky over it. Water
darkens what is porous and lies in the hollows of flat ground. Radiance is linear and relative (see `air`).
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render import pattern as patterns
from recipe_runtime.render.air import Air, ambient, reflected_sky, sky, through_air
from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.nearby import TILE, Bodies, Lamps, contact, lamp_light
from recipe_runtime.render.noise import clamp01, step_between, unit
from recipe_runtime.render.shadow import Sunbeam, holds, lit
from recipe_runtime.render.vectors import direction, inner, mix, times

wp.set_module_options(OPTIONS)

CAR_PAINT = wp.constant(int(Pattern.CAR_PAINT))
GLASS = wp.constant(int(Pattern.GLASS))
RUBBER = wp.constant(int(Pattern.RUBBER))
LAMP = wp.constant(int(Pattern.LAMP))
HEADLIGHT = wp.constant(int(Pattern.HEADLIGHT))
TAILLIGHT = wp.constant(int(Pattern.TAILLIGHT))
BLACK = wp.constant(wp.vec3f(0.0, 0.0, 0.0))


@wp.struct
class Sunlit:
    """The four shadow maps: of what stands still, fine and wide, and of what moves, fine and coarse."""

    still: Sunbeam
    still_depths: wp.array[wp.float32]
    still_used: wp.array[wp.int32]
    wide: Sunbeam
    wide_depths: wp.array[wp.float32]
    wide_used: wp.array[wp.int32]
    fine: Sunbeam
    fine_depths: wp.array[wp.float32]
    fine_used: wp.array[wp.int32]
    coarse: Sunbeam
    coarse_depths: wp.array[wp.float32]
    coarse_used: wp.array[wp.int32]


@wp.struct
class Samples:
    """The points to shade, as `samples.survey` found them."""

    surfaces: wp.array[wp.int32]
    positions: wp.array[wp.vec3f]
    normals: wp.array[wp.vec3f]
    details: wp.array[wp.vec4f]
    codes: wp.array[wp.uint32]
    pixels: wp.array[wp.int32]
    width: wp.int32
    eye: wp.vec3f


@wp.struct
class Looks:
    """Colours and kinds of the surfaces."""

    first: wp.array[wp.vec3f]  # linear albedo
    second: wp.array[wp.vec3f]
    pattern: wp.array[wp.int32]


@wp.struct
class Matter:
    """What a surface is made of at a point."""

    albedo: wp.vec3f
    glow: wp.vec3f  # emitted radiance
    coat: wp.float32  # reflectance of its gloss straight on; 0: none
    gloss: wp.float32  # 1 a mirror, 0 matt
    normal: wp.vec3f
    soft: wp.float32  # how far light wraps around: leaves, cloth, skin


@wp.func
def sunshine(s: Sunlit, sun: wp.vec3f, p: wp.vec3f, n: wp.vec3f) -> wp.float32:
    """The share of the sun that reaches a point."""
    left = float(1.0)
    if holds(s.still, p):
        left = lit(s.still, s.still_depths, s.still_used, p, n)
    else:
        left = lit(s.wide, s.wide_depths, s.wide_used, p, n)
    if left > 0.0:
        if holds(s.fine, p):
            left = wp.min(left, lit(s.fine, s.fine_depths, s.fine_used, p, n))
        else:
            left = wp.min(left, lit(s.coarse, s.coarse_depths, s.coarse_used, p, n))
    return left


@wp.func
def fresnel(coat: wp.float32, cosine: wp.float32) -> wp.float32:
    """Schlick's reflectance."""
    m = 1.0 - clamp01(cosine)
    m2 = m * m
    return coat + (1.0 - coat) * m2 * m2 * m


@wp.func
def glint(gloss: wp.float32, n: wp.vec3f, to: wp.vec3f, back: wp.vec3f) -> wp.float32:
    """A highlight's strength (Trowbridge and Reitz), for light along `to` and the eye along `back`."""
    h = direction(to + back)
    c = clamp01(inner(n, h))
    rough = 1.02 - gloss
    a = rough * rough
    k = c * c * (a * a - 1.0) + 1.0
    return wp.min(a * a / (k * k) * 0.25, 60.0)


@wp.func
def pane(m: Matter, air: Air, first: wp.vec3f, second: wp.vec3f, detail: wp.vec4f, code: wp.uint32) -> Matter:
    """A window: its frame, and behind the glass a dark or a lit room and a curtain."""
    room = mix(wp.vec3f(0.022, 0.025, 0.03), wp.vec3f(0.42, 0.4, 0.36), detail[2] * 0.8)
    m.albedo = mix(room, second, detail[1])
    m.coat = 0.09 * (1.0 - detail[1])
    m.gloss = 0.98
    h = (code ^ air.seed) * wp.uint32(0x9E3779B)
    h = (h ^ (h >> wp.uint32(13))) * wp.uint32(0x85EBCA7)
    chance = unit(h ^ (h >> wp.uint32(16)))
    if air.night > 0.0 and chance < 0.34:
        warm = mix(wp.vec3f(1.0, 0.62, 0.28), wp.vec3f(0.95, 0.86, 0.72), chance * 2.9)
        depth = 0.55 + 0.45 * detail[3] - 0.3 * detail[2]
        m.glow = warm * (air.night * 1.5e-3 * depth * (1.0 - detail[1]) * (0.5 + chance * 1.5))
    return m


@wp.func
def matter_of(
    pattern: wp.int32, air: Air, first: wp.vec3f, second: wp.vec3f, detail: wp.vec4f, n: wp.vec3f, code: wp.uint32
) -> Matter:
    """The dry material."""
    m = Matter()
    m.normal = n
    m.albedo = mix(first, second, detail[1]) * wp.max(detail[0], 0.05)
    if pattern == patterns.WINDOW:
        m = pane(m, air, first, second, detail, code)
    elif pattern == CAR_PAINT:
        m.coat = 0.05
        m.gloss = 0.94
    elif pattern == GLASS:
        m.albedo = first * 0.35
        m.coat = 0.09
        m.gloss = 0.97
    elif pattern == patterns.METAL:
        m.coat = 0.12
        m.gloss = 0.6
    elif pattern == LAMP:
        m.glow = first * (air.night * 3.0e-2)
    elif pattern == HEADLIGHT:
        m.glow = first * (air.night * 5.0e-2)
        m.coat = 0.2
        m.gloss = 0.9
    elif pattern == TAILLIGHT:
        m.glow = first * (air.night * 6.0e-3)
        m.coat = 0.08
        m.gloss = 0.9
    elif pattern == patterns.FOLIAGE or pattern == patterns.GRASS:
        m.soft = 0.35
    elif pattern == patterns.SKIN or pattern == patterns.CLOTH or pattern == patterns.HAIR:
        m.soft = 0.15
    elif pattern == RUBBER:
        m.coat = 0.03
        m.gloss = 0.4
    return m


@wp.func
def moisten(m: Matter, pattern: wp.int32, air: Air, detail: wp.vec4f) -> Matter:
    """Wet what is dry: porous stone darkens and shines, hollows of flat ground fill with water."""
    if air.wet <= 0.0:
        return m
    up = clamp01(m.normal[2])
    if pattern == patterns.ASPHALT or pattern == patterns.SLABS or pattern == patterns.ROAD_PAINT or pattern == patterns.CONCRETE:
        darker = 0.52
        if pattern == patterns.ROAD_PAINT:
            darker = 0.78
        m.albedo = m.albedo * (1.0 - (1.0 - darker) * air.wet)
        m.coat = 0.022 * air.wet
        m.gloss = 0.72
        if up > 0.95:
            level = 0.86 - 0.62 * air.puddles
            pool = step_between(level - 0.05, level + 0.07, 1.0 - detail[3]) * step_between(0.02, 0.2, air.puddles)
            m.albedo = m.albedo * (1.0 - 0.45 * pool)
            m.coat = m.coat + (0.028 - m.coat) * pool
            m.gloss = m.gloss + (0.985 - m.gloss) * pool
    elif pattern == patterns.BRICK or pattern == patterns.PLASTER or pattern == patterns.BARK or pattern == patterns.CLOTH:
        m.albedo = m.albedo * (1.0 - 0.28 * air.wet)
    elif pattern == patterns.FOLIAGE or pattern == patterns.GRASS or pattern == patterns.ROOF:
        m.albedo = m.albedo * (1.0 - 0.2 * air.wet)
        m.coat = 0.02 * air.wet
        m.gloss = 0.6
    return m


@wp.func
def mirror(air: Air, m: Matter, sight: wp.vec3f, facing: wp.float32, open_sky: wp.float32) -> wp.vec3f:
    """What a glossy surface reflects of the sky; rough ones see it from a little higher, and less of it at grazing."""
    n = m.normal
    r = sight + n * (2.0 * facing)
    rough = 1.0 - m.gloss
    d = direction(wp.vec3f(r[0], r[1], r[2] + rough * 0.6))
    seen = reflected_sky(air, d)
    share = fresnel(m.coat, facing) * (1.0 - 0.75 * rough)
    return seen * (share * open_sky)


@wp.kernel
def shade(
    samples: Samples,
    looks: Looks,
    air: Air,
    sunlit: Sunlit,
    lamps: Lamps,
    bodies: Bodies,
    lamp_lists: wp.array2d[wp.int32],
    body_lists: wp.array2d[wp.int32],
    out: wp.array[wp.vec3f],
):
    """Linear radiance of every sample."""
    i = wp.tid()
    p = samples.positions[i]
    surface = samples.surfaces[i]
    if surface < 0:
        out[i] = through_air(air, sky(air, p), samples.eye, p, 300.0 / (wp.max(p[2], 0.0) + 0.06))
        return
    n = samples.normals[i]
    pattern = looks.pattern[surface]
    detail = samples.details[i]
    to_point = p - samples.eye
    distance = wp.sqrt(inner(to_point, to_point))
    sight = to_point * (1.0 / wp.max(distance, 1.0e-4))
    facing = -inner(n, sight)
    if facing < 0.0:
        # A smoothed normal may turn away at a silhouette; bring it back to the edge.
        n = direction(n - sight * (facing * -1.0))
        facing = float(0.0)
    m = matter_of(pattern, air, looks.first[surface], looks.second[surface], detail, n, samples.codes[i])
    m = moisten(m, pattern, air, detail)
    pixel = samples.pixels[i]
    tile = (pixel / samples.width / TILE) * ((samples.width + TILE - 1) / TILE) + (pixel % samples.width) / TILE
    sky_left = contact(bodies, body_lists, tile, p, n)
    if n[2] < 0.5 and p[2] < 3.0:
        # Walls see less of the sky near the ground.
        low = 1.0 / (1.0 + wp.max(p[2], 0.0) * 2.0)
        sky_left = sky_left * (1.0 - 0.35 * low * (0.5 - n[2]))
    light = ambient(air, n) * sky_left
    shine = wp.vec3f(0.0, 0.0, 0.0)
    back = wp.vec3f(-sight[0], -sight[1], -sight[2])
    to_sun = inner(n, air.sun)
    if to_sun > -m.soft and air.sunlight[0] + air.sunlight[1] > 0.0:
        s = sunshine(sunlit, air.sun, p, n)
        wrapped = clamp01((to_sun + m.soft) / (1.0 + m.soft))
        light = light + air.sunlight * (s * wrapped)
        if m.coat > 0.0 and s > 0.0 and to_sun > 0.0:
            shine = shine + air.sunlight * (s * fresnel(m.coat, to_sun) * glint(m.gloss, n, air.sun, back) * to_sun)
    if air.night > 0.0:
        for k in range(lamp_lists[tile, 0]):
            lamp = lamp_lists[tile, k + 1]
            fall = lamp_light(lamps, lamp, p, n)
            if fall[3] > 0.0:
                to = wp.vec3f(fall[0], fall[1], fall[2])
                c = inner(n, to)
                power = lamps.power[lamp] * (fall[3] * air.night)
                light = light + power * clamp01((c + 0.12) / 1.12)
                if m.coat > 0.0 and c > 0.0:
                    shine = shine + power * (c * fresnel(m.coat, facing) * glint(m.gloss, n, to, back) * 3.0)
    radiance = times(m.albedo, light) + m.glow + shine
    if m.coat > 0.0:
        radiance = radiance + mirror(air, m, sight, facing, sky_left)
    out[i] = through_air(air, radiance, samples.eye, sight, distance)
