"""Shading samples: where a frame is shaded, and the geometry at each sample.

A pixel whose five coverage samples, its centre and four others, see one smooth surface is shaded once, at its centre.
At an edge, each visible surface is shaded once, weighted by the number of samples that it covers. Nothing here depends
on appearance, so all weathers share the samples. For a static camera all frames share those of the static scene: only
pixels that moving objects change get samples of their own.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.setup import BLOCK_SIZE, OPTIONS, wp
from recipe_runtime.render.numeric.scalars import maximum, nonnegative
from recipe_runtime.render.numeric.vectors import cross, dot, normalize, rotate, rotate_back
from recipe_runtime.render.raster.label_kernels import TILE, depth_of, pixel_at, triangle_of
from recipe_runtime.render.raster.skin_kernels import blended_normal
from recipe_runtime.render.raster.triangles import COLUMN_PLACES, ROW_PLACES, ROWS, place_in_pixel
from recipe_runtime.render.sampling.coverage_kernels import CENTRE, SceneArrays, group_samples, member_of
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.texture.images import order_steps, second_step, steps_between_pixels
from recipe_runtime.render.texture.patterns import detail_of
from recipe_runtime.render.texture.vehicle import is_of_vehicle

wp.set_module_options(OPTIONS)

UNKNOWN_DEPTH = wp.constant(wp.float32(0.0))  # of a sample that has not yet been shaded when wet


@wp.struct
class StaticSamples:
    """The visibility of the static scene from a pose, and its samples; none if `available` is 0."""

    coarse: wp.array[wp.uint64]
    fine: wp.array[wp.uint64]
    groups: wp.array[wp.int32]
    starts: wp.array[wp.int32]
    available: wp.int32


@wp.func
def sees_static_only(
    still: wp.array[StaticSamples],
    coarse: wp.array[wp.uint64],
    fine: wp.array[wp.uint64],
    i: wp.int32,
    base: wp.int32,
    pinhole: Pinhole,
) -> bool:
    """Return whether a pixel's centre and its samples, the first of them at `base`, see the static scene only."""
    if coarse[i] != still[0].coarse[i]:
        return False
    if pinhole.rows == ROWS:
        for row in range(ROWS):
            if fine[base + row * pinhole.width] != still[0].fine[base + row * pinhole.width]:
                return False
    return True


@wp.kernel
def restore_keys(
    tile_corners: wp.array[wp.int32], static_keys: wp.array[wp.uint64], pinhole: Pinhole, out_fine: wp.array[wp.uint64]
):
    """Reset the tiles' samples to the static scene."""
    x, y = pixel_at(tile_corners, wp.tid())
    if x >= pinhole.width or y >= pinhole.height:
        return
    at = y * ROWS * pinhole.width + x
    for _row in range(ROWS):
        out_fine[at] = static_keys[at]
        at = at + pinhole.width


@wp.kernel
def count_samples(
    tile_corners: wp.array[wp.int32],
    coarse: wp.array[wp.uint64],
    fine: wp.array[wp.uint64],
    pinhole: Pinhole,
    scene: wp.array[SceneArrays],
    static_samples: wp.array[StaticSamples],
    pixels_per_thread: wp.int32,
    out_groups: wp.array[wp.int32],
    out_starts: wp.array[wp.int32],
    out_counts: wp.array[wp.int32],
):
    """Write how many new samples each of the tiles' pixels needs, and how its coverage is grouped.

    A pixel that sees the static scene only needs none: it has samples already. Without antialiasing (one row) a pixel
    has one sample.
    """
    begin = wp.tid() * pixels_per_thread
    for place in range(begin, begin + pixels_per_thread):
        x, y = pixel_at(tile_corners, place)
        count = wp.int32(0)
        if x < pinhole.width and y < pinhole.height:
            i = nonnegative(y * pinhole.width + x)
            base = nonnegative(y * pinhole.rows * pinhole.width + x)
            if static_samples[0].available != 0 and sees_static_only(static_samples, coarse, fine, i, base, pinhole):
                out_groups[i] = static_samples[0].groups[i]
                out_starts[i] = static_samples[0].starts[i]
            else:
                g = wp.int32(1)
                if pinhole.rows == ROWS:
                    g = group_samples(coarse, i, fine, base, pinhole.width, scene)
                out_groups[i] = g
                count = g & 7
        out_counts[place] = count


@wp.kernel
def emit_samples(
    tile_corners: wp.array[wp.int32],
    coarse: wp.array[wp.uint64],
    fine: wp.array[wp.uint64],
    counts: wp.array[wp.int32],
    firsts: wp.array[wp.int32],
    pinhole: Pinhole,
    scene: wp.array[SceneArrays],
    groups: wp.array[wp.int32],
    pixels_per_thread: wp.int32,
    out_starts: wp.array[wp.int32],
    out_keys: wp.array[wp.uint64],
    out_pixels: wp.array[wp.int32],
    out_places: wp.array[wp.int32],
    out_weights: wp.array[wp.float32],
    out_tiles: wp.array[wp.int32],
):
    """Write the new samples of pixels: key, pixel, place within it, weight and tile."""
    begin = wp.tid() * pixels_per_thread
    for at in range(begin, begin + pixels_per_thread):
        n = counts[at]
        if n > 0:
            x, y = pixel_at(tile_corners, at)
            i = nonnegative(y * pinhole.width + x)
            first = nonnegative(firsts[at])
            out_starts[i] = first
            tile = (y >> 4) * ((pinhole.width + TILE - 1) >> 4) + (x >> 4)
            base = nonnegative(y * pinhole.rows * pinhole.width + x)
            for s in range(n):
                key = coarse[i]
                spot = wp.int32(CENTRE)
                weight = wp.float32(1.0)
                if n > 1:
                    spot, count = member_of(groups[i], s)
                    weight = 0.2 * wp.float32(count)
                    if spot != CENTRE:
                        key = fine[base + spot * pinhole.width]
                out_tiles[first + s] = tile
                out_pixels[first + s] = i
                out_keys[first + s] = key
                out_places[first + s] = spot
                out_weights[first + s] = weight


@wp.func
def ray_of(pixel: wp.int32, spot: wp.int32, pinhole: Pinhole) -> wp.vec3f:
    """Return the ray through a place within a pixel in view space, of depth 1 m."""
    dx = wp.float64(0.5)
    dy = wp.float64(0.5)
    if spot != CENTRE:
        dx = wp.float64(place_in_pixel(COLUMN_PLACES, spot)) / wp.float64(256.0)
        dy = wp.float64(place_in_pixel(ROW_PLACES, spot)) / wp.float64(256.0)
    x = wp.float32((wp.float64(pixel % pinhole.width) + dx - pinhole.cx) / pinhole.focal)
    y = wp.float32((wp.float64(pixel / pinhole.width) + dy - pinhole.cy) / pinhole.focal)
    return wp.vec3f(x, y, 1.0)


@wp.func
def barycentric_weights(ray: wp.vec3f, v0: wp.vec3f, v1: wp.vec3f, v2: wp.vec3f) -> wp.vec3f:
    """Return the perspective-correct barycentric weights where a ray meets a triangle.

    They are the volumes that the ray spans with the edges.
    """
    w0 = dot(ray, cross(v1, v2))
    w1 = dot(ray, cross(v2, v0))
    w2 = dot(ray, cross(v0, v1))
    # Inside the triangle all three have the sign of their sum; rounding may move a sample at an edge just outside.
    total = w0 + w1 + w2
    if total * total < 1.0e-30:  # (returning from here would take a tenth longer)
        w0 = 1.0
        total = 1.0
        w1 = 0.0
        w2 = 0.0
    one = 1.0 / total
    w0 = maximum(w0 * one, 0.0)
    w1 = maximum(w1 * one, 0.0)
    w2 = maximum(w2 * one, 0.0)
    one = 1.0 / maximum(w0 + w1 + w2, 1.0e-6)
    return wp.vec3f(w0 * one, w1 * one, w2 * one)


@wp.func
def footprint_of(face: wp.vec3f, sight: wp.vec3f, across: wp.float32) -> wp.vec2f:
    """Return a pixel's size on a surface in metres, across and along the line of sight; larger at grazing angles."""
    return wp.vec2f(across, across / maximum(-dot(face, sight), 0.04))


@wp.func
def point_seen(turned: wp.vec3f, z: wp.float32, world_from_view: wp.array2d[wp.float32]) -> wp.vec3f:
    """Return the world position at depth z on a ray of depth 1 m, whose direction is in world space."""
    m = world_from_view
    return wp.vec3f(m[0, 3] + turned[0] * z, m[0, 7] + turned[1] * z, m[0, 11] + turned[2] * z)


@wp.func
def normal_at(scene: wp.array[SceneArrays], t: wp.vec3i, w: wp.vec3f, part: wp.int32) -> wp.vec3f:
    """Return the normal in the world, not of unit length, at the weights w of the corners of a triangle."""
    n = scene[0].normals[t[0]] * w[0] + scene[0].normals[t[1]] * w[1] + scene[0].normals[t[2]] * w[2]
    if part != 0:  # the static scene is in the world's frame already
        if scene[0].vertex_skin[t[0]] < 0:
            n = rotate(scene[0].world_from_part, part, n)
        else:
            n = wp.vec3f(0.0, 0.0, 0.0)
            for k in range(3):
                row = scene[0].vertex_skin[t[k]]
                own = scene[0].normals[t[k]] * w[k]
                parts = scene[0].skin_parts[row]
                n = n + blended_normal(scene[0].world_from_part, parts, scene[0].skin_weights[row], own)
    return n


@wp.func
def image_steps(scene: wp.array[SceneArrays], t: wp.vec3i, ray: wp.vec3f, focal: wp.float32, uv: wp.vec2f) -> wp.vec4f:
    """Return the steps of an image's coordinates between pixels, on a triangle; the longer one first."""
    view = scene[0].view
    uvs = scene[0].uvs
    return order_steps(
        steps_between_pixels(ray, focal, view[t[0]], view[t[1]], view[t[2]], uvs[t[0]], uvs[t[1]], uvs[t[2]], uv)
    )


@wp.kernel(launch_bounds=(BLOCK_SIZE, 5))  # limits registers, so that 5 blocks run at once
def evaluate_samples(
    first_sample: wp.int32,
    keys: wp.array[wp.uint64],
    pixels: wp.array[wp.int32],
    places: wp.array[wp.int32],
    pinhole: Pinhole,
    scene: wp.array[SceneArrays],
    out_surfaces: wp.array[wp.int32],
    out_positions: wp.array[wp.vec3f],
    out_normals: wp.array[wp.vec3f],
    out_details: wp.array[wp.vec4f],
    out_codes: wp.array[wp.uint32],
    out_puddle_depths: wp.array[wp.float32],
):
    """Write surface, world position, unit normal and pattern of samples; for the sky, -1 and a direction."""
    i = nonnegative(first_sample + wp.tid())
    pixel = pixels[i]
    if pixel < 0:  # an unused slot
        return
    key = keys[i]
    spot = places[i]
    ray = ray_of(pixel, spot, pinhole)
    turned = rotate(scene[0].world_from_view, 0, ray)
    if key == wp.uint64(0):
        out_surfaces[i] = -1
        out_positions[i] = normalize(turned)
        return
    z = wp.float32(depth_of(key, pinhole.near))
    out_positions[i] = point_seen(turned, z, scene[0].world_from_view)
    triangle = triangle_of(key)
    t = scene[0].triangles[triangle]
    t = wp.vec3i(nonnegative(t[0]), nonnegative(t[1]), nonnegative(t[2]))
    surface = nonnegative(scene[0].triangle_surface[triangle])
    out_surfaces[i] = surface
    w = barycentric_weights(ray, scene[0].view[t[0]], scene[0].view[t[1]], scene[0].view[t[2]])
    uv = scene[0].uvs[t[0]] * w[0] + scene[0].uvs[t[1]] * w[1] + scene[0].uvs[t[2]] * w[2]
    part = nonnegative(scene[0].vertex_part[t[0]])
    face = scene[0].face_normals[triangle]
    if part != 0:
        face = rotate(scene[0].world_from_part, part, face)
    local = normal_at(scene, t, w, part)
    sight = normalize(turned)
    focal = wp.float32(pinhole.focal)
    footprint = footprint_of(face, sight, z / focal)
    pattern = scene[0].surface_pattern[surface]
    place = out_positions[i]
    if is_of_vehicle(pattern) and part != 0:  # its patterns move with it
        m = scene[0].world_from_part
        place = rotate_back(m, part, place - wp.vec3f(m[part, 3], m[part, 7], m[part, 11]))
        sight = rotate_back(m, part, sight)
    detail = detail_of(pattern, uv, place, normalize(local), sight, footprint, wp.uint32(surface))
    out_normals[i] = detail.normal
    out_details[i] = wp.vec4f(detail.tone, detail.second, detail.wear, detail.parameter)
    out_codes[i] = detail.code
    out_puddle_depths[i] = UNKNOWN_DEPTH
    if pattern == Pattern.IMAGE:
        steps = image_steps(scene, t, ray, focal, uv)
        out_details[i] = wp.vec4f(uv[0], uv[1], steps[0], steps[1])
        out_codes[i] = second_step(steps)


@wp.struct
class Samples:
    """The samples to shade, as `evaluate_samples` writes them."""

    surfaces: wp.array[wp.int32]
    positions: wp.array[wp.vec3f]
    normals: wp.array[wp.vec3f]
    details: wp.array[wp.vec4f]
    codes: wp.array[wp.uint32]
    puddle_depths: wp.array[wp.float32]  # what `puddle_depth` returns, or UNKNOWN_DEPTH; `shade_samples` writes it
    pixels: wp.array[wp.int32]
    tiles: wp.array[wp.int32]  # of `nearby`
    keys: wp.array[wp.uint64]
    world_from_part: wp.array2d[wp.float32]  # this and the next two are for patches
    world_from_view: wp.array2d[wp.float32]
    focal: wp.float32  # pixels
    eye: wp.vec3f
