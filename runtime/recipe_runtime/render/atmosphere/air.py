"""Radiance of the sky by direction, and the attenuation and in-scattering of fog and dust."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash3, noise2, smoothstep, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import dot, mix

wp.set_module_options(OPTIONS)

DECAY_STEPS = wp.constant(1024)
DECAY_SCALE = wp.constant(wp.float32(64.0))
MAX_TABLE_DEPTH = wp.constant(wp.float32(15.9))  # beyond, e^-x is taken as 0; the tables end soon after
SKY_ROWS = wp.constant(64)
HALO_ROWS = wp.constant(256)
SWAY_STEPS = wp.constant(43)  # steps of one period of a leaf's sway


@wp.struct
class Air:
    """Light and weather of one appearance, for kernels. Radiance is relative: a clear noon sky has about 1."""

    sun: wp.vec3f  # unit, towards the sun
    sunlight: wp.vec3f  # radiance of a white surface that faces the sun
    disc: wp.vec3f  # radiance of the sun's disc
    overhead: wp.vec3f  # ambient light on surfaces that face up
    sideways: wp.vec3f  # ... that face a side
    below: wp.vec3f  # ... that face down
    cloud_bright: wp.vec3f
    cloud_dark: wp.vec3f
    cover: wp.float32  # cloud cover, 0 to 1
    drift: wp.vec2f  # offset of the cloud pattern
    stars: wp.float32  # radiance of the brightest stars
    leaf_motion: wp.float32  # amplitude of the shading of moving leaves, 0 to 1
    sway: wp.array[wp.vec2f]  # [SWAY_STEPS], offsets of their pattern in metres: sine and cosine of the sway
    gust_shift: wp.float32  # metres that gusts move per `leaf_step`
    leaf_step: wp.int32  # time in steps of 1/30 s; a leaf moves at every fourth
    fog: wp.float32  # extinction coefficient of fog, 1/m, beyond fog_start
    haze: wp.float32  # extinction coefficient of rain, dust and air, 1/m, everywhere
    fog_start: wp.float32  # metres from the camera
    fog_falloff: wp.float32  # decrease of the fog's density with height, 1/m
    fog_colour: wp.vec3f
    fog_sun: wp.vec3f  # in-scattered light added towards the sun
    glow_share: wp.float32  # share of the lamps' light that fog scatters towards the camera
    wet: wp.float32  # wetness of surfaces, 0 to 1
    puddles: wp.float32  # 0 none, 1 on all flat ground
    ring_strength: wp.float32  # tilt of the water's normal by the rings of drops
    ring_step: wp.int32  # time in steps of 1/12 s; rings change at every fourth
    night: wp.float32  # 0 by day, 1 with all lamps on
    running: wp.float32  # 0 to 1, head and tail lamps of vehicles
    emissive_gain: wp.float32  # factor of the radiance of lamps and lit windows; 1 in a clear night
    signal: wp.float32  # radiance of a traffic light
    seed: wp.uint32
    decay: wp.array[wp.float32]  # e^-x for x = i / 64
    mean_decay: wp.array[wp.float32]  # mean of e^-t over [0, x], for x = i / 64
    gradient: wp.array[wp.vec3f]  # [SKY_ROWS], clear sky by elevation, horizon first
    warm: wp.vec3f  # added near the horizon below a low sun
    halo: wp.array[wp.vec3f]  # [HALO_ROWS], added about the sun, by the angle to it, opposite first


@wp.func
def interpolate(table: wp.array[wp.float32], x: wp.float32) -> wp.float32:
    """Interpolate linearly in a table with steps of 1 / 64 from 0 on."""
    t = minimum(maximum(x, 0.0) * DECAY_SCALE, wp.float32(DECAY_STEPS - 2))
    i = nonnegative(wp.int32(t))
    low = table[i]
    return low + (table[i + 1] - low) * (t - wp.float32(i))


@wp.func
def decay(air: wp.array[Air], x: wp.float32) -> wp.float32:
    """Return e^-x for x >= 0, from a table."""
    return interpolate(air[0].decay, x)


@wp.func
def mean_decay(air: wp.array[Air], x: wp.float32) -> wp.float32:
    """Return the mean of e^-t for t from 0 to x >= 0: the mean density of fog on a path that rises through it."""
    if x > MAX_TABLE_DEPTH:
        return 1.0 / x
    return interpolate(air[0].mean_decay, x)


@wp.func
def lookup(table: wp.array[wp.vec3f], t: wp.float32, rows: wp.int32) -> wp.vec3f:
    """Interpolate linearly in a table over [0, 1]."""
    s = clamp01(t) * wp.float32(rows - 1)
    i = nonnegative(wp.min(wp.int32(s), rows - 2))
    return mix(table[i], table[i + 1], s - wp.float32(i))


@wp.func
def clear_sky(air: wp.array[Air], d: wp.vec3f) -> wp.vec3f:
    """Return the cloudless sky in a direction, without the sun's disc; below the horizon, that at the horizon."""
    up = maximum(d[2], 0.0)
    base = lookup(air[0].gradient, wp.sqrt(up), SKY_ROWS)
    c = dot(d, air[0].sun) * 0.5 + 0.5
    glow = lookup(air[0].halo, c * c, HALO_ROWS)
    low = 1.0 - 0.75 * wp.sqrt(up)
    return base + glow + air[0].warm * (c * c * c * low * low)


@wp.func
def cloud_at(air: wp.array[Air], d: wp.vec3f) -> wp.vec2f:
    """Return thickness and brightness of the clouds in a direction above the horizon, both 0 to 1."""
    s = 1.0 / (d[2] + 0.12)
    x = d[0] * s * 0.9 + air[0].drift[0]
    y = d[1] * s * 0.9 + air[0].drift[1]
    big = noise2(x, y, air[0].seed ^ seeds.CLOUD_LARGE)
    n = big * 0.52
    edge = 0.86 - 0.76 * air[0].cover
    if n + 0.48 <= edge:
        return wp.vec2f(0.0, 1.0)  # small clouds cannot lift the sum above the edge
    middle = noise2(x * 2.3 + 7.0, y * 2.3, air[0].seed ^ seeds.CLOUD_MIDDLE)
    n = n + middle * 0.27
    n = n + noise2(x * 5.1 + middle, y * 5.1 + 3.0, air[0].seed ^ seeds.CLOUD_SMALL) * 0.14
    n = n + noise2(x * 11.0, y * 11.0 + middle, air[0].seed ^ seeds.CLOUD_FINE) * 0.07
    thick = smoothstep(edge, edge + 0.22, n)
    # The side towards the sun, with less cloud in front of the light, is brighter.
    sunward = noise2(x + air[0].sun[0] * 0.2, y + air[0].sun[1] * 0.2, air[0].seed ^ seeds.CLOUD_LARGE) * 0.52
    sunward = sunward + 0.27 * noise2(
        (x + air[0].sun[0] * 0.2) * 2.3 + 7.0, (y + air[0].sun[1] * 0.2) * 2.3, air[0].seed ^ seeds.CLOUD_MIDDLE
    )
    return wp.vec2f(thick, clamp01(0.45 + 2.4 * (big * 0.52 + middle * 0.27 - sunward) - 0.5 * (n - edge - 0.2)))


@wp.func
def sky(air: wp.array[Air], d: wp.vec3f) -> wp.vec3f:
    """Return the complete sky in a direction: gradient, halo, disc, clouds, stars."""
    clear = clear_sky(air, d)
    c = dot(d, air[0].sun)
    sharp = smoothstep(0.99992, 0.99997, c)
    clear = clear + air[0].disc * sharp
    if air[0].stars > 0.0 and d[2] > 0.05:
        i = floor(d[0] / (d[2] + 0.6) * 620.0)
        j = floor(d[1] / (d[2] + 0.6) * 620.0)
        h = unit(hash3(i, j, 1, air[0].seed))
        if h > 0.9990:
            clear = clear + wp.vec3f(1.0, 1.0, 1.1) * (air[0].stars * (h - 0.9990) * 1000.0)
    if d[2] <= 0.0 or air[0].cover <= 0.0:
        return mix(clear, air[0].cloud_dark, smoothstep(0.6, 1.0, air[0].cover))
    cloud = cloud_at(air, d)
    if cloud[0] <= 0.0:
        return clear
    forward = clamp01(c)
    thin = 1.0 - cloud[0]
    bright = mix(air[0].cloud_dark, air[0].cloud_bright, clamp01(cloud[1] + thin * thin))
    lit = bright + lookup(air[0].halo, (c * 0.5 + 0.5) * (c * 0.5 + 0.5), HALO_ROWS) * (0.35 * thin + 0.15 * forward)
    haze = smoothstep(0.0, 0.22, d[2])
    whole_cover = smoothstep(0.6, 1.0, air[0].cover)
    share = cloud[0] * (haze + (1.0 - haze) * whole_cover)
    return mix(clear, lit, share)


@wp.func
def reflected_sky(air: wp.array[Air], d: wp.vec3f) -> wp.vec3f:
    """Return the sky for reflections: without small clouds; below the horizon it fades to the ground's colour."""
    clear = clear_sky(air, wp.vec3f(d[0], d[1], maximum(d[2], 0.0)))
    grey = mix(air[0].cloud_dark, air[0].cloud_bright, 0.5)
    both = mix(clear, grey, clamp01(air[0].cover))
    return mix(both, air[0].below, smoothstep(0.05, -0.15, d[2]))


@wp.func
def transmittance(air: wp.array[Air], z0: wp.float32, z1: wp.float32, distance: wp.float32) -> wp.float32:
    """Return the share of light left after `distance` metres of fog and haze between two heights (Koschmieder)."""
    path = maximum(distance - air[0].fog_start, 0.0) * air[0].fog
    if air[0].fog_falloff > 0.0 and path > 0.0:
        low = maximum(minimum(z0, z1), 0.0) * air[0].fog_falloff
        rise = (z1 - z0) * air[0].fog_falloff
        rise = maximum(rise, -rise)
        path = path * (decay(air, low) * mean_decay(air, rise))
    return decay(air, path + distance * air[0].haze)


@wp.func
def fog_veil(air: wp.array[Air], d: wp.vec3f) -> wp.vec3f:
    """Return the light of dense fog in direction d."""
    c = clamp01(dot(d, air[0].sun))
    c = c * c * c * c
    return air[0].fog_colour + air[0].fog_sun * (c * c)


@wp.func
def apply_fog(air: wp.array[Air], radiance: wp.vec3f, d: wp.vec3f, left: wp.float32) -> wp.vec3f:
    """Return the radiance in direction d behind fog that transmits the share `left`."""
    return mix(fog_veil(air, d), radiance, left)


@wp.func
def ambient(air: wp.array[Air], n: wp.vec3f) -> wp.vec3f:
    """Return the light of the sky and the ground on a surface with normal n."""
    up = n[2] >= 0.0
    t = wp.where(up, n[2], -n[2])
    a = air[0].overhead
    b = air[0].below
    end = wp.vec3f(wp.where(up, a[0], b[0]), wp.where(up, a[1], b[1]), wp.where(up, a[2], b[2]))
    return mix(air[0].sideways, end, t)
