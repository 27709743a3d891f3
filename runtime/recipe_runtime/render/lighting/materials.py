"""Materials: the surface properties at a point, dry or wet, still or moved by wind.

Paint, glass and metal have a reflective coat; windows show a room. Water darkens porous surfaces and fills hollows of
flat ground.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.atmosphere.air import SWAY_STEPS, Air
from recipe_runtime.render.atmosphere.rooms import curtain_colour, goods_colour, window_glow
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.temporal_kernels import MAX_LEAF_DISTANCE, last_leaf_step
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import noise2, noise3, smoothstep, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import dot, mix, multiply, normalize
from recipe_runtime.render.patches.patch_kernels import PatchArrays, patch_point
from recipe_runtime.render.sampling.sample_kernels import UNKNOWN_DEPTH, Samples
from recipe_runtime.render.texture.cloth import is_cloth
from recipe_runtime.render.texture.ground import ground_height
from recipe_runtime.render.texture.images import ImageAtlas, SurfaceColours, image_at

wp.set_module_options(OPTIONS)

MAX_SOFTNESS = wp.constant(wp.float32(0.35))  # the maximum of `soft`
LEAF_DEPTH = wp.constant(wp.float32(0.45))  # metres: leaves that are nearer to a leaf do not take its sunlight
LEAF_TINT = wp.constant(wp.vec3f(0.85, 1.12, 0.36))  # of light through a leaf, relative to what it reflects
LEVEL = wp.constant(wp.float32(0.95))  # surfaces whose normal has at least this z hold water
PAVED = wp.constant(wp.float32(0.7))  # stone and concrete whose normal has at least this z is ground, not wall
MIN_DEPOSITS = wp.constant(wp.float32(0.02))  # deposits up to this form no puddle


@wp.struct
class Material:
    """The surface properties at a point."""

    albedo: wp.vec3f
    glow: wp.vec3f  # emitted radiance
    coat: wp.float32  # reflectance at normal incidence; 0: none
    gloss: wp.float32  # 1: mirror, 0: matt
    normal: wp.vec3f
    soft: wp.float32  # wrap lighting: leaves, cloth, skin
    through: wp.float32  # share of sunlight on the back that shines through: leaves
    street: wp.float32  # 1: reflects the houses across the street below the sky


@wp.func
def window_material(
    m: Material,
    pattern: wp.int32,
    air: wp.array[Air],
    first: wp.vec3f,
    second: wp.vec3f,
    detail: wp.vec4f,
    code: wp.uint32,
    awake: wp.float32,
) -> Material:
    """Return the material of a window.

    It consists of the frame and, behind the glass, a dark or lit room with a curtain, goods or a floor slab.
    """
    glass = 1.0 - detail[1]
    inside = wp.vec3f(0.034, 0.037, 0.042)
    veil = wp.vec3f(0.4, 0.38, 0.34)
    warm = wp.float32(1.0)
    leaves = clamp01(detail[2] - 1.0)
    m.coat = 0.09
    if pattern == Pattern.CURTAIN_WALL:
        veil = first * 0.8
        inside = mix(inside, first * 0.3, 0.5)
        m.coat = 0.15 * (1.0 - 0.6 * detail[2])
        warm = 0.25
    elif pattern == Pattern.SHOP_WINDOW:
        inside = wp.vec3f(0.11, 0.1, 0.09)
        veil = goods_colour(detail[3])
        warm = 0.6
    elif pattern == Pattern.WINDOW:
        veil = mix(veil, curtain_colour(unit(code * wp.uint32(1911520717))), detail[3])
        painted = mix(wp.vec3f(0.032, 0.036, 0.042), wp.vec3f(0.075, 0.058, 0.042), unit(code * wp.uint32(747796405)))
        inside = mix(inside, painted, detail[3])
        veil = mix(veil, wp.vec3f(0.06, 0.12, 0.03), leaves)
    behind = mix(inside, veil, minimum(detail[2], 1.0) * 0.85) * detail[0]
    m.albedo = mix(behind, second, detail[1])
    m.coat = m.coat * glass
    # At grazing angles the reflection follows the gloss: it falls with the share of the glass.
    m.gloss = 0.98 * wp.sqrt(glass)
    m.street = 1.0
    m.glow = window_glow(pattern, air, detail, code, awake, veil, warm)
    return m


@wp.func
def is_window(pattern: wp.int32) -> bool:
    """Return whether a surface is glass with rooms behind it."""
    glass = pattern == Pattern.WINDOW or pattern == Pattern.CURTAIN_WALL
    return glass or pattern == Pattern.SHOP_WINDOW or pattern == Pattern.FACADE


@wp.func
def coat_of(pattern: wp.int32) -> wp.vec2f:
    """Return reflectance at normal incidence and gloss of metal, lenses, water and rubber; 0 and 0 of matt surfaces."""
    if pattern == Pattern.METAL:
        return wp.vec2f(0.12, 0.6)
    elif pattern == Pattern.HEADLIGHT:
        return wp.vec2f(0.2, 0.9)
    elif pattern == Pattern.TAILLIGHT:
        return wp.vec2f(0.08, 0.9)
    elif pattern == Pattern.LENS or (pattern >= Pattern.BRAKELIGHT and pattern <= Pattern.REVERSELIGHT):
        return wp.vec2f(0.14, 0.9)
    elif pattern == Pattern.WATER:
        return wp.vec2f(0.03, 0.985)
    elif pattern == Pattern.RUBBER:
        return wp.vec2f(0.03, 0.4)
    return wp.vec2f(0.0, 0.0)


@wp.func
def material_of(
    pattern: wp.int32,
    air: wp.array[Air],
    first: wp.vec3f,
    second: wp.vec3f,
    detail: wp.vec4f,
    n: wp.vec3f,
    code: wp.uint32,
    awake: wp.float32,
) -> Material:
    """Return the dry material."""
    m = Material()
    m.normal = n
    m.albedo = mix(first, second, detail[1]) * maximum(detail[0], 0.05)
    if is_window(pattern):
        seen = window_material(m, pattern, air, first, second, detail, code, awake)
        m.albedo = seen.albedo
        m.glow = seen.glow
        m.coat = seen.coat
        m.gloss = seen.gloss
        m.street = seen.street
    elif pattern == Pattern.CAR_PAINT:
        m.coat = 0.05
        m.gloss = 0.95 - 0.5 * detail[1]
        m.street = 1.0
    elif pattern == Pattern.CABIN:
        inside = mix(wp.vec3f(0.03, 0.031, 0.033), second, detail[1]) * detail[0]
        inside = mix(inside, wp.vec3f(0.33, 0.2, 0.14), detail[2])
        m.albedo = mix(inside, wp.vec3f(0.095, 0.1, 0.105), detail[3]) * 0.85
        m.coat = 0.08
        m.gloss = 0.97
        m.street = 1.0
    elif pattern == Pattern.GLASS:
        m.albedo = first * 0.35
        m.coat = 0.09
        m.gloss = 0.97
    elif pattern == Pattern.LAMP:
        m.glow = first * (air[0].night * air[0].emissive_gain * 3.0e-2)
    elif pattern == Pattern.SIGNAL:
        m.glow = first * air[0].signal
    elif pattern == Pattern.FOLIAGE or pattern == Pattern.GRASS:
        m.soft = MAX_SOFTNESS
    elif pattern == Pattern.SKIN or is_cloth(pattern) or pattern == Pattern.HAIR:
        m.soft = 0.15
    else:
        coat = coat_of(pattern)
        m.coat = coat[0]
        m.gloss = coat[1]
    return m


@wp.func
def is_paved(pattern: wp.int32, up: wp.float32) -> bool:
    """Return whether a surface becomes wet and has puddles, as a street does; `up` is the z of its normal."""
    street = pattern == Pattern.ASPHALT or pattern == Pattern.LANES or pattern == Pattern.ROAD_PAINT
    stones = pattern == Pattern.SLABS or pattern == Pattern.SETTS or pattern == Pattern.STONE
    plates = pattern == Pattern.PLATES or pattern == Pattern.CONCRETE or pattern == Pattern.KERB
    return street or (up > PAVED and (stones or plates))


@wp.func
def puddle_depth(pattern: wp.int32, p: wp.vec3f, foot: wp.float32) -> wp.float32:
    """Return -1 minus the height of the ground, always below 0; the higher, the sooner a puddle forms."""
    height = ground_height(p, foot)
    if pattern != Pattern.ASPHALT and pattern != Pattern.LANES and pattern != Pattern.ROAD_PAINT:
        height = height + 0.1
    return -1.0 - height


@wp.func
def apply_wetness(m: Material, pattern: wp.int32, air: wp.array[Air], low: wp.float32) -> Material:
    """Wet a dry material: porous surfaces become darker and glossier, hollows of flat ground fill with water."""
    up = m.normal[2]
    if is_paved(pattern, up):
        darker = 0.52
        if pattern == Pattern.ROAD_PAINT:
            darker = 0.78
        m.albedo = m.albedo * (1.0 - (1.0 - darker) * air[0].wet)
        m.coat = 0.022 * air[0].wet
        m.gloss = 0.55 + 0.25 * air[0].wet  # a thin film follows the roughness of the surface
        if up > LEVEL and air[0].puddles > MIN_DEPOSITS:
            level = 0.88 - 0.6 * air[0].puddles
            pool = smoothstep(level - 0.03, level + 0.05, 2.0 + low) * smoothstep(MIN_DEPOSITS, 0.2, air[0].puddles)
            m.albedo = m.albedo * (1.0 - 0.45 * pool)
            m.coat = m.coat + (0.028 - m.coat) * pool
            m.gloss = m.gloss + (0.985 - m.gloss) * pool
    elif (
        pattern == Pattern.BRICK
        or pattern == Pattern.PLASTER
        or pattern == Pattern.BARK
        or pattern == Pattern.BIRCH_BARK
        or is_cloth(pattern)
        or pattern == Pattern.STONE
        or pattern == Pattern.CONCRETE
        or pattern == Pattern.PANELS
        or pattern == Pattern.KERB
        or pattern == Pattern.WOOD
        or pattern == Pattern.CLAPBOARD
    ):
        m.albedo = m.albedo * (1.0 - 0.28 * air[0].wet)
    elif pattern == Pattern.FOLIAGE or pattern == Pattern.GRASS or pattern == Pattern.ROOF:
        m.albedo = m.albedo * (1.0 - 0.2 * air[0].wet)
        m.coat = 0.012 * air[0].wet
        m.gloss = 0.4
    return m


@wp.func
def apply_wind(m: Material, air: wp.array[Air], p: wp.vec3f, near: wp.float32, step: wp.int32) -> Material:
    """Move the shading of leaves and blades to and fro, more in gusts."""
    gust = noise2(p[0] * 0.25 - air[0].gust_shift * wp.float32(step), p[1] * 0.25 + 0.3 * p[2], seeds.WIND_GUST)
    ends = air[0].sway[nonnegative((step + SWAY_STEPS) % SWAY_STEPS)]
    swing = ends[0] * (1.0 - gust) + ends[1] * gust
    leaf = noise3(p[0] * 7.0 + swing * 7.0, p[1] * 7.0 + swing * 5.0, p[2] * 7.0 - swing * 4.0, seeds.WIND_LEAF) - 0.5
    amount = air[0].leaf_motion * (0.4 + 0.6 * gust) * minimum(2.0 * near, 1.0)
    m.albedo = m.albedo * (1.0 + 0.9 * amount * leaf)
    lean = 0.7 * amount * leaf
    m.normal = normalize(wp.vec3f(m.normal[0] + lean, m.normal[1] - 0.6 * lean, m.normal[2] + 0.4 * lean))
    return m


@wp.func
def is_vehicle_lamp(pattern: wp.int32) -> bool:
    """Return whether a surface is a lamp of a vehicle."""
    running = pattern == Pattern.HEADLIGHT or pattern == Pattern.TAILLIGHT
    signal = pattern == Pattern.BRAKELIGHT or pattern == Pattern.INDICATOR or pattern == Pattern.REVERSELIGHT
    return running or signal


@wp.func
def lamp_radiance(air: wp.array[Air], pattern: wp.int32) -> wp.float32:
    """Return the radiance of a lit lamp of a vehicle, relative to its colour."""
    radiance = air[0].signal * 4.5
    if pattern == Pattern.HEADLIGHT:
        radiance = air[0].running * air[0].emissive_gain * 5.0e-2
    elif pattern == Pattern.TAILLIGHT:
        radiance = air[0].running * air[0].emissive_gain * 6.0e-3
    elif pattern == Pattern.REVERSELIGHT:
        radiance = air[0].signal * 3.0
    return radiance


@wp.func
def dry_material(
    samples: wp.array[Samples],
    colours: wp.array[SurfaceColours],
    air: wp.array[Air],
    i: wp.int32,
    surface: wp.int32,
    pattern: wp.int32,
    n: wp.vec3f,
    lit: wp.float32,
) -> Material:
    """Return the dry material of a sample, with the colours of its surface and image; `lit`: a lit vehicle lamp."""
    detail = samples[0].details[i]
    first = colours[0].first[surface]
    second = colours[0].second[surface]
    if pattern == Pattern.IMAGE:
        image = colours[0].album[0].of_surface[surface]
        if image >= 0:
            first = multiply(first, image_at(colours[0].album, image, detail, samples[0].codes[i]))
        detail = wp.vec4f(1.0, 0.0, 0.0, 0.5)
    m = material_of(pattern, air, first, second, detail, n, samples[0].codes[i], colours[0].awake[surface])
    if lit > 0.0 and is_vehicle_lamp(pattern):
        m.glow = first * (lamp_radiance(air, pattern) * maximum(detail[0], 0.3))
    m.through = wp.where(pattern == Pattern.FOLIAGE, 1.0, 0.0)
    return m


@wp.func
def weathered_material(
    samples: wp.array[Samples],
    air: wp.array[Air],
    i: wp.int32,
    pattern: wp.int32,
    phase: wp.int32,
    p: wp.vec3f,
    distance: wp.float32,
    m: Material,
) -> Material:
    """Return the material of a sample with rain and wind; `phase` is that of `swaying_phase`."""
    # (Fields are assigned one by one: a choice between two structs would go through memory.)
    if air[0].wet > 0.0:
        low = samples[0].puddle_depths[i]
        hollow = m.normal[2] > LEVEL and is_paved(pattern, m.normal[2])
        if air[0].puddles > MIN_DEPOSITS and low == UNKNOWN_DEPTH and hollow:
            low = puddle_depth(pattern, p, samples[0].details[i][3])
            samples[0].puddle_depths[i] = low  # for later frames and other weathers
        moist = apply_wetness(m, pattern, air, low)
        m.albedo = moist.albedo
        m.coat = moist.coat
        m.gloss = moist.gloss
    if phase >= 0:
        moving = apply_wind(m, air, p, 1.0 - distance / MAX_LEAF_DISTANCE, last_leaf_step(phase, air[0].leaf_step))
        m.albedo = moving.albedo
        m.normal = moving.normal
    return m


@wp.func
def light_through(air: wp.array[Air], m: Material, to_sun: wp.float32, back: wp.vec3f) -> wp.vec3f:
    """Return the light of the sun behind a leaf, as light on its front; leaves scatter most of it forwards."""
    ahead = clamp01(0.5 - 0.5 * dot(back, air[0].sun))
    return multiply(air[0].sunlight, LEAF_TINT) * (-to_sun * m.through * (0.35 + 0.75 * ahead * ahead))


@wp.func
def lay_patch(albedo: wp.vec3f, glow: wp.vec3f, shown: wp.vec3f, emission: wp.float32, coverage: wp.float32):
    """Return albedo and glow of a surface below a patch that shows a colour and covers a share of the pixel."""
    return mix(albedo, shown, coverage), glow * (1.0 - coverage) + shown * (emission * coverage)


@wp.func
def patched_material(
    patches: wp.array[PatchArrays],
    album: wp.array[ImageAtlas],
    samples: wp.array[Samples],
    i: wp.int32,
    surface: wp.int32,
    m: Material,
) -> Material:
    """Return the material of a sample with the patches on its surface, in order.

    A patch hides what is below it, also water and glass; it keeps the surface's relief.
    """
    for e in range(patches[0].first_entry[surface], patches[0].first_entry[surface + 1]):
        patch = patches[0].entries[e]
        at = patch_point(patches, patch, samples, i)
        if at.coverage > 0.0:
            shown = patches[0].colour[patch]
            if patches[0].image[patch] >= 0:
                shown = image_at(album, patches[0].image[patch], at.place, at.code)
            left = 1.0 - at.coverage
            albedo, glow = lay_patch(m.albedo, m.glow, shown, patches[0].emission[patch], at.coverage)
            m.albedo = albedo
            m.glow = glow
            m.coat = m.coat * left + patches[0].coat[patch] * at.coverage
            m.gloss = m.gloss * left + patches[0].gloss[patch] * at.coverage
            m.soft = m.soft * left
            m.street = m.street * left
    return m


@wp.func
def fresnel(coat: wp.float32, gloss: wp.float32, cosine: wp.float32) -> wp.float32:
    """Return Schlick's reflectance, reduced for rough surfaces at grazing angles."""
    m = 1.0 - clamp01(cosine)
    m2 = m * m
    return coat + (maximum(gloss * gloss * gloss, coat) - coat) * m2 * m2 * m


@wp.func
def specular(gloss: wp.float32, n: wp.vec3f, to: wp.vec3f, back: wp.vec3f) -> wp.float32:
    """Return the strength of a highlight (Trowbridge-Reitz) for light along `to` and the eye along `back`."""
    h = normalize(to + back)
    c = clamp01(dot(n, h))
    rough = 1.02 - gloss
    a = rough * rough
    k = c * c * (a * a - 1.0) + 1.0
    return minimum(a * a / (k * k) * 0.25, 60.0)
