"""Observation: every label, from the one visibility buffer, at pixel centres and never blended."""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.visibility import NEARNESS, Lens, snap

wp.set_module_options(OPTIONS)

SKY = wp.constant(wp.uint8(11))  # CARLA's tag


@wp.func
def triangle_of(key: wp.uint64) -> wp.int32:
    """The triangle named by a key that is not 0."""
    return wp.int32(key & wp.uint64(16777215))


@wp.func
def depth_of(key: wp.uint64, near: wp.float64) -> wp.float64:
    """Depth in metres along the optical axis, of a key that is not 0."""
    return near * NEARNESS / wp.float64(wp.int64(key >> wp.uint64(24)))


@wp.kernel
def label(
    keys: wp.array[wp.uint64],
    triangle_surface: wp.array[wp.int32],
    surface_actor: wp.array[wp.int32],
    surface_instance: wp.array[wp.int32],
    surface_tag: wp.array[wp.int32],
    lens: Lens,
    depth: wp.array2d[wp.float32],
    instance: wp.array2d[wp.uint16],
    semantic: wp.array2d[wp.uint8],
    extents: wp.array2d[wp.int32],
):
    """Depth, instance and tag of a pixel, and its actor's visible count and box (count, x0, y0, x1, y1)."""
    y, x = wp.tid()
    key = keys[y * lens.width + x]
    if key == wp.uint64(0):
        depth[y, x] = wp.float32(lens.far)
        instance[y, x] = wp.uint16(0)
        semantic[y, x] = SKY
        return
    surface = triangle_surface[triangle_of(key)]
    depth[y, x] = wp.float32(depth_of(key, lens.near))
    instance[y, x] = wp.uint16(surface_instance[surface])
    semantic[y, x] = wp.uint8(surface_tag[surface])
    actor = surface_actor[surface]
    if actor >= 0:
        extend(extents, actor, x, y)


@wp.func
def extend(extents: wp.array2d[wp.int32], actor: wp.int32, x: wp.int32, y: wp.int32):
    """Count a pixel into an actor's extent."""
    wp.atomic_add(extents, actor, 0, 1)
    wp.atomic_min(extents, actor, 1, x)
    wp.atomic_min(extents, actor, 2, y)
    wp.atomic_max(extents, actor, 3, x + 1)
    wp.atomic_max(extents, actor, 4, y + 1)


@wp.kernel
def amodal(
    bits: wp.array[wp.uint64], width: wp.int32, first_actor: wp.int32, actors: wp.int32, extents: wp.array2d[wp.int32]
):
    """Count a pixel into the extent of every actor whose bit it carries."""
    i = wp.tid()
    rest = bits[i]
    if rest == wp.uint64(0):
        return
    for a in range(actors):
        if ((rest >> wp.uint64(a)) & wp.uint64(1)) != wp.uint64(0):
            extend(extents, first_actor + a, i % width, i / width)


@wp.kernel
def project_box(
    view: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    triangle_surface: wp.array[wp.int32],
    surface_actor: wp.array[wp.int32],
    first: wp.int32,
    lens: Lens,
    extents: wp.array2d[wp.int32],
):
    """Widen an actor's unclipped box (1/256 pixels) by a triangle's corners in front of the near plane."""
    i = first + wp.tid()
    actor = surface_actor[triangle_surface[i]]
    t = triangles[i]
    for n in range(3):
        v = view[t[n]]
        z = wp.float64(v[2])
        if z >= lens.near:
            x = wp.int32(snap(lens.cx + wp.float64(v[0]) * lens.focal / z))
            y = wp.int32(snap(lens.cy + wp.float64(v[1]) * lens.focal / z))
            wp.atomic_add(extents, actor, 0, 1)
            wp.atomic_min(extents, actor, 1, x)
            wp.atomic_min(extents, actor, 2, y)
            wp.atomic_max(extents, actor, 3, x)
            wp.atomic_max(extents, actor, 4, y)
