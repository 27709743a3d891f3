"""Shading: the radiance from each sample towards the eye, including the air between.

Sun, sky, indirect light and lamps illuminate a surface (see `materials`); a coat of paint, glass or water reflects the
sky. Radiance is linear and relative (see `Air`).
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.atmosphere.air import (
    Air,
    ambient,
    apply_fog,
    decay,
    fog_veil,
    reflected_sky,
    transmittance,
)
from recipe_runtime.render.atmosphere.clouds import cloud_shadow, sky
from recipe_runtime.render.device.setup import BLOCK_SIZE, OPTIONS, wp
from recipe_runtime.render.lighting.fog_glow_kernels import add_glow
from recipe_runtime.render.lighting.materials import (
    LEAF_DEPTH,
    LEVEL,
    MAX_SOFTNESS,
    Material,
    dry_material,
    fresnel,
    light_through,
    patched_material,
    specular,
    weathered_material,
)
from recipe_runtime.render.lighting.temporal_kernels import (
    AT_REST,
    LEAF,
    SKY,
    TOUCHED,
    DirtySamples,
    PreviousFrame,
    dirty_sample,
    mark_dirty,
    swaying_phase,
)
from recipe_runtime.render.lighting.tile_list_kernels import (
    STATIC_LAMPS,
    UNSHADOWED,
    Bodies,
    Lamps,
    contact_occlusion,
    is_lamp_light_known,
    lamp_light,
    lamp_shadow,
    lamps_shadowed,
    may_be_shadowed,
)
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import noise2, smoothstep
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import dot, mix, multiply, normalize
from recipe_runtime.render.patches.patch_kernels import PatchArrays
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.shadows.shadow_kernels import Sunbeam, moving_shadow, sun_share
from recipe_runtime.render.shadows.sky_grid_kernels import BOUNCE, sky_share
from recipe_runtime.render.texture.images import SurfaceColours

wp.set_module_options(OPTIONS)


@wp.func
def is_light_unchanged(
    previous: wp.array[PreviousFrame],
    air: wp.array[Air],
    beams: wp.array[Sunbeam],
    lamps: wp.array[Lamps],
    bodies: wp.array[Bodies],
    lamp_lists: wp.array2d[wp.int32],
    body_lists: wp.array2d[wp.int32],
    reuse_class: wp.uint8,
    tile: wp.int32,
    pattern: wp.int32,
    p: wp.vec3f,
    n: wp.vec3f,
) -> bool:
    """Return whether a static sample's light equals that of the earlier frame: no moving object affects it."""
    if reuse_class == TOUCHED:
        return False
    bits = previous[0].tiles[tile]
    if contact_occlusion(bodies, body_lists, tile, p, n) < 1.0:
        return False
    if air[0].night > 0.0:
        if (bits & 2) == 0:
            return False
        if (bits & UNSHADOWED) == 0 and lamps_shadowed(lamps, lamp_lists, tile, lamp_lists[tile, 0], bits, p, n):
            return False
    if air[0].glow_share > 0.0 and (bits & 4) == 0:
        return False
    away = dot(n, air[0].sun) <= -MAX_SOFTNESS and pattern != Pattern.FOLIAGE  # (the sun shines through leaves)
    if air[0].sunlight[0] + air[0].sunlight[1] <= 0.0 or away:
        return True
    return moving_shadow(beams, p, n) == 1.0


@wp.func
def sky_reflection(
    air: wp.array[Air], m: Material, p: wp.vec3f, sight: wp.vec3f, facing: wp.float32, open_sky: wp.float32
) -> wp.vec3f:
    """Return the sky that a glossy surface reflects; rough surfaces reflect a higher part, and less when grazing."""
    n = m.normal
    r = sight + n * (2.0 * facing)
    rough = 1.0 - m.gloss
    d = normalize(wp.vec3f(r[0], r[1], r[2] + rough * 0.6))
    seen = reflected_sky(air, d)
    if m.street > 0.0:
        roofs = 0.2 + 0.25 * noise2(d[0] * 5.0 + p[0] * 0.04, d[1] * 5.0 + p[1] * 0.04, seeds.SKYLINE)
        seen = seen * (0.3 + 0.7 * smoothstep(roofs - 0.02, roofs + 0.02, d[2]))
    share = fresnel(m.coat, m.gloss, facing) * (1.0 - 0.5 * rough)
    return seen * (share * open_sky)


@wp.func
def sky_through_fog(air: wp.array[Air], eye: wp.vec3f, d: wp.vec3f, foot: wp.float32) -> wp.vec3f:
    """Return the sky along a unit direction behind fog; the path is longer near the horizon. `foot`: as of `sky`."""
    far = 160.0 / (maximum(d[2], 0.0) + 0.06)
    return apply_fog(air, sky(air, eye, d, foot), d, transmittance(air, eye[2], eye[2] + d[2] * far, far))


@wp.func
def add_sun(air: wp.array[Air], beams: wp.array[Sunbeam], m: Material, p: wp.vec3f, back: wp.vec3f, light: wp.vec3f):
    """Add the sun to the light on a point; return also its highlight, and the share that moving objects leave."""
    to_sun = dot(m.normal, air[0].sun)
    left = wp.float32(0.0)
    past = wp.float32(1.0)
    mirroring = wp.float32(0.0)
    if (to_sun > -m.soft or m.through > 0.0) and air[0].sunlight[0] + air[0].sunlight[1] > 0.0:
        reached = sun_share(beams, p + air[0].sun * (LEAF_DEPTH * m.through), m.normal)
        shaded = wp.float32(0.0)
        if reached[0] > 0.0:
            shaded = reached[0] * cloud_shadow(air, p)
        past = reached[1]
        if m.through > 0.0 and to_sun < 0.0:
            light = light + light_through(air, m, to_sun, back) * shaded
        left = shaded * clamp01((to_sun + m.soft) / (1.0 + m.soft))
        if m.coat > 0.0 and reached[0] > 0.0 and to_sun > 0.0:
            bright = specular(m.gloss, m.normal, air[0].sun, back)
            mirroring = shaded * fresnel(m.coat, m.gloss, to_sun) * bright * to_sun
    return light + air[0].sunlight * left, air[0].sunlight * mirroring, past


@wp.func
def add_lamps(
    air: wp.array[Air],
    previous: wp.array[PreviousFrame],
    lamps: wp.array[Lamps],
    lists: wp.array2d[wp.int32],
    i: wp.int32,
    tile: wp.int32,
    phase: wp.int32,
    m: Material,
    p: wp.vec3f,
    n: wp.vec3f,
    back: wp.vec3f,
    facing: wp.float32,
):
    """Return light and highlights of a tile's lamps, in order, on a point with geometric normal n.

    Return also the smallest share of a lamp that moving objects leave. The light of static lamps on sample i is read
    from the earlier frame or, if the sample is cached, kept for later ones.
    """
    light = wp.vec3f(0.0, 0.0, 0.0)
    shine = wp.vec3f(0.0, 0.0, 0.0)
    past = wp.float32(1.0)
    first = wp.int32(0)
    static_count = lists[tile, STATIC_LAMPS]
    count = lists[tile, 0]
    bits = wp.int32(-1)
    if i < previous[0].shared_count:
        bits = previous[0].tiles[tile]
    if is_lamp_light_known(air, previous, lamps, lists, i, tile, phase, p, n):
        first = static_count
        light = previous[0].lamp_light[i]
        shine = previous[0].lamp_shine[i]
    for k in range(first, count + 1):
        if k == static_count and k > first and i < previous[0].kept_count:
            previous[0].lamp_light[i] = light
            previous[0].lamp_shine[i] = shine
            previous[0].lamp_known[i] = wp.where(past < 1.0, wp.uint8(0), wp.uint8(1))
        lamp = lists[tile, k + 1]
        fall = wp.vec4f(0.0, 0.0, 1.0, 0.0)
        if k < count:
            fall = lamp_light(lamps, lamp, p, m.normal)
        if fall[3] > 0.0:
            to = wp.vec3f(fall[0], fall[1], fall[2])
            c = dot(m.normal, to)
            reached = wp.vec2f(1.0, 1.0)
            if k < static_count or may_be_shadowed(lamps[0].shadow[lamp], bits):
                reached = lamp_shadow(lamps, lamp, p, n, to)
            past = minimum(past, reached[1])
            power = lamps[0].power[lamp] * (fall[3] * air[0].night * reached[0])
            light = light + power * clamp01((c + 0.12) / 1.12)
            if m.coat > 0.0 and c > 0.0:
                mirroring = c * fresnel(m.coat, m.gloss, facing) * specular(m.gloss, m.normal, to, back) * 3.0
                shine = shine + power * mirroring
    return light, shine, past


@wp.func
def write_light(
    air: wp.array[Air],
    i: wp.int32,
    radiance: wp.vec3f,
    mirrored: wp.float32,
    gloss: wp.float32,
    out_radiance: wp.array[wp.vec3f],
    out_mirror: wp.array[wp.vec2f],
    out_shown: wp.array[wp.vec3f],
):
    """Write a sample's light and its mirror reflection; `reflect` writes what is reflected."""
    out_mirror[i] = wp.vec2f(mirrored, gloss)
    out_radiance[i] = radiance
    if air[0].wet > 0.0 and mirrored <= 0.0:
        out_shown[i] = radiance


@wp.struct
class SurfaceLight:
    """What turns a surface's albedo and glow into the radiance that reaches the eye."""

    light: wp.vec3f  # on the surface
    shine: wp.vec3f  # of the sun and the lamps that it mirrors
    sky: wp.vec3f  # that it mirrors
    veil: wp.vec3f  # of fog
    left: wp.float32  # share that the fog transmits
    glow: wp.vec3f  # of lamps in the air before it


@wp.func
def surface_radiance(albedo: wp.vec3f, glow: wp.vec3f, lit: SurfaceLight) -> wp.vec3f:
    """Return the radiance of a surface, except for what wet ground mirrors."""
    seen = mix(lit.veil, multiply(albedo, lit.light) + lit.shine + lit.sky, lit.left)
    # Drops diffract half of what they extinguish by less than a degree: that of a lamp still arrives.
    return seen + glow * wp.sqrt(lit.left) + lit.glow


@wp.func
def facing_eye(to_point: wp.vec3f, n: wp.vec3f):
    """Return distance, line of sight, normal, and the cosine between the last two, which is not negative."""
    distance = wp.sqrt(dot(to_point, to_point))
    sight = to_point * (1.0 / maximum(distance, 1.0e-4))
    facing = -dot(n, sight)
    if facing < 0.0:
        # At a silhouette a smoothed normal may point away from the eye: move it to the edge.
        n = normalize(n - sight * (facing * -1.0))
        facing = wp.float32(0.0)
    return distance, sight, n, facing


@wp.func
def light_surface(
    air: wp.array[Air],
    beams: wp.array[Sunbeam],
    lamps: wp.array[Lamps],
    bodies: wp.array[Bodies],
    lamp_lists: wp.array2d[wp.int32],
    body_lists: wp.array2d[wp.int32],
    glow_lists: wp.array2d[wp.int32],
    previous: wp.array[PreviousFrame],
    i: wp.int32,
    tile: wp.int32,
    phase: wp.int32,
    m: Material,
    eye: wp.vec3f,
    p: wp.vec3f,
    n: wp.vec3f,
    sight: wp.vec3f,
    distance: wp.float32,
    facing: wp.float32,
):
    """Return the light on a sample of a surface, the share of its mirror reflection, and its reuse class."""
    lit = SurfaceLight()
    free = contact_occlusion(bodies, body_lists, tile, p, n)
    visible = free * sky_share(bodies[0].sky, p, n)
    back = wp.vec3f(-sight[0], -sight[1], -sight[2])
    light, shine, past = add_sun(
        air, beams, m, p, back, ambient(air, n) * visible + air[0].below * (BOUNCE * (free - visible))
    )
    rest = AT_REST
    if phase >= 0:
        rest = LEAF + wp.uint8(phase)
    if air[0].night > 0.0:
        from_lamps, shine_of_lamps, left = add_lamps(
            air, previous, lamps, lamp_lists, i, tile, phase, m, p, n, back, facing
        )
        light = light + from_lamps
        shine = shine + shine_of_lamps
        past = minimum(past, left)
    reuse_class = wp.where(past < 1.0 or free < 1.0, TOUCHED, rest)
    lit.light = light
    lit.shine = shine
    lit.left = transmittance(air, eye[2], p[2], distance) * decay(air, distance * air[0].clear_air)
    mirrored = wp.float32(0.0)
    if air[0].wet > 0.0 and n[2] > LEVEL and m.coat > 0.0:
        mirrored = fresnel(m.coat, m.gloss, facing) * free * lit.left
    elif m.coat > 0.0:
        lit.sky = sky_reflection(air, m, p, sight, facing, free)
    lit.veil = fog_veil(air, sight)
    lit.glow = add_glow(air, lamps, glow_lists, tile, eye, sight, distance, wp.vec3f(0.0, 0.0, 0.0))
    return lit, mirrored, reuse_class


@wp.func
def shade_surface(
    samples: wp.array[Samples],
    colours: wp.array[SurfaceColours],
    patches: wp.array[PatchArrays],
    air: wp.array[Air],
    beams: wp.array[Sunbeam],
    lamps: wp.array[Lamps],
    bodies: wp.array[Bodies],
    lamp_lists: wp.array2d[wp.int32],
    body_lists: wp.array2d[wp.int32],
    glow_lists: wp.array2d[wp.int32],
    previous: wp.array[PreviousFrame],
    i: wp.int32,
    tile: wp.int32,
    surface: wp.int32,
    pattern: wp.int32,
    phase: wp.int32,
    p: wp.vec3f,
    n: wp.vec3f,
    to_point: wp.vec3f,
):
    """Return the radiance of a sample of a surface, share and gloss of its mirror reflection, and its reuse class."""
    distance, sight, n, facing = facing_eye(to_point, n)
    m = dry_material(samples, colours, air, i, surface, pattern, n, lamps[0].lit[surface])
    m = weathered_material(samples, air, i, pattern, phase, p, distance, m)
    if patches[0].count > 0:
        m = patched_material(patches, colours[0].album, samples, i, surface, m)
    lit, mirrored, reuse_class = light_surface(
        air, beams, lamps, bodies, lamp_lists, body_lists, glow_lists, previous,
        i, tile, phase, m, samples[0].eye, p, n, sight, distance, facing,
    )  # fmt: skip
    return surface_radiance(m.albedo, m.glow, lit), mirrored, m.gloss, reuse_class


@wp.kernel(launch_bounds=(BLOCK_SIZE, 4))  # limits registers, so that 4 blocks run at once
def shade_samples(
    samples: wp.array[Samples],
    colours: wp.array[SurfaceColours],
    patches: wp.array[PatchArrays],
    air: wp.array[Air],
    beams: wp.array[Sunbeam],
    lamps: wp.array[Lamps],
    bodies: wp.array[Bodies],
    lamp_lists: wp.array2d[wp.int32],
    body_lists: wp.array2d[wp.int32],
    glow_lists: wp.array2d[wp.int32],
    previous: wp.array[PreviousFrame],
    dirty: wp.array[DirtySamples],
    out_radiance: wp.array[wp.vec3f],
    out_mirror: wp.array[wp.vec2f],
    out_reuse_class: wp.array[wp.uint8],
    out_shown: wp.array[wp.vec3f],
):
    """Write the linear radiance of every dirty sample.

    `reflect` adds the reflection on wet ground by `out_mirror`, its share and gloss; if anything is wet, samples
    without one are written to `out_shown` unchanged. `collect_dirty` reads `out_reuse_class` in a later frame.
    """
    i = dirty_sample(dirty, wp.tid())
    tile = samples[0].tiles[i]
    if tile < 0:  # an unused slot
        return
    tile = nonnegative(tile)
    eye = samples[0].eye
    p = samples[0].positions[i]
    surface = samples[0].surfaces[i]
    if surface < 0:
        mark_dirty(previous, samples[0].pixels[i])
        out_reuse_class[i] = SKY
        beyond = sky_through_fog(air, eye, p, 1.0 / samples[0].focal)
        seen = add_glow(air, lamps, glow_lists, tile, eye, p, 1000.0, beyond)
        write_light(air, i, seen, 0.0, 0.0, out_radiance, out_mirror, out_shown)
        return
    n = samples[0].normals[i]
    to_point = p - eye
    surface = nonnegative(surface)
    pattern = colours[0].pattern[surface]
    phase = swaying_phase(air, pattern, p, to_point)
    # (Always shaded: leaves, which the wind may have moved, and the few normals that point away from the eye.)
    if (
        i < previous[0].shared_count
        and phase < 0
        and dot(n, to_point) <= 0.0
        and is_light_unchanged(
            previous, air, beams, lamps, bodies, lamp_lists, body_lists, out_reuse_class[i], tile, pattern, p, n
        )
    ):
        return
    mark_dirty(previous, samples[0].pixels[i])
    seen, mirrored, gloss, reuse_class = shade_surface(
        samples, colours, patches, air, beams, lamps, bodies, lamp_lists, body_lists, glow_lists, previous,
        i, tile, surface, pattern, phase, p, n, to_point,
    )  # fmt: skip
    out_reuse_class[i] = reuse_class
    write_light(air, i, seen, mirrored, gloss, out_radiance, out_mirror, out_shown)
