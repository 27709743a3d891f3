"""From an HDR image to a picture: distortion, chromatic aberration, bloom, tone mapping and noise."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.camera.develop_kernels import (
    Response,
    inverse_tone,
    record_levels,
    record_light,
    tone,
    vignette_at,
)
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


@wp.func
def sample_point(i: wp.int32, s: wp.int32, c: Distortion) -> wp.vec2d:
    """Return the point of the picture, in pixels, of sample s of pixel i."""
    step = wp.float64(1.0) / wp.float64(c.fine)
    x = wp.float64(i % c.width) + (wp.float64(s % c.fine) + wp.float64(0.5)) * step
    y = wp.float64(i / c.width) + (wp.float64(s / c.fine) + wp.float64(0.5)) * step
    return wp.vec2d(x, y)


@wp.func
def from_centre(p: wp.vec2d, c: Distortion) -> wp.vec2d:
    """Return the offset of a point of the picture from its centre, in pixels."""
    return wp.vec2d(
        p[0] - wp.float64(c.width) * wp.float64(0.5),
        p[1] - wp.float64(c.height) * wp.float64(0.5),
    )


@wp.func
def displaced(p: wp.vec2d, away: wp.vec2d, part: wp.float64, c: Distortion) -> wp.vec2d:
    """Return the point of the HDR image, in samples, of a point that is displaced by a share of its offset."""
    return undistorted_position(p[0] + away[0] * part, p[1] + away[1] * part, c)


@wp.func
def fringe_share(away: wp.vec2d, c: Distortion, f: LensEffects) -> wp.float64:
    """Return the displacement of red, inward, and of blue, outward, as a share of the offset from the centre."""
    half = wp.float64(c.width) * wp.float64(0.5)
    radius = wp.float32(wp.sqrt(away[0] * away[0] + away[1] * away[1]) / (half * c.limit))
    return wp.float64(f.fringe * wp.max(radius - f.clear, 0.0) / (1.0 - f.clear))


@wp.func
def light_of_sample(
    hdr_image: wp.array[wp.vec3f], spread: wp.array[wp.vec3f], p: wp.vec2d, c: Distortion, f: LensEffects
) -> wp.vec3f:
    """Return the light at a point of the picture, with bloom and chromatic aberration, before the vignette."""
    light = light_with_bloom(hdr_image, spread, undistorted_position(p[0], p[1], c), c, f)
    if f.fringe > 0.0:
        away = from_centre(p, c)
        part = fringe_share(away, c, f)
        outward = light_with_bloom(hdr_image, spread, displaced(p, away, -part, c), c, f)
        inward = light_with_bloom(hdr_image, spread, displaced(p, away, part, c), c, f)
        light = wp.vec3f(outward[0], light[1], inward[2])
    return light


@wp.func
def vignette_of_sample(p: wp.vec2d, c: Distortion, r: Response, lens_circle: wp.array[wp.float32]) -> wp.float32:
    """Return the gain of the vignette at a point of the picture."""
    away = from_centre(p, c)
    wide = wp.float64(c.width) * wp.float64(0.5) * wp.float64(2.0)
    return vignette_at(wp.float32(away[0] / wide), wp.float32(away[1] / wide), r, lens_circle)


@wp.func
def tone_mapped_pixel(
    i: wp.int32,
    hdr_image: wp.array[wp.vec3f],
    spread: wp.array[wp.vec3f],
    distortion: Distortion,
    effects: LensEffects,
    response: Response,
    lens_circle: wp.array[wp.float32],
) -> wp.vec3f:
    """Return the mean of a pixel's samples, each with lens effects and tone-mapped."""
    red = wp.float32(0.0)
    green = wp.float32(0.0)
    blue = wp.float32(0.0)
    for s in range(distortion.fine * distortion.fine):
        p = sample_point(i, s, distortion)
        light = light_of_sample(hdr_image, spread, p, distortion, effects)
        gain = vignette_of_sample(p, distortion, response, lens_circle)
        red = red + tone(light[0] * gain)
        green = green + tone(light[1] * gain)
        blue = blue + tone(light[2] * gain)
    share = 1.0 / wp.float32(distortion.fine * distortion.fine)
    return wp.vec3f(red * share, green * share, blue * share)


@wp.kernel
def light_of_pixels(
    hdr_image: wp.array[wp.vec3f],
    spread: wp.array[wp.vec3f],
    distortion: Distortion,
    effects: LensEffects,
    response: Response,
    lens_circle: wp.array[wp.float32],
    out_light: wp.array[wp.vec3f],
):
    """Write the light that the tone curve maps to the mean of a pixel's samples, for a sensor with a mosaic."""
    i = wp.tid()
    shown = tone_mapped_pixel(i, hdr_image, spread, distortion, effects, response, lens_circle)
    out_light[i] = wp.vec3f(inverse_tone(shown[0]), inverse_tone(shown[1]), inverse_tone(shown[2]))


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
    out_light: wp.array[wp.vec3f],
):
    """Write a pixel's three bytes: tone mapping of each sample, their mean, then noise. `out_light` may be absent."""
    i = wp.tid()
    shown = tone_mapped_pixel(i, hdr_image, spread, distortion, effects, response, lens_circle)
    record_levels(out_rgb, i, shown[0], shown[1], shown[2], response, tone_table, deviates)
    if out_light:
        record_light(out_light, i, shown[0], shown[1], shown[2], response, deviates)
