"""Kernels that record which pixels of the HDR image a picture's samples read, with the functions of the renderer."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.camera.develop_kernels import Response
from recipe_runtime.render.camera.motion_blur_kernels import Shutter, longest_near, moments_of, shown_at_moment
from recipe_runtime.render.camera.post_process_kernels import (
    LensEffects,
    displaced,
    fringe_share,
    from_centre,
    light_of_sample,
    sample_point,
    vignette_of_sample,
)
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import nonnegative
from recipe_runtime.render.raster.distortion_kernels import Distortion, undistorted_position

wp.set_module_options(OPTIONS)


@wp.kernel
def count_moments(
    listed: wp.array[wp.int32], longest: wp.array[wp.vec2f], shutter: Shutter, out_counts: wp.array[wp.int32]
):
    """Write the number of moments of the exposure that each of the listed pixels averages."""
    k = wp.tid()
    out_counts[k] = moments_of(longest_near(nonnegative(listed[k]), longest, shutter))


@wp.kernel
def record_moments(
    listed: wp.array[wp.int32],
    firsts: wp.array[wp.int32],
    keys: wp.array[wp.uint64],
    motion: wp.array[wp.vec2f],
    longest: wp.array[wp.vec2f],
    shutter: Shutter,
    out_shown: wp.array[wp.int32],
):
    """Write the pixel whose light each of the listed pixels shows at each moment."""
    k = wp.tid()
    i = nonnegative(listed[k])
    there = longest_near(i, longest, shutter)
    moments = moments_of(there)
    for n in range(moments):
        out_shown[firsts[k] + n] = shown_at_moment(i, n, moments, there, keys, motion, shutter)


@wp.kernel
def mark_pixels(
    marks: wp.array[wp.vec3f],
    spread: wp.array[wp.vec3f],
    distortion: Distortion,
    effects: LensEffects,
    out_marks: wp.array[wp.uint8],
):
    """Write 1 for the pixels of the picture that read a pixel of the marks that is not 0."""
    i = wp.tid()
    mark = wp.uint8(0)
    for s in range(distortion.fine * distortion.fine):
        light = light_of_sample(marks, spread, sample_point(i, s, distortion), distortion, effects)
        if light[0] != 0.0 or light[1] != 0.0 or light[2] != 0.0:
            mark = wp.uint8(1)
    out_marks[i] = mark


@wp.kernel
def record_samples(
    listed: wp.array[wp.int32],
    hdr_image: wp.array[wp.vec3f],
    spread: wp.array[wp.vec3f],
    distortion: Distortion,
    effects: LensEffects,
    response: Response,
    lens_circle: wp.array[wp.float32],
    out_light: wp.array[wp.vec3f],
    out_gains: wp.array[wp.float32],
    out_points: wp.array2d[wp.vec2d],
):
    """Write light, vignette and points of the samples of the listed pixels.

    The points are those of the HDR image that a sample shows: one, or with chromatic aberration that of each channel.
    """
    q = wp.tid()
    per_pixel = distortion.fine * distortion.fine
    for s in range(per_pixel):
        k = q * per_pixel + s
        p = sample_point(listed[q], s, distortion)
        out_light[k] = light_of_sample(hdr_image, spread, p, distortion, effects)
        out_gains[k] = vignette_of_sample(p, distortion, response, lens_circle)
        if out_points.shape[1] == 1:
            out_points[k, 0] = undistorted_position(p[0], p[1], distortion)
        else:
            away = from_centre(p, distortion)
            part = fringe_share(away, distortion, effects)
            out_points[k, 0] = displaced(p, away, -part, distortion)
            out_points[k, 1] = undistorted_position(p[0], p[1], distortion)
            out_points[k, 2] = displaced(p, away, part, distortion)
