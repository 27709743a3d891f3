"""Glow: light of lamps scattered by fog, rain and dust, which gives each lamp a halo and a cone.

Along a line of sight that passes a lamp at a distance of h metres, light that falls off with the square of the distance
integrates to the angle that the line subtends at the lamp, divided by h. With this closed form no ray marching is
needed.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.atmosphere.air import Air, decay
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.tile_list_kernels import MAX_PER_TILE, Lamps
from recipe_runtime.render.numeric.noise import smoothstep
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.numeric.vectors import dot
from recipe_runtime.render.raster.label_kernels import TILE
from recipe_runtime.render.scene.pinhole import Pinhole

wp.set_module_options(OPTIONS)

MAX_RADIUS = wp.constant(wp.float32(5.0))  # metres from a lamp at which its glow has faded to 0
MAX_DISTANCE = wp.constant(wp.float32(70.0))  # metres from the eye, likewise
MIN_RADIUS = wp.constant(wp.float32(0.12))  # metres, the radius of a lamp's glass
SATURATION = wp.constant(wp.float32(12.0))  # per unit of power: bright lamps glow less than their strength


@wp.func
def arctangent(x: wp.float32) -> wp.float32:
    """Return the arc tangent of x, to 0.002 radians (Rajan and others, 2006)."""
    a = maximum(x, -x)
    t = a
    if a > 1.0:
        t = 1.0 / a
    r = 0.7853982 * t + t * (1.0 - t) * (0.2447 + 0.0663 * t)
    if a > 1.0:
        r = 1.5707964 - r
    if x < 0.0:
        r = -r
    return r


@wp.kernel
def cull_glows(
    pinhole: Pinhole,
    view_from_world: wp.array2d[wp.float32],
    lamps: wp.array[Lamps],
    out_lists: wp.array2d[wp.int32],
):
    """List the lamps whose glow may be visible within a tile; entry 0 is the count."""
    tile = wp.tid()
    columns = (pinhole.width + TILE - 1) / TILE
    focal = wp.float32(pinhole.focal)
    middle_x = (wp.float32((tile % columns) * TILE + TILE / 2) - wp.float32(pinhole.cx)) / focal
    middle_y = (wp.float32((tile / columns) * TILE + TILE / 2) - wp.float32(pinhole.cy)) / focal
    half = 0.75 * wp.float32(TILE) / focal
    n = wp.int32(0)
    for i in range(lamps[0].count):
        p = lamps[0].position[i]
        x = (
            (view_from_world[0, 0] * p[0] + view_from_world[0, 1] * p[1])
            + view_from_world[0, 2] * p[2]
            + view_from_world[0, 3]
        )
        y = (
            (view_from_world[0, 4] * p[0] + view_from_world[0, 5] * p[1])
            + view_from_world[0, 6] * p[2]
            + view_from_world[0, 7]
        )
        z = (
            (view_from_world[0, 8] * p[0] + view_from_world[0, 9] * p[1])
            + view_from_world[0, 10] * p[2]
            + view_from_world[0, 11]
        )
        # Distance of the lamp from the tile's centre, in the plane across the optical axis.
        depth = maximum(z, 0.0)
        dx = x - middle_x * depth
        dy = y - middle_y * depth
        reach = MAX_RADIUS * wp.sqrt(1.0 + middle_x * middle_x + middle_y * middle_y) + half * depth
        if z > -MAX_RADIUS and z < MAX_DISTANCE and dx * dx + dy * dy < reach * reach and n < MAX_PER_TILE:
            n = n + 1
            out_lists[tile, n] = i
    out_lists[tile, 0] = n


@wp.func
def extinction_at(air: wp.array[Air], z: wp.float32, distance: wp.float32) -> wp.float32:
    """Return the extinction coefficient of the air at a height and a distance from the eye, 1/m."""
    begun = clamp01((distance - air[0].fog_start) * 0.1 + 1.0)
    return air[0].haze + air[0].fog * begun * decay(air, maximum(z, 0.0) * air[0].fog_falloff)


@wp.func
def lamp_glow(
    air: wp.array[Air],
    lamps: wp.array[Lamps],
    lists: wp.array2d[wp.int32],
    tile: wp.int32,
    eye: wp.vec3f,
    sight: wp.vec3f,
    distance: wp.float32,
) -> wp.vec3f:
    """Return the light of a tile's lamps that the air within `distance` metres scatters into a line of sight."""
    total = wp.vec3f(0.0, 0.0, 0.0)
    for k in range(lists[tile, 0]):
        i = lists[tile, k + 1]
        to = lamps[0].position[i] - eye
        along = dot(to, sight)
        apart = dot(to, to)
        beside = maximum(apart - along * along, 0.0)
        edge = (1.0 - beside * (1.0 / (MAX_RADIUS * MAX_RADIUS))) * (
            1.0 - apart * (1.0 / (MAX_DISTANCE * MAX_DISTANCE))
        )
        if beside < MAX_RADIUS * MAX_RADIUS and apart < MAX_DISTANCE * MAX_DISTANCE:
            h = wp.sqrt(beside + MIN_RADIUS * MIN_RADIUS)
            seen = arctangent((distance - along) / h) + arctangent(along / h)
            near = minimum(maximum(along, 0.0), distance)
            q = sight * near - to  # from the lamp to the nearest point of the line of sight
            r = 1.0 / wp.sqrt(dot(q, q) + MIN_RADIUS * MIN_RADIUS)
            cone = lamps[0].cone[i]
            within = smoothstep(cone[0] - 0.25, cone[1], dot(q, lamps[0].direction[i]) * r)
            # A line of sight crosses a narrow beam quickly; the rest of the lamp's flux is scattered to all sides.
            beam = 0.65 * within * wp.sqrt(maximum(1.0 - cone[0] * cone[0], 0.0)) + 0.3 * (1.0 - cone[0])
            sigma = extinction_at(air, lamps[0].position[i][2], near)
            share = sigma * air[0].glow_share * decay(air, sigma * near) * seen * edge * edge / h * beam
            power = lamps[0].power[i]
            total = total + power * (share / (1.0 + power[0] * SATURATION))
    return total


@wp.func
def add_glow(
    air: wp.array[Air],
    lamps: wp.array[Lamps],
    lists: wp.array2d[wp.int32],
    tile: wp.int32,
    eye: wp.vec3f,
    d: wp.vec3f,
    distance: wp.float32,
    radiance: wp.vec3f,
) -> wp.vec3f:
    """Add the glow of a tile's lamps along a unit direction to a radiance."""
    if air[0].glow_share > 0.0:
        radiance = radiance + lamp_glow(air, lamps, lists, tile, eye, d, distance)
    return radiance
