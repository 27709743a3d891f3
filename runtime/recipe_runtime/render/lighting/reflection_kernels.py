"""Reflections on wet ground: screen-space ray tracing in the depth of the picture.

The reflected ray is followed until it passes behind a visible surface; the light of that sample is reflected. A block
of four pixels shares the length of one ray, and each pixel goes that far along its own ray; at edges, as far as
neighbouring blocks. A ray without a hit sees the sky or, if it is low, the street beyond the picture.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.atmosphere.air import Air, decay, reflected_sky
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.reflection_reuse_kernels import (
    MAX_PICTURE_SIDE,
    is_block_unchanged,
    mark_block_dirty,
    no_motion_in,
    packed_tiles,
    ring_pattern,
    ring_phase,
)
from recipe_runtime.render.lighting.temporal_kernels import DirtySamples, PreviousFrame, dirty_sample, mark_dirty
from recipe_runtime.render.numeric.noise import noise2, smoothstep
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import dot, mix
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.texture.detail import fade

wp.set_module_options(OPTIONS)

STEPS = wp.constant(13)
STEP_GROWTH = wp.constant(wp.float32(1.47))
DISTANCE_BEYOND_PICTURE = wp.constant(wp.float32(60.0))  # metres of air assumed for a ray that leaves the picture
DRY = wp.constant(-2)  # in place of a sample's index: a block that reflects nothing
RIPPLE = wp.constant(wp.float32(0.043))  # metres of a cell of the noise of ripples
SWELL = wp.constant(wp.float32(0.4))  # metres of a cell of the waves that are left farther away
MIN_SHARE = wp.constant(wp.float32(0.016))  # of reflectance; below, only the sky is reflected


@wp.func
def to_view(view: wp.array2d[wp.float32], v: wp.vec3f) -> wp.vec3f:
    """Rotate a world-space direction to view space."""
    return wp.vec3f(
        (view[0, 0] * v[0] + view[0, 1] * v[1]) + view[0, 2] * v[2],
        (view[0, 4] * v[0] + view[0, 5] * v[1]) + view[0, 6] * v[2],
        (view[0, 8] * v[0] + view[0, 9] * v[1]) + view[0, 10] * v[2],
    )


@wp.func
def pixel_of(q: wp.vec3f, pinhole: Pinhole) -> wp.vec2i:
    """Return the pixel (column, row) of a view-space point in front of the camera; -1 and -1 outside the picture."""
    scale = wp.float32(pinhole.focal) / q[2]
    x = q[0] * scale + wp.float32(pinhole.cx)
    y = q[1] * scale + wp.float32(pinhole.cy)
    within = x >= 0.0 and y >= 0.0 and x < wp.float32(pinhole.width) and y < wp.float32(pinhole.height)
    return wp.vec2i(wp.where(within, wp.int32(x), -1), wp.where(within, wp.int32(y), -1))


@wp.func
def ripple_tilt(
    air: wp.array[Air], p: wp.vec3f, rings: wp.int32, gloss: wp.float32, footprint: wp.float32
) -> wp.float32:
    """Return the tilt of the normal of wet ground along the line of sight by ripples, roughness and raindrops.

    Waves become longer, and then flat, where pixels, `footprint` metres long on the ground, are longer than they.
    """
    near = fade(RIPPLE, footprint)
    n = wp.float32(0.0)
    if near > 0.0:
        n = near * (noise2(p[0] / RIPPLE, p[1] / RIPPLE, wp.uint32(rings)) - 0.5)
    far = 0.6 * (1.0 - near) * fade(SWELL, footprint)
    if far > 0.0:
        n = n + far * (noise2(p[0] / SWELL, p[1] / SWELL, wp.uint32(rings)) - 0.5)
    return n * (0.006 + 0.3 * (1.0 - gloss) + air[0].ring_strength)


@wp.func
def mirror_direction(to_point: wp.vec3f, ripple: wp.float32) -> wp.vec3f:
    """Return the unit direction of the reflected line of sight: upward, and perturbed by ripples."""
    one = 1.0 / wp.sqrt(maximum(dot(to_point, to_point), 1.0e-8))
    sight = to_point * one
    n = wp.vec3f(sight[0] * ripple, sight[1] * ripple, 1.0)
    r = sight - n * (2.0 * dot(n, sight) / dot(n, n))
    return wp.vec3f(r[0], r[1], maximum(r[2], 0.02))


@wp.func
def first_wet(
    x0: wp.int32, y0: wp.int32, mirror: wp.array[wp.vec2f], starts: wp.array[wp.int32], pinhole: Pinhole
) -> wp.int32:
    """Return the first sample of a block of 2 x 2 pixels that is reflective enough for a ray; -1 if there is none."""
    found = wp.int32(-1)
    for y in range(y0, wp.min(y0 + 2, pinhole.height)):
        for x in range(x0, wp.min(x0 + 2, pinhole.width)):
            s = nonnegative(starts[nonnegative(y * pinhole.width + x)])
            if found < 0 and mirror[s][0] > MIN_SHARE:
                found = s
    return found


@wp.func
def bisect_hit(
    start: wp.vec3f,
    way: wp.vec3f,
    before: wp.float32,
    behind: wp.float32,
    depth: wp.array[wp.float32],
    pinhole: Pinhole,
) -> wp.float32:
    """Return where a ray passes behind the visible surface, by bisection between a point in front and one behind."""
    low = before
    high = behind
    for _halving in range(4):
        middle = (low + high) * 0.5
        q = start + way * middle
        at = pixel_of(q, pinhole)
        hidden = False
        if at[0] >= 0:
            hidden = depth[nonnegative(at[1] * pinhole.width + at[0])] < q[2] - 0.03
        if hidden:
            high = middle
        else:
            low = middle
    return high


@wp.func
def follow_ray(
    i: wp.int32,
    x0: wp.int32,
    y0: wp.int32,
    samples: wp.array[Samples],
    depth: wp.array[wp.float32],
    view: wp.array2d[wp.float32],
    pinhole: Pinhole,
):
    """Return the length of a sample's reflected ray up to its hit, -1 without a hit; and the tiles that it crosses."""
    to_point = samples[0].positions[i] - samples[0].eye
    start = to_view(view, to_point)
    way = to_view(view, mirror_direction(to_point, 0.0))
    hit = wp.int32(0)
    last = wp.float32(0.05)
    t = wp.float32(0.2)
    left = x0
    top = y0
    right = x0 + 1
    bottom = y0 + 1
    for _step in range(STEPS):
        q = start + way * t
        if q[2] <= 0.2:
            break
        at = pixel_of(q, pinhole)
        x = at[0]
        y = at[1]
        if x < 0:
            break
        left = wp.min(left, x)
        top = wp.min(top, y)
        right = wp.max(right, x)
        bottom = wp.max(bottom, y)
        seen = depth[nonnegative(y * pinhole.width + x)]
        if seen < q[2] - 0.03 and seen > q[2] - 0.3 - 1.3 * (t - last):
            hit = 1
            break
        last = t
        t = t * STEP_GROWTH
    found = wp.float32(-1.0)
    if hit != 0:
        found = bisect_hit(start, way, last, t, depth, pinhole)
    return found, packed_tiles(left, top, right, bottom, pinhole)


@wp.kernel
def trace_rays(
    samples: wp.array[Samples],
    mirror: wp.array[wp.vec2f],
    depth: wp.array[wp.float32],
    starts: wp.array[wp.int32],
    view_from_world: wp.array2d[wp.float32],
    pinhole: Pinhole,
    previous: wp.array[PreviousFrame],
    motion_sums: wp.array2d[wp.int32],
    blocks_per_thread: wp.int32,
    out_reach: wp.array[wp.float32],
    out_origins: wp.array[wp.int32],
    out_ways: wp.array[wp.uint32],
):
    """Trace the reflected rays of blocks of 2 x 2 pixels; `blocks_per_thread` blocks of a row.

    A ray of an earlier frame, from sample `out_origins` across the tiles `out_ways`, is reused if nothing moves in
    these tiles, and so is `DRY`, for a block that reflects nothing. A block whose ray changes marks its pixels, and
    the adjacent ones, as dirty.
    """
    columns = (pinhole.width + 1) / 2
    spans = (columns + blocks_per_thread - 1) / blocks_per_thread
    row = wp.tid() / spans
    first = (wp.tid() % spans) * blocks_per_thread
    small = previous[0].kept_count > 0 and wp.max(pinhole.width, pinhole.height) <= MAX_PICTURE_SIDE
    y0 = row * 2
    for column in range(first, wp.min(first + blocks_per_thread, columns)):
        x0 = column * 2
        block = nonnegative(row * columns + column)
        known = out_origins[block]
        same = bool(False)
        # (Nested: Warp may evaluate both sides of an `and`, and `no_motion_in` requires a small picture.)
        if small and known != -1:  # noqa: SIM102
            if is_block_unchanged(x0, y0, previous, pinhole):
                same = known == DRY
                if not same:
                    same = no_motion_in(motion_sums, out_ways[block])
        if not same:
            i = first_wet(x0, y0, mirror, starts, pinhole)
            was = out_reach[block]
            now = wp.float32(-1.0)
            out_origins[block] = DRY
            if i >= 0:
                now, way = follow_ray(i, x0, y0, samples, depth, view_from_world, pinhole)
                out_ways[block] = way
                out_origins[block] = -1
                if small and i < previous[0].kept_count:  # noqa: SIM102
                    if no_motion_in(motion_sums, way):
                        out_origins[block] = i
            out_reach[block] = now
            if was != now:
                mark_block_dirty(x0, y0, previous, pinhole)


@wp.func
def ray_hit(
    t: wp.float32,
    to_point: wp.vec3f,
    d: wp.vec3f,
    depth: wp.array[wp.float32],
    view: wp.array2d[wp.float32],
    pinhole: Pinhole,
) -> wp.vec2i:
    """Return the pixel in which a ray of length t from a point ends, and whether the visible surface lies at its end.

    It returns -1 and 0 if t is not above 0, or if the end is outside the picture.
    """
    at = wp.int32(-1)
    close = wp.int32(0)
    if t > 0.0:
        q = to_view(view, to_point + d * t)
        if q[2] > 0.2:
            place = pixel_of(q, pinhole)
            if place[0] >= 0:
                at = place[1] * pinhole.width + place[0]
                seen = depth[nonnegative(at)]
                close = wp.where(seen < q[2] + 0.1 + 0.03 * t and seen > q[2] - 0.3 - 0.2 * t, 1, 0)
    return wp.vec2i(at, close)


@wp.func
def block_beside(
    block: wp.int32, pixel: wp.int32, t: wp.float32, reach: wp.array[wp.float32], pinhole: Pinhole
) -> wp.int32:
    """Return a block next to a pixel of a block whose ray has length t, with a ray of another length; else the block.

    It is the block on the pixel's left or right side or, if that has the same length, the one above or below.
    """
    columns = (pinhole.width + 1) / 2
    rows = (pinhole.height + 1) / 2
    column = block % columns
    row = block / columns
    c = wp.min(wp.max(column + ((pixel % pinhole.width) & 1) * 2 - 1, 0), columns - 1)
    r = wp.min(wp.max(row + ((pixel / pinhole.width) & 1) * 2 - 1, 0), rows - 1)
    found = row * columns + c
    if wp.abs(reach[nonnegative(found)] - t) <= 0.15 * wp.abs(t):
        found = r * columns + column
        if wp.abs(reach[nonnegative(found)] - t) <= 0.15 * wp.abs(t):
            found = block
    return found


@wp.func
def mirrored_pixel(
    block: wp.int32,
    pixel: wp.int32,
    to_point: wp.vec3f,
    d: wp.vec3f,
    reach: wp.array[wp.float32],
    depth: wp.array[wp.float32],
    view: wp.array2d[wp.float32],
    pinhole: Pinhole,
) -> wp.vec2i:
    """Return the pixel that is reflected along d, and the other pixel whose depth decided that; or -1.

    The ray has the length of the block's; if that ends in front of or behind the visible surface, that of a
    neighbour's.
    """
    t = reach[block]
    own = ray_hit(t, to_point, d, depth, view, pinhole)
    at = own[0]
    other = wp.int32(-1)
    if own[1] == 0:
        beside = reach[nonnegative(block_beside(block, pixel, t, reach, pinhole))]
        if beside > 0.0 and beside != t:
            end = ray_hit(beside, to_point, d, depth, view, pinhole)
            other = end[0]
            if end[1] != 0:
                other = at
                at = end[0]
    return wp.vec2i(at, other)


@wp.func
def light_beyond_picture(air: wp.array[Air], d: wp.vec3f) -> wp.vec3f:
    """Return the light along d from outside the picture: the sky or, if d is low, the street."""
    street = clamp01(smoothstep(0.34, 0.12, d[2]))
    beyond = mix(reflected_sky(air, d), air[0].sideways * 0.45, street)
    return mix(air[0].fog_colour, beyond, decay(air, (air[0].fog + air[0].haze) * DISTANCE_BEYOND_PICTURE))


@wp.func
def mirrored_view(
    samples: wp.array[Samples],
    air: wp.array[Air],
    i: wp.int32,
    gloss: wp.float32,
    reach: wp.array[wp.float32],
    depth: wp.array[wp.float32],
    view: wp.array2d[wp.float32],
    pinhole: Pinhole,
):
    """Return the direction in which a sample of wet ground mirrors, and what `mirrored_pixel` returns for it."""
    pixel = nonnegative(samples[0].pixels[i])
    block = nonnegative((pixel / pinhole.width / 2) * ((pinhole.width + 1) / 2) + (pixel % pinhole.width) / 2)
    p = samples[0].positions[i]
    to_point = p - samples[0].eye
    footprint = dot(to_point, to_point) / maximum(wp.float32(pinhole.focal) * wp.abs(to_point[2]), 1.0)
    rings = ring_pattern(ring_phase(p), air[0].ring_step)
    d = mirror_direction(to_point, ripple_tilt(air, p, rings, gloss, footprint))
    return d, mirrored_pixel(block, pixel, to_point, d, reach, depth, view, pinhole)


@wp.func
def brightest_mirrored(air: wp.array[Air], gloss: wp.float32) -> wp.vec3f:
    """Return the brightest light that wet ground mirrors: a thin film blurs a lamp, standing water shows it sharply."""
    return air[0].sideways * (4.0 + 500.0 * maximum(gloss - 0.82, 0.0))


@wp.kernel
def reflect(
    samples: wp.array[Samples],
    air: wp.array[Air],
    mirror: wp.array[wp.vec2f],
    reach: wp.array[wp.float32],
    depth: wp.array[wp.float32],
    starts: wp.array[wp.int32],
    view_from_world: wp.array2d[wp.float32],
    pinhole: Pinhole,
    previous: wp.array[PreviousFrame],
    dirty: wp.array[DirtySamples],
    radiance: wp.array[wp.vec3f],
    out_sources: wp.array[wp.vec2i],
    out_shown: wp.array[wp.vec3f],
):
    """Add the reflected light to the dirty samples: along their own ray, as far as the ray of their block.

    If that ray does not end on the visible surface, as at edges, the length of a neighbouring block's ray may.
    `out_sources` receives the pixel whose light is reflected and the other pixel whose depth was used, for
    `stale_reflections`.
    """
    i = dirty_sample(dirty, wp.tid())
    share = mirror[i][0]
    if share <= 0.0:
        return
    pixel = samples[0].pixels[i]
    if pixel < 0:  # an unused slot
        return
    light = radiance[i]
    pixel = nonnegative(pixel)
    keep = i < previous[0].kept_count
    mark_dirty(previous, pixel)
    d, hit = mirrored_view(samples, air, i, mirror[i][1], reach, depth, view_from_world, pinhole)
    at = hit[0]
    if at >= 0:
        most = brightest_mirrored(air, mirror[i][1])
        seen = nonnegative(starts[nonnegative(at)])
        shown = radiance[seen]
        shown = wp.vec3f(minimum(shown[0], most[0]), minimum(shown[1], most[1]), minimum(shown[2], most[2]))
        out_shown[i] = light + shown * share
        if seen >= previous[0].kept_count:
            at = -2
    else:
        out_shown[i] = light + light_beyond_picture(air, d) * share
    if keep:
        out_sources[i] = wp.vec2i(at, hit[1])
