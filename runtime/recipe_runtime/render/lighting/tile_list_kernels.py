"""Light culling: which lamps illuminate a tile of the picture, and which bodies are close enough to darken it.

A tile has 16 x 16 pixels. Its world-space box follows from its nearest and farthest pixel; lamps and bodies that do not
reach the box are culled. The order of the list is kept, so sums are always the same.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.temporal_kernels import PreviousFrame, last_leaf_step
from recipe_runtime.render.numeric.noise import smoothstep
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum, nonnegative
from recipe_runtime.render.numeric.vectors import dot
from recipe_runtime.render.raster.label_kernels import TILE, depth_of
from recipe_runtime.render.scene.pinhole import Pinhole
from recipe_runtime.render.shadows.lamp_lookup_kernels import box_lit, lamp_visibility
from recipe_runtime.render.shadows.lamp_shadow_kernels import LampMaps

wp.set_module_options(OPTIONS)

UNSHADOWED = wp.constant(16)  # of a tile: no moving object shadows it from its lamps
SAME_STATIC_LAMPS = wp.constant(32)  # of a tile: its list contains the static lamps of the earlier frame
SHADOWED_SLOTS = wp.constant(8)  # of a tile: the first bit of a mask, of the slots from whose lamps a moving object
# may shadow it
MAX_PER_TILE = wp.constant(24)  # entries of a tile's list of bodies or glows; further ones are dropped
MAX_LAMPS_PER_TILE = wp.constant(96)  # likewise of lamps; the box of a tile that shows a far street meets many
STATIC_LAMPS = wp.constant(97)  # column of a tile's list of lamps: how many are static, which come first
FADE_END_SQUARED = wp.constant(wp.float32(8.0))  # squared distance, in spreads, beyond which a body darkens nothing
FADE_END_SHARE = wp.constant(wp.float32(1.0 / 81.0))  # its occlusion at that distance


@wp.struct
class Lamps:
    """Spot lights that are on, in world space."""

    position: wp.array[wp.vec3f]
    direction: wp.array[wp.vec3f]  # unit
    power: wp.array[wp.vec3f]  # light on a white surface at one metre
    cone: wp.array[wp.vec2f]  # cosines of the angles at which the light is 0 and full
    reach: wp.array[wp.float32]  # metres
    shadow: wp.array[wp.vec2f]  # slot of its shadow maps, and the strength of its shadow
    moves: wp.array[wp.int32]  # 1: may move between frames
    maps: wp.array[LampMaps]  # one element
    lit: wp.array[wp.float32]  # by surface, 1 for a lamp of a vehicle that is lit
    count: wp.int32


@wp.struct
class Bodies:
    """Moving parts that nearly touch the ground: the footprint of an upright box each."""

    centre: wp.array[wp.vec3f]  # of the footprint
    axis: wp.array[wp.vec2f]  # unit, along its first half size
    half: wp.array[wp.vec2f]
    spread: wp.array[wp.float32]  # metres around the box over which the occlusion fades
    strength: wp.array[wp.float32]
    count: wp.int32


@wp.func
def gap(low: wp.float32, high: wp.float32, x: wp.float32) -> wp.float32:
    """Return the distance of x from an interval."""
    return maximum(maximum(low - x, x - high), 0.0)


@wp.func
def meets_cone(v: wp.vec3f, radius: wp.float32, aim: wp.vec3f, cosine: wp.float32) -> bool:
    """Return whether a ball at v from a cone's apex may meet the cone; always for half angles of 90 degrees or more."""
    if cosine <= 0.0:
        return True
    along = dot(v, aim)
    if along < -radius:
        return False
    across = wp.sqrt(maximum(dot(v, v) - along * along, 0.0))
    return across * cosine - along * wp.sqrt(1.0 - cosine * cosine) <= radius


@wp.func
def key_range(keys: wp.array[wp.uint64], pinhole: Pinhole, x0: wp.int32, y0: wp.int32, x1: wp.int32, y1: wp.int32):
    """Return nearest and farthest key of a rectangle of pixels, without the sky; a nearest of 0 means sky only."""
    far = wp.uint64(0xFFFFFFFFFFFFFFFF)
    near = wp.uint64(0)
    for y in range(y0, y1):
        row = y * pinhole.width
        for x in range(x0, x1):
            key = keys[nonnegative(row + x)]
            near = wp.max(near, key)
            far = wp.min(far, key - wp.uint64(1))  # the sky's 0 becomes the largest value
    return near, far + wp.uint64(1)


@wp.func
def world_box(
    world: wp.array2d[wp.float32],
    pinhole: Pinhole,
    x0: wp.int32,
    y0: wp.int32,
    x1: wp.int32,
    y1: wp.int32,
    z0: wp.float32,
    z1: wp.float32,
):
    """Return low and high corner of the world-space box of a rectangle of pixels between two depths."""
    low = wp.vec3f(1.0e9, 1.0e9, 1.0e9)
    high = wp.vec3f(-1.0e9, -1.0e9, -1.0e9)
    focal = wp.float32(pinhole.focal)
    for corner in range(8):
        z = z0
        if corner >= 4:
            z = z1
        cx = (wp.float32(x0 + (corner & 1) * (x1 - x0)) - wp.float32(pinhole.cx)) / focal * z
        cy = (wp.float32(y0 + ((corner >> 1) & 1) * (y1 - y0)) - wp.float32(pinhole.cy)) / focal * z
        px = world[0, 0] * cx + world[0, 1] * cy + world[0, 2] * z + world[0, 3]
        py = world[0, 4] * cx + world[0, 5] * cy + world[0, 6] * z + world[0, 7]
        pz = world[0, 8] * cx + world[0, 9] * cy + world[0, 10] * z + world[0, 11]
        low = wp.vec3f(minimum(low[0], px), minimum(low[1], py), minimum(low[2], pz))
        high = wp.vec3f(maximum(high[0], px), maximum(high[1], py), maximum(high[2], pz))
    return low, high


@wp.func
def gaps(low: wp.vec3f, high: wp.vec3f, p: wp.vec3f) -> wp.vec3f:
    """Return the distances of a point from a box along each axis."""
    return wp.vec3f(gap(low[0], high[0], p[0]), gap(low[1], high[1], p[1]), gap(low[2], high[2], p[2]))


@wp.func
def list_lamps(lamps: wp.array[Lamps], low: wp.vec3f, high: wp.vec3f, tile: wp.int32, lists: wp.array2d[wp.int32]):
    """List the lamps whose ball of reach meets the box, and whose cone meets the bounding ball of the box."""
    middle = (low + high) * 0.5
    span = high - low
    radius = 0.5 * wp.sqrt(dot(span, span)) + 0.05
    n = wp.int32(0)
    static_count = wp.int32(0)
    for i in range(lamps[0].count):
        p = lamps[0].position[i]
        g = gaps(low, high, p)
        reach = lamps[0].reach[i]
        near_by = g[0] * g[0] + g[1] * g[1] + g[2] * g[2] < reach * reach
        if (
            near_by
            and n < MAX_LAMPS_PER_TILE
            and meets_cone(middle - p, radius, lamps[0].direction[i], lamps[0].cone[i][0])
        ):
            n = n + 1
            lists[tile, n] = i
            if lamps[0].moves[i] == 0 and static_count == n - 1:
                static_count = n
    lists[tile, 0] = n
    lists[tile, STATIC_LAMPS] = static_count


@wp.func
def list_bodies(bodies: wp.array[Bodies], low: wp.vec3f, high: wp.vec3f, tile: wp.int32, lists: wp.array2d[wp.int32]):
    """List the bodies that are close enough to the box to darken it."""
    n = wp.int32(0)
    for i in range(bodies[0].count):
        reach = bodies[0].half[i][0] + bodies[0].half[i][1] + wp.sqrt(FADE_END_SQUARED) * bodies[0].spread[i] + 0.001
        g = gaps(low, high, bodies[0].centre[i])
        if g[0] * g[0] + g[1] * g[1] < reach * reach and g[2] < 0.6 and n < MAX_PER_TILE:
            n = n + 1
            lists[tile, n] = i
    lists[tile, 0] = n


@wp.kernel
def cull_lights(
    keys: wp.array[wp.uint64],
    pinhole: Pinhole,
    world_from_view: wp.array2d[wp.float32],
    lamps: wp.array[Lamps],
    bodies: wp.array[Bodies],
    out_lamp_lists: wp.array2d[wp.int32],
    out_body_lists: wp.array2d[wp.int32],
):
    """List the lamps and bodies that affect a tile; entry 0 is the count."""
    tile = wp.tid()
    columns = (pinhole.width + TILE - 1) / TILE
    x0 = (tile % columns) * TILE
    y0 = (tile / columns) * TILE
    x1 = wp.min(x0 + TILE, pinhole.width)
    y1 = wp.min(y0 + TILE, pinhole.height)
    near, far = key_range(keys, pinhole, x0, y0, x1, y1)
    out_lamp_lists[tile, 0] = 0
    out_lamp_lists[tile, STATIC_LAMPS] = 0
    out_body_lists[tile, 0] = 0
    if near == wp.uint64(0):
        return
    # A margin: samples within a pixel may be nearer or farther than its centre.
    z0 = wp.float32(depth_of(near, pinhole.near)) * 0.97 - 0.05
    z1 = wp.float32(depth_of(far, pinhole.near)) * 1.03 + 0.05
    low, high = world_box(world_from_view, pinhole, x0, y0, x1, y1, z0, z1)
    list_lamps(lamps, low, high, tile, out_lamp_lists)
    list_bodies(bodies, low, high, tile, out_body_lists)


@wp.func
def same_lamps(
    lamps: wp.array[Lamps],
    before: wp.array2d[wp.int32],
    now: wp.array2d[wp.int32],
    tile: wp.int32,
    before_count: wp.int32,
    count: wp.int32,
) -> bool:
    """Return whether the first lamps of a tile's list are those of the earlier frame, and none of them moves."""
    if before_count != count:
        return False
    for k in range(count):
        lamp = now[tile, k + 1]
        if before[tile, k + 1] != lamp or lamps[0].moves[lamp] != 0:
            return False
    return True


@wp.func
def shadowed_slots(
    lamps: wp.array[Lamps], lists: wp.array2d[wp.int32], tile: wp.int32, low: wp.vec3f, high: wp.vec3f
) -> wp.int32:
    """Return a mask of the slots from whose lamps, of those of a tile, a moving object may shadow a box."""
    mask = wp.int32(0)
    for k in range(lists[tile, 0]):
        shadow = lamps[0].shadow[lists[tile, k + 1]]
        if shadow[1] > 0.0 and not box_lit(lamps[0].maps, wp.int32(shadow[0]), low, high):
            mask = mask | (wp.int32(1) << wp.int32(shadow[0]))
    return mask


@wp.kernel
def compare_lists(
    lamps: wp.array[Lamps],
    lamps_before: wp.array2d[wp.int32],
    bodies_before: wp.array2d[wp.int32],
    glows_before: wp.array2d[wp.int32],
    lamp_lists: wp.array2d[wp.int32],
    body_lists: wp.array2d[wp.int32],
    glow_lists: wp.array2d[wp.int32],
    lows: wp.array[wp.vec3f],
    highs: wp.array[wp.vec3f],
    out_bits: wp.array[wp.int32],
):
    """Compare a tile's lists with those of the earlier frame; `lows` and `highs` are the corners of the tiles' boxes.

    Bit 0: no body darkens the tile; bit 1: the same static lamps illuminate it; bit 2: the same static lamps glow
    before it; `UNSHADOWED`, `SAME_STATIC_LAMPS`, `SHADOWED_SLOTS`: see there.
    """
    tile = wp.tid()
    bits = wp.int32(0)
    if bodies_before[tile, 0] == 0 and body_lists[tile, 0] == 0:
        bits = bits | 1
    if same_lamps(lamps, lamps_before, lamp_lists, tile, lamps_before[tile, 0], lamp_lists[tile, 0]):
        bits = bits | 2
    static_before = lamps_before[tile, STATIC_LAMPS]
    if same_lamps(lamps, lamps_before, lamp_lists, tile, static_before, lamp_lists[tile, STATIC_LAMPS]):
        bits = bits | SAME_STATIC_LAMPS
    shadowed = shadowed_slots(lamps, lamp_lists, tile, lows[tile], highs[tile])
    if shadowed == 0:
        bits = bits | UNSHADOWED
    bits = bits | (shadowed << SHADOWED_SLOTS)
    if same_lamps(lamps, glows_before, glow_lists, tile, glows_before[tile, 0], glow_lists[tile, 0]):
        bits = bits | 4
    out_bits[tile] = bits


@wp.func
def contact_occlusion(
    bodies: wp.array[Bodies], lists: wp.array2d[wp.int32], tile: wp.int32, p: wp.vec3f, n: wp.vec3f
) -> wp.float32:
    """Return the share of the sky's light left on ground below nearby bodies."""
    left = wp.float32(1.0)
    for k in range(lists[tile, 0]):
        i = lists[tile, k + 1]
        c = bodies[0].centre[i]
        a = bodies[0].axis[i]
        h = bodies[0].half[i]
        dx = p[0] - c[0]
        dy = p[1] - c[1]
        dz = p[2] - c[2]
        if dz < 0.12 and dz > -0.5:
            u = dx * a[0] + dy * a[1]
            v = dy * a[0] - dx * a[1]
            gu = gap(-h[0], h[0], u)
            gv = gap(-h[1], h[1], v)
            square = gu * gu + gv * gv
            spread = bodies[0].spread[i] * bodies[0].spread[i]
            if square < FADE_END_SQUARED * spread:
                r = square / spread
                share = maximum(1.0 / (1.0 + 2.0 * r + r * r) - FADE_END_SHARE, 0.0) * (1.0 / (1.0 - FADE_END_SHARE))
                # Parts of one body overlap: the darkest counts, not their product.
                left = minimum(left, 1.0 - bodies[0].strength[i] * clamp01(n[2]) * share)
    return left


@wp.func
def lamp_light(lamps: wp.array[Lamps], lamp: wp.int32, p: wp.vec3f, n: wp.vec3f) -> wp.vec4f:
    """Return the unit vector from a point to a lamp, and the share of the lamp's power that illuminates the point.

    The share is 0 out of reach, or if the surface faces away by more than wrap lighting covers.
    """
    i = nonnegative(lamp)
    d = lamps[0].position[i] - p
    s = dot(d, d)
    reach = lamps[0].reach[i]
    x = wp.float32(0.0)
    y = wp.float32(0.0)
    z = wp.float32(1.0)
    share = wp.float32(0.0)
    if s <= reach * reach:
        # Outside the cone, tested without a square root: the usual case.
        cone = lamps[0].cone[i]
        along = -dot(d, lamps[0].direction[i])
        if cone[0] <= 0.0 or (along > 0.0 and along * along >= cone[0] * cone[0] * s):
            faced = dot(d, n)
            if faced >= 0.0 or faced * faced <= 0.0144 * s:
                r = 1.0 / wp.sqrt(maximum(s, 1.0e-4))
                x = d[0] * r
                y = d[1] * r
                z = d[2] * r
                spot = smoothstep(cone[0], cone[1], along * r)
                edge = 1.0 - s / (reach * reach)
                share = spot * edge * edge / (s + 0.15)
    return wp.vec4f(x, y, z, share)


@wp.func
def lamp_shadow(lamps: wp.array[Lamps], i: wp.int32, p: wp.vec3f, n: wp.vec3f, to: wp.vec3f) -> wp.vec2f:
    """Return the share of a lamp's light that reaches a point, and the share that moving objects alone would leave.

    `n` is the surface's normal, `to` the unit vector to the lamp.
    """
    shadow = lamps[0].shadow[i]
    share = wp.vec2f(1.0, 1.0)
    if shadow[1] > 0.0:
        seen = lamp_visibility(lamps[0].maps, wp.int32(shadow[0]), p, n, to)
        share = wp.vec2f(1.0 - shadow[1] * (1.0 - seen[0]), seen[1])
    return share


@wp.func
def may_be_shadowed(shadow: wp.vec2f, bits: wp.int32) -> bool:
    """Return whether a moving object may shadow a tile with these bits from a lamp with this slot and strength."""
    return shadow[1] > 0.0 and ((bits >> (SHADOWED_SLOTS + wp.int32(shadow[0]))) & 1) != 0


@wp.func
def lamps_shadowed(
    lamps: wp.array[Lamps],
    lists: wp.array2d[wp.int32],
    tile: wp.int32,
    end: wp.int32,
    bits: wp.int32,
    p: wp.vec3f,
    n: wp.vec3f,
) -> bool:
    """Return whether a moving object may shadow a point from one of the first lamps of a tile."""
    for k in range(end):
        i = nonnegative(lists[tile, k + 1])
        if may_be_shadowed(lamps[0].shadow[i], bits):
            d = lamps[0].position[i] - p
            to = d * (1.0 / wp.sqrt(maximum(dot(d, d), 1.0e-4)))
            if lamp_shadow(lamps, i, p, n, to)[1] < 1.0:
                return True
    return False


@wp.func
def is_lamp_light_known(
    air: wp.array[Air],
    previous: wp.array[PreviousFrame],
    lamps: wp.array[Lamps],
    lists: wp.array2d[wp.int32],
    i: wp.int32,
    tile: wp.int32,
    phase: wp.int32,
    p: wp.vec3f,
    n: wp.vec3f,
) -> bool:
    """Return whether the light of a tile's static lamps on a sample equals that of the earlier frame."""
    static_count = lists[tile, STATIC_LAMPS]
    if i >= previous[0].shared_count or static_count == 0:
        return False
    bits = previous[0].tiles[tile]
    if (bits & SAME_STATIC_LAMPS) == 0 or previous[0].lamp_known[i] == wp.uint8(0):
        return False
    if phase >= 0 and last_leaf_step(phase, air[0].leaf_step) != last_leaf_step(phase, previous[0].leaf_step):
        return False
    return (bits & UNSHADOWED) != 0 or not lamps_shadowed(lamps, lists, tile, static_count, bits, p, n)
