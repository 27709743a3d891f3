"""Rooms behind windows: the colours of curtains and goods, and the light of lit rooms."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.noise import unit
from recipe_runtime.render.numeric.scalars import clamp01, minimum
from recipe_runtime.render.numeric.vectors import mix, multiply

wp.set_module_options(OPTIONS)


@wp.func
def window_light_level(air: wp.array[Air], code: wp.uint32, awake: wp.float32) -> wp.float32:
    """Return a number in [0, 1) for a window that is lit at night, below 0 for a dark one."""
    h = (code ^ air[0].seed) * wp.uint32(0x9E3779B)
    h = (h ^ (h >> wp.uint32(13))) * wp.uint32(0x85EBCA7)
    chance = unit(h ^ (h >> wp.uint32(16)))
    if chance >= awake:
        return -1.0
    return chance / awake


@wp.func
def goods_colour(t: wp.float32) -> wp.vec3f:
    """Return a colour of goods in a shop window, for t in [0, 1)."""
    k = 5.0 * t
    colour = mix(wp.vec3f(0.42, 0.1, 0.07), wp.vec3f(0.5, 0.44, 0.34), clamp01(k))
    colour = mix(colour, wp.vec3f(0.1, 0.2, 0.26), clamp01(k - 1.0))
    colour = mix(colour, wp.vec3f(0.13, 0.22, 0.1), clamp01(k - 2.0))
    colour = mix(colour, wp.vec3f(0.46, 0.3, 0.07), clamp01(k - 3.0))
    return mix(colour, wp.vec3f(0.07, 0.07, 0.09), clamp01(k - 4.0))


@wp.func
def curtain_colour(t: wp.float32) -> wp.vec3f:
    """Return a colour of curtains, for t in [0, 1): most are white or cream, some green or rust."""
    colour = mix(wp.vec3f(0.5, 0.49, 0.46), wp.vec3f(0.42, 0.36, 0.27), clamp01(2.0 * t))
    colour = mix(colour, wp.vec3f(0.2, 0.24, 0.22), clamp01(8.0 * t - 5.6))
    return mix(colour, wp.vec3f(0.32, 0.15, 0.1), clamp01(8.0 * t - 7.0))


@wp.func
def window_glow(
    pattern: wp.int32,
    air: wp.array[Air],
    detail: wp.vec4f,
    code: wp.uint32,
    awake: wp.float32,
    veil: wp.vec3f,
    warm: wp.float32,
) -> wp.vec3f:
    """Return the radiance of a lit room through its window; `veil` is the colour of the curtain or the goods."""
    glow = wp.vec3f(0.0, 0.0, 0.0)
    glass = 1.0 - detail[1]
    drawn = minimum(detail[2], 1.0)
    lit_by = window_light_level(air, code, awake)
    bright = wp.float32(0.0)
    if lit_by >= 0.0 and lit_by < air[0].night:  # lights turn on one after the other at dusk
        bright = 0.6 + 0.7 * lit_by
    if pattern != Pattern.SHOP_WINDOW:
        # If many windows share a pixel, their mean is visible.
        mean = awake * air[0].night * (0.6 + 0.35 * air[0].night)
        bright = mean + (bright - mean) * detail[3]
        lit_by = 0.5 + (lit_by - 0.5) * detail[3]
    if air[0].night > 0.0 and bright > 0.0:
        colour = mix(wp.vec3f(1.0, 0.86, 0.66), mix(wp.vec3f(1.0, 0.52, 0.19), wp.vec3f(1.0, 0.78, 0.5), lit_by), warm)
        if pattern == Pattern.WINDOW:
            cool = clamp01(12.0 * unit(code * wp.uint32(1640531527)) - 10.5)
            colour = mix(colour, wp.vec3f(0.72, 0.85, 1.0), cool * detail[3])
            colour = mix(colour, multiply(colour, veil) * 2.0, 0.6 * drawn * detail[3])
        through = glass * (1.0 - 0.45 * drawn)
        if pattern == Pattern.CURTAIN_WALL:
            through = glass * (1.0 - drawn)
        elif pattern == Pattern.SHOP_WINDOW:
            colour = mix(colour, multiply(colour, veil) * 2.5, drawn)
            through = glass * 1.2
        glow = colour * (air[0].emissive_gain * 0.8e-3 * detail[0] * through * bright)
    return glow
