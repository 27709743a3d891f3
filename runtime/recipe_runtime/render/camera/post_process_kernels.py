"""From an HDR image to a picture: distortion, chromatic aberration, bloom, tone mapping and noise."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.camera.develop_kernels import Response, record_levels, tone, vignette_at
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.raster.distortion_kernels import Distortion, undistorted_position

wp.set_module_options(OPTIONS)


@wp.struct
class LensEffects:
    """Chromatic aberration and bloom."""

    fringe: wp.float32  # displacement of red and blue at the corners, as a share of the radius
    clear: wp.float32  # radius, 1 at the corners, within which there is none
    bloom: wp.float32  # share of the light that bloom spreads
    coarse: wp.int32  # samples of the HDR image along the side of a sample of the bloom image


@wp.func
def bilinear(hdr_image: wp.array[wp.vec3f], px: wp.float64, py: wp.float64, wide: wp.int32, high: wp.int32) -> wp.vec3f:
    """Interpolate an image bilinearly at a point, in samples; beyond its border the nearest sample counts."""
    x = wp.min(wp.max(px - wp.float64(0.5), wp.float64(0.0)), wp.float64(wide - 1))
    y = wp.min(wp.max(py - wp.float64(0.5), wp.float64(0.0)), wp.float64(high - 1))
    i = wp.int32(x)
    j = wp.int32(y)
    fx = wp.float32(x - wp.float64(i))
    fy = wp.float32(y - wp.float64(j))
    k = wp.min(i + 1, wide - 1)
    below = wp.min(j + 1, high - 1)
    a = hdr_image[j * wide + i]
    b = hdr_image[j * wide + k]
    c = hdr_image[below * wide + i]
    d = hdr_image[below * wide + k]
    top = a + (b - a) * fx
    foot = c + (d - c) * fx
    return top + (foot - top) * fy


@wp.func
def light_with_bloom(
    hdr_image: wp.array[wp.vec3f], spread: wp.array[wp.vec3f], p: wp.vec2d, c: Distortion, f: LensEffects
) -> wp.vec3f:
    """Return the light at a point of the HDR image, in samples, with bloom."""
    light = bilinear(hdr_image, p[0], p[1], c.wide, c.high)
    if f.bloom > 0.0:
        scale = wp.float64(1.0) / wp.float64(f.coarse)
        wide = (c.wide + f.coarse - 1) / f.coarse
        high = (c.high + f.coarse - 1) / f.coarse
        light = light + (bilinear(spread, p[0] * scale, p[1] * scale, wide, high) - light) * f.bloom
    return light


@wp.kernel
def finish_pixels(
    hdr_image: wp.array[wp.vec3f],
    spread: wp.array[wp.vec3f],
    distortion: Distortion,
    effects: LensEffects,
    response: Response,
    lens_circle: wp.array[wp.float32],
    tone_table: wp.array[wp.uint8],
    deviates: wp.array[wp.float32],
    out_rgb: wp.array[wp.uint8],
):
    """Write a pixel's three bytes: tone mapping of each sample, their mean, then noise."""
    i = wp.tid()
    step = wp.float64(1.0) / wp.float64(distortion.fine)
    red = wp.float32(0.0)
    green = wp.float32(0.0)
    blue = wp.float32(0.0)
    half = wp.float64(distortion.width) * wp.float64(0.5)
    middle = wp.float64(distortion.height) * wp.float64(0.5)
    for s in range(distortion.fine * distortion.fine):
        x = wp.float64(i % distortion.width) + (wp.float64(s % distortion.fine) + wp.float64(0.5)) * step
        y = wp.float64(i / distortion.width) + (wp.float64(s / distortion.fine) + wp.float64(0.5)) * step
        dx = x - half
        dy = y - middle
        light = light_with_bloom(hdr_image, spread, undistorted_position(x, y, distortion), distortion, effects)
        if effects.fringe > 0.0:
            radius = wp.float32(wp.sqrt(dx * dx + dy * dy) / (half * distortion.limit))
            part = wp.float64(effects.fringe * wp.max(radius - effects.clear, 0.0) / (1.0 - effects.clear))
            outward = light_with_bloom(
                hdr_image, spread, undistorted_position(x - dx * part, y - dy * part, distortion), distortion, effects
            )
            inward = light_with_bloom(
                hdr_image, spread, undistorted_position(x + dx * part, y + dy * part, distortion), distortion, effects
            )
            light = wp.vec3f(outward[0], light[1], inward[2])
        gain = vignette_at(
            wp.float32(dx / (half * wp.float64(2.0))), wp.float32(dy / (half * wp.float64(2.0))), response, lens_circle
        )
        red = red + tone(light[0] * gain)
        green = green + tone(light[1] * gain)
        blue = blue + tone(light[2] * gain)
    share = 1.0 / wp.float32(distortion.fine * distortion.fine)
    record_levels(out_rgb, i, red * share, green * share, blue * share, response, tone_table, deviates)
