"""Kernels that record the patched samples of a frame, so that they can be shaded again with other textures.

They call the functions of `shading_kernels` and `reflection_kernels` up to the point at which a texture is read.
`relight_kernels` continues from there, and gives the same bits as shading the samples from the start.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.materials import dry_material, patched_material, weathered_material
from recipe_runtime.render.lighting.reflection_kernels import brightest_mirrored, light_beyond_picture, mirrored_view
from recipe_runtime.render.lighting.shading_kernels import SurfaceLight, facing_eye, light_surface
from recipe_runtime.render.lighting.temporal_kernels import PreviousFrame, swaying_phase
from recipe_runtime.render.lighting.tile_list_kernels import Bodies, Lamps
from recipe_runtime.render.numeric.noise import floor
from recipe_runtime.render.numeric.scalars import nonnegative
from recipe_runtime.render.patches.patch_kernels import PatchArrays, patch_point
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.shadows.shadow_kernels import Sunbeam
from recipe_runtime.render.texture.images import ImageAtlas, SurfaceColours, tap_at, tap_line, wrap_texel

wp.set_module_options(OPTIONS)


@wp.kernel
def count_points(
    listed: wp.array[wp.int32],
    samples: wp.array[Samples],
    patches: wp.array[PatchArrays],
    out_counts: wp.array[wp.int32],
):
    """Write the number of patches that cover each of the listed samples."""
    k = wp.tid()
    i = nonnegative(listed[k])
    surface = samples[0].surfaces[i]
    found = wp.int32(0)
    if surface >= 0:
        for e in range(patches[0].first_entry[surface], patches[0].first_entry[surface + 1]):
            at = patch_point(patches, patches[0].entries[e], samples, i)
            if at.coverage > 0.0:
                found = found + 1
    out_counts[k] = found


@wp.kernel
def record_points(
    listed: wp.array[wp.int32],
    firsts: wp.array[wp.int32],
    samples: wp.array[Samples],
    patches: wp.array[PatchArrays],
    out_patches: wp.array[wp.int32],
    out_coverages: wp.array[wp.float32],
    out_places: wp.array[wp.vec4f],
    out_codes: wp.array[wp.uint32],
):
    """Write the position of each listed sample on the patches that cover it, from the lowest patch to the topmost."""
    k = wp.tid()
    i = nonnegative(listed[k])
    surface = samples[0].surfaces[i]
    here = firsts[k]
    for e in range(patches[0].first_entry[surface], patches[0].first_entry[surface + 1]):
        patch = patches[0].entries[e]
        at = patch_point(patches, patch, samples, i)
        if at.coverage > 0.0:
            out_patches[here] = patch
            out_coverages[here] = at.coverage
            out_places[here] = at.place
            out_codes[here] = at.code
            here = here + 1


@wp.kernel
def record_light(
    listed: wp.array[wp.int32],
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
    out_albedo: wp.array[wp.vec3f],
    out_glow: wp.array[wp.vec3f],
    out_light: wp.array[SurfaceLight],
):
    """Write albedo and glow that the listed samples have without patches, and the light on them."""
    k = wp.tid()
    i = nonnegative(listed[k])
    p = samples[0].positions[i]
    n = samples[0].normals[i]
    eye = samples[0].eye
    to_point = p - eye
    surface = nonnegative(samples[0].surfaces[i])
    pattern = colours[0].pattern[surface]
    phase = swaying_phase(air, pattern, p, to_point)
    distance, sight, n, facing = facing_eye(to_point, n)
    m = dry_material(samples, colours, air, i, surface, pattern, n, lamps[0].lit[surface])
    m = weathered_material(samples, air, i, pattern, phase, p, distance, m)
    out_albedo[k] = m.albedo
    out_glow[k] = m.glow
    m = patched_material(patches, colours[0].album, samples, i, surface, m)
    lit, _mirrored, _reuse_class = light_surface(
        air, beams, lamps, bodies, lamp_lists, body_lists, glow_lists, previous,
        i, nonnegative(samples[0].tiles[i]), phase, m, eye, p, n, sight, distance, facing,
    )  # fmt: skip
    out_light[k] = lit


@wp.kernel
def record_mirrors(
    listed: wp.array[wp.int32],
    samples: wp.array[Samples],
    air: wp.array[Air],
    mirror: wp.array[wp.vec2f],
    reach: wp.array[wp.float32],
    depth: wp.array[wp.float32],
    starts: wp.array[wp.int32],
    view_from_world: wp.array2d[wp.float32],
    pinhole: Pinhole,
    out_sources: wp.array[wp.int32],
    out_limits: wp.array[wp.vec3f],
):
    """Write the sample that each listed sample of wet ground reflects, and the limit of its radiance.

    If the reflected ray leaves the picture, the sample is -1 and the limit is the reflected radiance itself.
    """
    k = wp.tid()
    i = nonnegative(listed[k])
    gloss = mirror[i][1]
    d, hit = mirrored_view(samples, air, i, gloss, reach, depth, view_from_world, pinhole)
    if hit[0] >= 0:
        out_sources[k] = starts[nonnegative(hit[0])]
        out_limits[k] = brightest_mirrored(air, gloss)
    else:
        out_sources[k] = -1
        out_limits[k] = light_beyond_picture(air, d)


@wp.kernel
def count_taps(
    album: wp.array[ImageAtlas],
    places: wp.array[wp.vec4f],
    codes: wp.array[wp.uint32],
    out_counts: wp.array[wp.int32],
):
    """Write the number of texels of image 0 that are read for each place; a texel read twice counts twice."""
    k = wp.tid()
    line = tap_line(album, 0, places[k], codes[k])
    out_counts[k] = line.count * wp.where(line.finer > 0.0, 8, 4)


@wp.func
def write_tap(
    album: wp.array[ImageAtlas],
    level: wp.int32,
    x: wp.float32,
    y: wp.float32,
    weight: wp.float64,
    at: wp.int32,
    out_texels: wp.array[wp.int32],
    out_weights: wp.array[wp.float64],
):
    """Write the four texels that `bilinear` reads, and their weights."""
    ix = floor(x - 0.5)
    iy = floor(y - 0.5)
    fx = wp.float64(x - 0.5 - wp.float32(ix))
    fy = wp.float64(y - 0.5 - wp.float32(iy))
    repeats = album[0].repeats[0]
    w = album[0].widths[level]
    left = wrap_texel(ix, w, repeats)
    right = wrap_texel(ix + 1, w, repeats)
    top = album[0].starts[level] + wrap_texel(iy, album[0].heights[level], repeats) * w
    low = album[0].starts[level] + wrap_texel(iy + 1, album[0].heights[level], repeats) * w
    one = wp.float64(1.0)
    out_texels[at] = top + left
    out_weights[at] = weight * (one - fx) * (one - fy)
    out_texels[at + 1] = top + right
    out_weights[at + 1] = weight * fx * (one - fy)
    out_texels[at + 2] = low + left
    out_weights[at + 2] = weight * (one - fx) * fy
    out_texels[at + 3] = low + right
    out_weights[at + 3] = weight * fx * fy


@wp.kernel
def record_taps(
    album: wp.array[ImageAtlas],
    places: wp.array[wp.vec4f],
    codes: wp.array[wp.uint32],
    firsts: wp.array[wp.int32],
    out_texels: wp.array[wp.int32],
    out_weights: wp.array[wp.float64],
):
    """Write the texels, of all levels of image 0, that `image_at` reads for each place, and their weights."""
    k = wp.tid()
    line = tap_line(album, 0, places[k], codes[k])
    repeats = album[0].repeats[0]
    here = firsts[k]
    share = wp.float64(1.0) / wp.float64(line.count)
    finer = wp.float64(line.finer)
    for tap in range(line.count):
        at = tap_at(line, places[k], repeats, tap)
        own = share * (wp.float64(1.0) - finer)
        write_tap(album, line.level, at[0], at[1], own, here, out_texels, out_weights)
        here = here + 4
        if line.finer > 0.0:
            write_tap(album, line.level + 1, at[0] * 0.5, at[1] * 0.5, share * finer, here, out_texels, out_weights)
            here = here + 4
