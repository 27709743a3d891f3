"""Kernels that shade recorded samples with other textures, and develop the pixels that show them.

Slots number the samples of the pixels that change. `record_kernels` writes the inputs.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.camera.develop_kernels import (
    Response,
    inverse_tone,
    normal_deviate,
    record_levels,
    tone_mapped,
)
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.materials import lay_patch
from recipe_runtime.render.lighting.shading_kernels import SurfaceLight, surface_radiance
from recipe_runtime.render.numeric.noise import scramble
from recipe_runtime.render.numeric.scalars import minimum, nonnegative
from recipe_runtime.render.patches.patch_kernels import PatchArrays
from recipe_runtime.render.texture.images import ImageAtlas, image_at

wp.set_module_options(OPTIONS)


@wp.struct
class Recorded:
    """The patched samples, and the positions of each on its patches, from the lowest patch to the topmost."""

    slots: wp.array[wp.int32]  # [K]
    albedo: wp.array[wp.vec3f]  # [K] without patches
    glow: wp.array[wp.vec3f]  # [K] likewise
    light: wp.array[SurfaceLight]  # [K]
    firsts: wp.array[wp.int32]  # [K + 1] first index of each into the following arrays
    patches: wp.array[wp.int32]
    coverages: wp.array[wp.float32]
    places: wp.array[wp.vec4f]
    codes: wp.array[wp.uint32]


@wp.struct
class PixelSamples:
    """The pixels that change, and the inputs of their development."""

    pixels: wp.array[wp.int32]  # [Q] index in the picture
    firsts: wp.array[wp.int32]  # [Q] slot of the first sample
    counts: wp.array[wp.int32]  # [Q]
    rain: wp.array[wp.int32]  # [Q] cover by streaks of rain, 65536 is full
    streak: wp.vec3f  # radiance of a streak
    weights: wp.array[wp.float32]  # by slot


@wp.kernel
def relight(
    recorded: wp.array[Recorded],
    patches: wp.array[PatchArrays],
    album: wp.array[ImageAtlas],
    out_radiance: wp.array[wp.vec3f],
    out_shown: wp.array[wp.vec3f],
):
    """Write the radiance of each patched sample."""
    k = wp.tid()
    albedo = recorded[0].albedo[k]
    glow = recorded[0].glow[k]
    for e in range(recorded[0].firsts[k], recorded[0].firsts[k + 1]):
        patch = recorded[0].patches[e]
        shown = patches[0].colour[patch]
        if patches[0].image[patch] >= 0:
            shown = image_at(album, patches[0].image[patch], recorded[0].places[e], recorded[0].codes[e])
        albedo, glow = lay_patch(albedo, glow, shown, patches[0].emission[patch], recorded[0].coverages[e])
    radiance = surface_radiance(albedo, glow, recorded[0].light[k])
    slot = nonnegative(recorded[0].slots[k])
    out_radiance[slot] = radiance
    out_shown[slot] = radiance


@wp.kernel
def mirror_again(
    slots: wp.array[wp.int32],
    shares: wp.array[wp.float32],
    sources: wp.array[wp.int32],
    limits: wp.array[wp.vec3f],
    radiance: wp.array[wp.vec3f],
    out_shown: wp.array[wp.vec3f],
):
    """Add the reflection to slots of wet ground: the radiance of the source, at most the limit.

    For a source of -1 the limit itself is the reflected radiance.
    """
    k = wp.tid()
    slot = nonnegative(slots[k])
    shown = limits[k]
    source = sources[k]
    if source >= 0:
        most = limits[k]
        shown = radiance[nonnegative(source)]
        shown = wp.vec3f(minimum(shown[0], most[0]), minimum(shown[1], most[1]), minimum(shown[2], most[2]))
    out_shown[slot] = radiance[slot] + shown * shares[k]


@wp.kernel
def develop_listed(
    listed: wp.array[PixelSamples],
    shown: wp.array[wp.vec3f],
    responses: wp.array[Response],
    gains: wp.array[wp.float32],
    tone_table: wp.array[wp.uint8],
    deviates: wp.array[wp.float32],
    out_rgb: wp.array[wp.uint8],
):
    """Write the bytes of the listed pixels, as `develop_pixels` does."""
    q = wp.tid()
    r = responses[0]
    i = nonnegative(listed[0].pixels[q])
    gain = r.exposure * gains[i]
    colour = tone_mapped(
        listed[0].firsts[q], listed[0].counts[q], shown, listed[0].weights, listed[0].rain[q], listed[0].streak,
        gain, r.white,
    )  # fmt: skip
    record_levels(out_rgb, i, colour[0], colour[1], colour[2], r, tone_table, deviates)


@wp.kernel
def expose_listed(
    listed: wp.array[PixelSamples],
    shown: wp.array[wp.vec3f],
    response: Response,
    out_hdr_image: wp.array[wp.vec3f],
):
    """Write the listed pixels of the HDR image, as `expose_samples` does."""
    q = wp.tid()
    colour = tone_mapped(
        listed[0].firsts[q], listed[0].counts[q], shown, listed[0].weights, listed[0].rain[q], listed[0].streak,
        response.exposure, response.white,
    )  # fmt: skip
    i = nonnegative(listed[0].pixels[q])
    out_hdr_image[i] = wp.vec3f(inverse_tone(colour[0]), inverse_tone(colour[1]), inverse_tone(colour[2]))


@wp.kernel
def pixel_deviates(
    pixels: wp.array[wp.int32], key: wp.uint32, deviates: wp.array[wp.float32], out_deviates: wp.array[wp.vec3f]
):
    """Write the normal deviates of the noise of pixels, by channel, as `record_levels` draws them."""
    q = wp.tid()
    h = scramble(wp.uint32(pixels[q]) ^ key)
    out_deviates[q] = wp.vec3f(
        normal_deviate(deviates, h),
        normal_deviate(deviates, h << wp.uint32(10)),
        normal_deviate(deviates, h << wp.uint32(20)),
    )
