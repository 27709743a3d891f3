"""Evaluation of patches: which patches cover a sample, by how much, and at which texture coordinates.

A sample is on a patch if the patch is on its surface and its point, in the frame of its part, projects onto one of the
patch's faces. The projection gives the texture coordinates; their derivatives by pixel follow from the plane of the
sample's triangle. So a patch needs no geometry, and its edges are antialiased analytically.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import dot, rotate
from recipe_runtime.render.raster.label_kernels import depth_of, triangle_of
from recipe_runtime.render.sampling.coverage_kernels import CENTRE, SceneArrays
from recipe_runtime.render.sampling.sample_kernels import Samples, point_seen, ray_of
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.texture.images import bounded, order_steps, second_step

wp.set_module_options(OPTIONS)

MIN_FACING = wp.constant(wp.float32(0.35))  # minimum cosine between the normals of a triangle and a rectangle on it
GRAZING = wp.constant(wp.float32(0.04))  # minimum cosine to the view for the size of a footprint, as on other surfaces


@wp.struct
class PatchArrays:
    """The patches of an appearance, P of them with F faces, on S surfaces.

    On surface s are the patches entries[first_entry[s]] .. entries[first_entry[s + 1] - 1]; each covers the one before
    it. Patch k has the faces first_face[k] .. first_face[k + 1] - 1.
    """

    count: wp.int32
    first_entry: wp.array[wp.int32]  # [S + 1]
    entries: wp.array[wp.int32]
    first_face: wp.array[wp.int32]  # [P + 1]
    whole: wp.array[wp.int32]  # [P] 1: a triangle shows the face that it faces most, without the face's edges
    image: wp.array[wp.int32]  # [P] index in the atlas; -1: a colour
    colour: wp.array[wp.vec3f]  # [P] linear
    emission: wp.array[wp.float32]  # [P] radiance of white
    coat: wp.array[wp.float32]  # [P]
    gloss: wp.array[wp.float32]  # [P]
    part: wp.array[wp.int32]  # [F] 0 for the world, 1 + p for part p of the Trace
    corner: wp.array[wp.vec3f]  # [F] top left, in the part's frame, metres
    right: wp.array[wp.vec3f]  # [F] direction of u divided by the width: its dot product with an offset is u
    down: wp.array[wp.vec3f]  # [F] likewise for v
    normal: wp.array[wp.vec3f]  # [F] unit
    reach: wp.array[wp.float32]  # [F] metres
    region: wp.array[wp.vec4f]  # [F] of the texture: left, top, width, height
    triangles: wp.array[wp.vec3i]  # the geometry's
    vertex_part: wp.array[wp.int32]
    face_normals: wp.array[wp.vec3f]


@wp.struct
class PatchPoint:
    """A sample's position on a patch."""

    coverage: wp.float32  # share of the pixel, 0 to 1
    u: wp.float32  # on the face, from 0 to 1
    v: wp.float32
    place: wp.vec4f  # texture coordinates, and the longer of their two derivatives by pixel, as `image_at` expects
    code: wp.uint32  # the shorter derivative


@wp.func
def rotate_back(m: wp.array2d[wp.float32], row: wp.int32, v: wp.vec3f) -> wp.vec3f:
    """Return a vector rotated by the inverse of the rotation in a row of m."""
    return wp.vec3f(
        (m[row, 0] * v[0] + m[row, 4] * v[1]) + m[row, 8] * v[2],
        (m[row, 1] * v[0] + m[row, 5] * v[1]) + m[row, 9] * v[2],
        (m[row, 2] * v[0] + m[row, 6] * v[1]) + m[row, 10] * v[2],
    )


@wp.func
def into_part(m: wp.array2d[wp.float32], part: wp.int32, v: wp.vec3f) -> wp.vec3f:
    """A direction of the world in the frame of a part; the world's frame is part 0's."""
    if part == 0:
        return v
    return rotate_back(m, part, v)


@wp.func
def covered_share(t: wp.float32, width: wp.float32) -> wp.float32:
    """Return the share of an interval of a given width around t that is within 0 to 1."""
    w = maximum(width, 1.0e-6)
    return clamp01((minimum(t + 0.5 * w, 1.0) - maximum(t - 0.5 * w, 0.0)) / w)


@wp.func
def face_at(
    patches: wp.array[PatchArrays], patch: wp.int32, part: wp.int32, point: wp.vec3f, normal: wp.vec3f
) -> wp.int32:
    """The face of a patch that shows at a point of a part whose triangle has that normal; -1 if none does."""
    found = wp.int32(-1)
    most = MIN_FACING
    if patches[0].whole[patch] != 0:
        most = wp.float32(-2.0)
    for f in range(patches[0].first_face[patch], patches[0].first_face[patch + 1]):
        if patches[0].part[f] == part:
            facing = dot(normal, patches[0].normal[f])
            if facing > most and wp.abs(dot(point - patches[0].corner[f], patches[0].normal[f])) <= patches[0].reach[f]:
                most = facing
                found = f
    return found


@wp.func
def patch_point_at(
    patches: wp.array[PatchArrays], patch: wp.int32, samples: wp.array[Samples], triangle: wp.int32, p: wp.vec3f
) -> PatchPoint:
    """Return the position of a point of a triangle on a patch of its surface; coverage is 0 if it is not on the patch.

    Of `samples`, only the transforms, the focal length and the eye are read.
    """
    out = PatchPoint()
    part = nonnegative(patches[0].vertex_part[nonnegative(patches[0].triangles[triangle][0])])
    m = samples[0].world_from_part
    here = p
    if part != 0:
        here = rotate_back(m, part, p - wp.vec3f(m[part, 3], m[part, 7], m[part, 11]))
    n = patches[0].face_normals[triangle]
    f = face_at(patches, patch, part, here, n)
    if f < 0:
        return out
    view = samples[0].world_from_view
    sight = p - samples[0].eye
    away = into_part(m, part, sight)
    depth = (sight[0] * view[0, 2] + sight[1] * view[0, 6]) + sight[2] * view[0, 10]
    scale = depth / samples[0].focal
    fall = minimum(dot(n, away), -GRAZING * wp.sqrt(dot(away, away)))
    x = into_part(m, part, wp.vec3f(view[0, 0], view[0, 4], view[0, 8]))
    y = into_part(m, part, wp.vec3f(view[0, 1], view[0, 5], view[0, 9]))
    x = (x - away * (dot(n, x) / fall)) * scale  # offset on the triangle's plane to the pixel on the right
    y = (y - away * (dot(n, y) / fall)) * scale  # offset to the pixel below
    right = patches[0].right[f]
    down = patches[0].down[f]
    out.u = dot(here - patches[0].corner[f], right)
    out.v = dot(here - patches[0].corner[f], down)
    steps = wp.vec4f(dot(x, right), dot(x, down), dot(y, right), dot(y, down))
    u = out.u
    v = out.v
    if patches[0].whole[patch] != 0:
        u = clamp01(u)
        v = clamp01(v)
        out.coverage = wp.float32(1.0)
    else:
        across = covered_share(u, wp.abs(steps[0]) + wp.abs(steps[2]))
        out.coverage = across * covered_share(v, wp.abs(steps[1]) + wp.abs(steps[3]))
    r = patches[0].region[f]
    steps = order_steps(
        wp.vec4f(bounded(steps[0] * r[2]), bounded(steps[1] * r[3]), bounded(steps[2] * r[2]), bounded(steps[3] * r[3]))
    )
    out.place = wp.vec4f(r[0] + u * r[2], r[1] + v * r[3], steps[0], steps[1])
    out.code = second_step(steps)
    return out


@wp.func
def patch_point(patches: wp.array[PatchArrays], patch: wp.int32, samples: wp.array[Samples], i: wp.int32) -> PatchPoint:
    """Return the position of a sample on a patch of its surface; coverage is 0 if it is not on the patch."""
    return patch_point_at(patches, patch, samples, triangle_of(samples[0].keys[i]), samples[0].positions[i])


@wp.kernel
def number_patches(
    keys: wp.array[wp.uint64],
    pinhole: Pinhole,
    scene: wp.array[SceneArrays],
    samples: wp.array[Samples],
    patches: wp.array[PatchArrays],
    out_numbers: wp.array[wp.uint8],
):
    """Write 1 + the index of the topmost patch at the centre of each pixel; 0 for none."""
    pixel = wp.tid()
    key = keys[pixel]
    found = wp.int32(0)
    if key != wp.uint64(0):
        triangle = triangle_of(key)
        surface = nonnegative(scene[0].triangle_surface[triangle])
        turned = rotate(scene[0].world_from_view, 0, ray_of(pixel, CENTRE, pinhole))
        p = point_seen(turned, wp.float32(depth_of(key, pinhole.near)), scene[0].world_from_view)
        for e in range(patches[0].first_entry[surface], patches[0].first_entry[surface + 1]):
            patch = patches[0].entries[e]
            at = patch_point_at(patches, patch, samples, triangle, p)
            within = at.u >= 0.0 and at.u <= 1.0 and at.v >= 0.0 and at.v <= 1.0
            if at.coverage > 0.0 and (within or patches[0].whole[patch] != 0):
                found = patch + 1
    out_numbers[pixel] = wp.uint8(found)
