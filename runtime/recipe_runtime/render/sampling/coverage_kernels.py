"""Coverage of a pixel: its five samples, grouped by the surfaces that they see."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.vectors import dot
from recipe_runtime.render.raster.label_kernels import triangle_of
from recipe_runtime.render.raster.triangles import ROWS

wp.set_module_options(OPTIONS)

CENTRE = ROWS  # place of a sample at the pixel's centre; lower ones are rows of coverage samples


@wp.struct
class SceneArrays:
    """The arrays of the geometry from which samples are evaluated."""

    view: wp.array[wp.vec3f]
    normals: wp.array[wp.vec3f]
    uvs: wp.array[wp.vec2f]
    vertex_part: wp.array[wp.int32]
    vertex_skin: wp.array[wp.int32]
    skin_parts: wp.array[wp.vec4i]
    skin_weights: wp.array[wp.vec4f]
    triangles: wp.array[wp.vec3i]
    face_normals: wp.array[wp.vec3f]
    triangle_surface: wp.array[wp.int32]
    surface_pattern: wp.array[wp.int32]
    world_from_part: wp.array2d[wp.float32]
    world_from_view: wp.array2d[wp.float32]


@wp.func
def same_surface(a: wp.uint64, b: wp.uint64, scene: wp.array[SceneArrays]) -> bool:
    """Return whether two samples see one smooth surface: same material, similar depth, similar orientation."""
    if a == b:
        return True
    if a == wp.uint64(0) or b == wp.uint64(0):
        return False
    s = triangle_of(a)
    t = triangle_of(b)
    if s == t:
        return True
    if scene[0].triangle_surface[s] != scene[0].triangle_surface[t]:
        return False
    if scene[0].vertex_part[scene[0].triangles[s][0]] != scene[0].vertex_part[scene[0].triangles[t][0]]:
        return False
    if dot(scene[0].face_normals[s], scene[0].face_normals[t]) < 0.8:
        return False
    # Keys grow with nearness; within 3 % of each other counts as similar depth.
    u = wp.float64(wp.int64(a >> wp.uint64(24)))
    v = wp.float64(wp.int64(b >> wp.uint64(24)))
    return u < v * wp.float64(1.03) and v < u * wp.float64(1.03)


@wp.func
def group_samples(
    coarse: wp.array[wp.uint64],
    i: wp.int32,
    fine: wp.array[wp.uint64],
    base: wp.int32,
    width: wp.int32,
    scene: wp.array[SceneArrays],
) -> wp.int32:
    """Group a pixel's samples by surface: its centre, and those of its rows, the first of them at `base`.

    Bits 0-2 of the result are the number of groups, at most four, bits 4 + 2r and 5 + 2r the group of row r. The centre
    is in group 0. Further surfaces join the last group.
    """
    k0 = coarse[i]
    at = base
    differ = wp.uint64(0)
    for _row in range(ROWS):
        differ = differ | (fine[at] ^ k0)
        at = at + width
    if differ == wp.uint64(0) or (triangle_of(k0) != 0 and (differ << wp.uint64(40)) == wp.uint64(0)):
        return 1
    k1 = k0  # the first samples of groups 1 and 2
    k2 = k0
    n = wp.int32(1)
    grouping = wp.int32(0)
    at = base
    for row in range(ROWS):
        key = fine[at]
        at = at + width
        group = wp.int32(0)
        if not same_surface(k0, key, scene):
            if n > 1 and same_surface(k1, key, scene):
                group = 1
            elif n > 2 and same_surface(k2, key, scene):
                group = 2
            elif n > 3:
                group = 3
            else:
                group = n
                n = n + 1
                if group == 1:
                    k1 = key
                elif group == 2:
                    k2 = key
        grouping = grouping | (group << (4 + 2 * row))
    return n | grouping


@wp.func
def member_of(grouping: wp.int32, group: wp.int32):
    """Return the place of a group, the centre or the first of its rows, and the number of its samples."""
    spot = wp.int32(CENTRE)
    count = int(group == 0)
    for back in range(ROWS):
        row = ROWS - 1 - back
        if ((grouping >> (4 + 2 * row)) & 3) == group:
            count = count + 1
            if group != 0:
                spot = row
    return spot, count
