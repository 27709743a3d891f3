"""Clouds in two layers, their shadows on the ground, stars, and the complete sky.

A layer is noise in a plane above the town, in metres. Shadow and picture of a cloud read the same noise, so a patch of
shade lies where the cloud is seen in front of the sun.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.atmosphere.air import HALO_ROWS, Air, apply_fog, clear_sky, lookup, transmittance
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash3, noise2, smoothstep, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.numeric.vectors import dot, mix

wp.set_module_options(OPTIONS)

CUMULUS = wp.constant(wp.float32(800.0))  # height in metres
CUMULUS_SIZE = wp.constant(wp.float32(620.0))  # metres of a cell of the largest noise
CIRRUS = wp.constant(wp.float32(6000.0))
CURVATURE = wp.constant(wp.float32(0.07))  # lets the layers end at the horizon instead of at infinity
SUN_STEP = wp.constant(wp.float32(0.16))  # cells towards the sun, at which a second density tells the lit side


@wp.func
def cumulus_edge(air: wp.array[Air]) -> wp.float32:
    """Return the noise above which there is cloud."""
    return 0.80 - 0.74 * air[0].cover


@wp.func
def cumulus_mass(x: wp.float32, y: wp.float32, seed: wp.uint32) -> wp.float32:
    """Return the two largest octaves of the noise, at most 0.75; octaves are turned, which hides their lattice."""
    low = noise2(x, y, seed ^ seeds.CLOUD_LARGE)
    return low * 0.5 + noise2(1.7 * x + 1.3 * y + 7.0, 1.7 * y - 1.3 * x, seed ^ seeds.CLOUD_MIDDLE) * 0.25


@wp.func
def cumulus_detail(x: wp.float32, y: wp.float32, foot: wp.float32, seed: wp.uint32) -> wp.float32:
    """Return the smaller octaves, at most 0.25, faded where a pixel, `foot` cells wide, is wider than they."""
    n = noise2(4.6 * x - 1.1 * y, 4.6 * y + 1.1 * x, seed ^ seeds.CLOUD_SMALL)
    near = clamp01(1.5 - 12.0 * foot)
    if near > 0.0:
        n = n + near * (noise2(9.5 * x + 4.0 * y + n, 9.5 * y - 4.0 * x, seed ^ seeds.CLOUD_FINE) - 0.5) * 0.55
    near = clamp01(1.5 - 30.0 * foot)
    if near > 0.0:
        n = n + near * (noise2(27.0 * x + 9.0 * y, 27.0 * y - 9.0 * x + n, seed ^ seeds.CLOUD_FINE) - 0.5) * 0.28
    return n * 0.25


@wp.func
def cloud_shadow(air: wp.array[Air], p: wp.vec3f) -> wp.float32:
    """Return the share of sunlight that cumulus clouds leave to a point."""
    left = wp.float32(1.0)
    if air[0].cloud_shadow > 0.0:
        reach = (CUMULUS - p[2]) / maximum(air[0].sun[2] + CURVATURE, 0.1)
        x = (p[0] + air[0].sun[0] * reach - air[0].shadow_drift[0]) / CUMULUS_SIZE
        y = (p[1] + air[0].sun[1] * reach - air[0].shadow_drift[1]) / CUMULUS_SIZE
        edge = cumulus_edge(air)
        thick = smoothstep(edge - 0.02, edge + 0.12, cumulus_mass(x, y, air[0].seed) + 0.125)
        left = 1.0 - air[0].cloud_shadow * thick
    return left


@wp.func
def cumulus(air: wp.array[Air], eye: wp.vec3f, d: wp.vec3f, foot: wp.float32) -> wp.vec2f:
    """Return thickness and brightness, 0 to 1, of the lower clouds in a direction above the horizon.

    `foot` is the angle of a pixel.
    """
    rise = 1.0 / (d[2] + CURVATURE)
    x = (eye[0] + d[0] * rise * CUMULUS - air[0].drift[0]) / CUMULUS_SIZE
    y = (eye[1] + d[1] * rise * CUMULUS - air[0].drift[1]) / CUMULUS_SIZE
    edge = cumulus_edge(air)
    mass = cumulus_mass(x, y, air[0].seed)
    if mass + 0.36 <= edge:  # the details cannot lift it above the edge
        return wp.vec2f(0.0, 1.0)
    n = mass + cumulus_detail(x, y, foot * rise * rise * 1.3, air[0].seed)
    thick = smoothstep(edge, edge + 0.1, n)
    if thick <= 0.0:
        return wp.vec2f(0.0, 1.0)
    # Less cloud towards the sun lets its light through; the thickest parts show their dark base.
    sunward = cumulus_mass(x + air[0].sun[0] * SUN_STEP, y + air[0].sun[1] * SUN_STEP, air[0].seed)
    # An overcast sky is thick everywhere: it shows dark bases only where it is thickest.
    full = maximum(air[0].cover - 0.6, 0.0)
    deep = smoothstep(edge + 0.02 + 0.5 * full, edge + 0.34 + 0.8 * full, n)
    return wp.vec2f(thick, clamp01(0.78 + 3.2 * (mass - sunward) - 0.75 * deep + 1.6 * (n - mass - 0.125)))


@wp.func
def cirrus(air: wp.array[Air], d: wp.vec3f) -> wp.float32:
    """Return the opacity of the upper clouds: wisps drawn out along the wind."""
    rise = CIRRUS / ((d[2] + 1.4 * CURVATURE) * 2600.0)
    u = d[0] * rise - air[0].drift[0] * 0.0004
    v = d[1] * rise - air[0].drift[1] * 0.0004
    along = 0.32 * (0.5 * u + 0.86 * v)
    bend = noise2(0.7 * u, 0.7 * v, air[0].seed ^ seeds.CIRRUS)
    across = 0.86 * u - 0.5 * v + 1.3 * bend
    n = noise2(along, across, air[0].seed ^ seeds.CIRRUS) * 0.5 + bend * 0.2
    low = 0.6 - 0.35 * air[0].cover
    if n + 0.31 <= low:
        return 0.0
    n = n + noise2(2.3 * along + 3.0, 3.9 * across, air[0].seed ^ seeds.CIRRUS) * 0.2
    n = n + noise2(5.0 * along, 11.0 * across + bend, air[0].seed ^ seeds.CIRRUS) * 0.1
    return (0.28 + 0.4 * air[0].cover) * smoothstep(low, low + 0.4, n)


@wp.func
def starlight(air: wp.array[Air], d: wp.vec3f, foot: wp.float32) -> wp.float32:
    """Return the light of the stars in a direction: points that a pixel, `foot` radians wide, spreads over itself."""
    cells = wp.float32(60.0)
    u = d[0] / (d[2] + 0.6) * cells
    v = d[1] / (d[2] + 0.6) * cells
    i = floor(u)
    j = floor(v)
    h = hash3(i, j, 1, air[0].seed ^ seeds.STAR)
    bright = unit(h)
    bright = bright * bright
    bright = bright * bright * bright * bright
    wide = maximum(foot * cells * 0.75, 0.02)
    du = u - wp.float32(i) - 0.3 - 0.4 * unit(h * wp.uint32(0x9E3779B))
    dv = v - wp.float32(j) - 0.3 - 0.4 * unit(h * wp.uint32(0x85EBCA7))
    spot = maximum(1.0 - (du * du + dv * dv) / (wide * wide), 0.0)
    return bright * spot * minimum(0.0009 / (wide * wide), 1.0) * smoothstep(0.08, 0.55, d[2])


@wp.func
def sky(air: wp.array[Air], eye: wp.vec3f, d: wp.vec3f, foot: wp.float32) -> wp.vec3f:
    """Return the sky from `eye` along d: gradient, halo, disc, stars, clouds; `foot` is the angle of a pixel."""
    clear = clear_sky(air, d)
    c = dot(d, air[0].sun)
    clear = clear + air[0].disc * smoothstep(0.99996, 0.999985, c)
    if air[0].stars > 0.0 and d[2] > 0.08:
        clear = clear + wp.vec3f(1.0, 1.0, 1.1) * (air[0].stars * starlight(air, d, foot))
    whole_cover = smoothstep(0.6, 1.0, air[0].cover)
    if d[2] <= 0.0 or air[0].cover <= 0.0:
        return mix(clear, air[0].cloud_dark, whole_cover)
    half = c * 0.5 + 0.5
    halo = lookup(air[0].halo, half * half, HALO_ROWS)
    fading = smoothstep(0.0, 0.16, d[2])
    thin = wp.float32(0.0)
    if fading * (1.0 - whole_cover) > 0.0:
        thin = cirrus(air, d) * fading * (1.0 - whole_cover)
    clear = mix(clear, air[0].cloud_bright + halo * 0.3, thin)
    cloud = cumulus(air, eye, d, foot)
    if cloud[0] <= 0.0:
        return clear
    rim = 1.0 - cloud[0]
    bright = mix(air[0].cloud_dark, air[0].cloud_bright, clamp01(cloud[1] + 0.5 * rim * rim))
    lit = bright + halo * (0.5 * rim + 0.12 * clamp01(c) * cloud[1])
    share = cloud[0] * (fading + (1.0 - fading) * whole_cover)
    return mix(clear, lit, share)


@wp.func
def sky_through_fog(air: wp.array[Air], eye: wp.vec3f, d: wp.vec3f, foot: wp.float32) -> wp.vec3f:
    """Return the sky along a unit direction behind fog; the path is longer near the horizon. `foot`: as of `sky`."""
    far = 120.0 / (maximum(d[2], 0.0) + 0.06)
    return apply_fog(air, sky(air, eye, d, foot), d, transmittance(air, eye[2], eye[2] + d[2] * far, far))
