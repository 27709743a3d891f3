"""Look-ups in the shadow maps of lamps: for a point, and for a box in which no point may be in a shadow."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import dot
from recipe_runtime.render.shadows.lamp_shadow_kernels import (
    STATIC_SLOTS,
    TILE,
    LampMaps,
    map_size,
    nearness_key,
    view_coordinates,
    view_point,
)

wp.set_module_options(OPTIONS)

MIN_LIFT = wp.constant(wp.float32(0.004))  # metres, minimum normal offset of a shaded point
FADE = wp.constant(wp.float32(6.0))  # metres along the axis of the lamp over which shadows end
BIAS = wp.constant(wp.float32(0.01))  # metres, minimum depth bias towards the lamp
EXACT_HEIGHT = wp.constant(wp.float32(0.3))  # metres below which level surfaces are ground, which casts no shadow


@wp.func
def filtered(
    keys: wp.array2d[wp.uint64], row: wp.int32, size: wp.int32, u: wp.float32, v: wp.float32, limit: wp.uint64
):
    """Return the share of a lamp that is visible: percentage-closer filtering with nine bilinear taps."""
    i = int(u)
    j = int(v)
    fu = u - wp.float32(i)
    fv = v - wp.float32(j)
    total = wp.float32(0.0)
    for y in range(4):
        base = nonnegative((j + y - 1) * size + i - 1)
        hidden = wp.where(keys[row, base] > limit, 1.0 - fu, 0.0)
        hidden = hidden + wp.where(keys[row, base + 1] > limit, 1.0, 0.0)
        hidden = hidden + wp.where(keys[row, base + 2] > limit, 1.0, 0.0)
        hidden = hidden + wp.where(keys[row, base + 3] > limit, fu, 0.0)
        weight = wp.where(y == 0, 1.0 - fv, wp.where(y == 3, fv, 1.0))
        total = total + hidden * weight
    return maximum(1.0 - total * (1.0 / 9.0), 0.0)


@wp.func
def texel_at(lens: wp.vec4f, z: wp.float32) -> wp.float32:
    """Return the size of a map's texel, metres, at a depth along the lamp's axis."""
    return maximum(z, lens[1]) * lens[3]


@wp.func
def shadow_point(maps: wp.array[LampMaps], slot: wp.int32, p: wp.vec3f, n: wp.vec3f, to: wp.vec3f) -> wp.vec3f:
    """Return the view coordinates at which a map is read for a point with normal n and unit direction `to` to the lamp.

    The point is offset along its normal. The filter reads up to two texels away: on a surface at a grazing angle the
    depths there differ more, so a larger offset prevents self-shadowing.
    """
    right = maps[0].right[slot]
    down = maps[0].down[slot]
    ahead = maps[0].ahead[slot]
    at = view_coordinates(right, down, ahead, p)
    along = wp.vec3f(
        (right[0] * n[0] + right[1] * n[1]) + right[2] * n[2],
        (down[0] * n[0] + down[1] * n[1]) + down[2] * n[2],
        (ahead[0] * n[0] + ahead[1] * n[1]) + ahead[2] * n[2],
    )
    texel = texel_at(maps[0].lens[slot], at[2])
    lift = 0.6 * texel + MIN_LIFT
    if p[2] > EXACT_HEIGHT or n[2] < 0.7:
        facing = dot(n, to)
        lift = lift + 1.4 * texel * wp.sqrt(maximum(1.0 - facing * facing, 0.0))
    return at + along * lift


@wp.func
def lamp_visibility(maps: wp.array[LampMaps], lamp_slot: wp.int32, p: wp.vec3f, n: wp.vec3f, to: wp.vec3f) -> wp.vec2f:
    """Return the share of a lamp visible from a point with normal n, and the share that moving objects do not hide.

    The latter is 1 where the static scene already hides the lamp.
    """
    slot = nonnegative(lamp_slot)
    lens = maps[0].lens[slot]
    r = shadow_point(maps, slot, p, n, to)
    left = wp.float32(1.0)
    moving = wp.float32(1.0)
    size = map_size(slot)
    z = r[2]
    if z > lens[1] and z < lens[2]:
        scale = lens[0] / z
        u = 0.5 * wp.float32(size) + r[0] * scale - 0.5
        v = 0.5 * wp.float32(size) + r[1] * scale - 0.5
        end = wp.float32(size - 4)
        if u >= 3.0 and v >= 3.0 and u <= end and v <= end:
            tile = nonnegative((nonnegative(int(v)) / TILE) * (size / TILE) + nonnegative(int(u)) / TILE)
            nearest = maps[0].nearest[slot, tile]
            static_nearest = wp.uint64(0)
            if slot < STATIC_SLOTS:
                static_nearest = maps[0].fixed[slot].nearest[0, tile]
            if (nearest | static_nearest) != wp.uint64(0):
                limit = nearness_key(
                    wp.float64(lens[1]) / wp.float64(maximum(z - BIAS - 0.35 * texel_at(lens, z), lens[1]))
                )
                if static_nearest > limit:
                    left = wp.float32(0.0)
                    if maps[0].fixed[slot].farthest[0, tile] <= limit:
                        left = filtered(maps[0].fixed[slot].keys, 0, size, u, v, limit)
                if left > 0.0 and nearest > limit:
                    moving = wp.float32(0.0)
                    if maps[0].farthest[slot, tile] <= limit:
                        moving = filtered(maps[0].keys, slot, size, u, v, limit)
    strength = minimum((lens[2] - z) * (1.0 / FADE), 1.0)
    return wp.vec2f(1.0 - strength * (1.0 - minimum(left, moving)), 1.0 - strength * (1.0 - moving))


@wp.func
def ratio_range(low: wp.float32, high: wp.float32, near: wp.float32, far: wp.float32):
    """Return the minimum and maximum of x / z for x in low..high and z in near..far, where near > 0."""
    least = wp.where(low < 0.0, low / near, low / far)
    largest = wp.where(high < 0.0, high / far, high / near)
    return least, largest


@wp.func
def box_lit(maps: wp.array[LampMaps], slot: wp.int32, low: wp.vec3f, high: wp.vec3f) -> bool:
    """Return whether no moving object shadows any point of a box; False also if the test would read too many tiles."""
    lens = maps[0].lens[slot]
    half = (high - low) * 0.5
    c = view_point(maps, slot, (low + high) * 0.5)
    a = maps[0].ahead[slot]
    dz = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2]
    lift = 3.0 * texel_at(lens, c[2] + dz) + 2.0 * MIN_LIFT
    z0 = maximum(c[2] - dz - lift, lens[1])
    z1 = c[2] + dz + lift
    if z1 <= lens[1] or z0 >= lens[2]:
        return True
    a = maps[0].right[slot]
    dx = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + lift
    a = maps[0].down[slot]
    dy = wp.abs(a[0]) * half[0] + wp.abs(a[1]) * half[1] + wp.abs(a[2]) * half[2] + lift
    u0, u1 = ratio_range(c[0] - dx, c[0] + dx, z0, z1)
    v0, v1 = ratio_range(c[1] - dy, c[1] + dy, z0, z1)
    size = map_size(slot)
    middle = 0.5 * wp.float32(size)
    end = wp.float32(size - 1)
    left = middle + u0 * lens[0] - 2.0
    right = middle + u1 * lens[0] + 2.0
    top = middle + v0 * lens[0] - 2.0
    bottom = middle + v1 * lens[0] + 2.0
    if right < 0.0 or bottom < 0.0 or left > end or top > end:
        return True
    x0 = int(maximum(left, 0.0)) / TILE
    x1 = int(minimum(right, end)) / TILE
    y0 = int(maximum(top, 0.0)) / TILE
    y1 = int(minimum(bottom, end)) / TILE
    if (x1 - x0 + 1) * (y1 - y0 + 1) > 1024:
        return False
    limit = nearness_key(wp.float64(lens[1]) / wp.float64(z1))
    for y in range(y0, y1 + 1):
        for x in range(x0, x1 + 1):
            if maps[0].nearest[slot, y * (size / TILE) + x] > limit:
                return False
    return True
