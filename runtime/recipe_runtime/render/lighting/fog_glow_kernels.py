"""Glow: the lamps' light that fog, rain and dust scatter towards the eye, so that each lamp has a halo and a cone.

Along a sight that passes a lamp at h metres, light that falls off with the square of distance adds up to the angle
under which the lamp sees the way, over h. That closed form takes one sum a lamp, and no steps through the air.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.air import Air, decay
from recipe_runtime.render.lighting.tile_list_kernels import MOST, Lamps
from recipe_runtime.render.numeric.noise import step_between
from recipe_runtime.render.numeric.scalars import clamp01, greater, lesser
from recipe_runtime.render.numeric.vectors import inner
from recipe_runtime.render.raster.label_kernels import TILE
from recipe_runtime.render.scene.camera import Lens

wp.set_module_options(OPTIONS)

WIDEST = wp.constant(wp.float32(5.0))  # metres beside a lamp at which its glow has faded to nothing
FARTHEST = wp.constant(wp.float32(70.0))  # metres from the eye, likewise
SMALLEST = wp.constant(wp.float32(0.12))  # metres, the radius of a lamp's glass
BLINDING = wp.constant(wp.float32(12.0))  # per unit of power: bright lamps glow less than their strength


@wp.func
def angle_of(x: wp.float32) -> wp.float32:
    """The arc tangent of x, to 0.002 radians (Rajan and others, 2006)."""
    a = greater(x, -x)
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
def gather(
    lens: Lens,
    view: wp.array2d[wp.float32],
    lamps: wp.array[Lamps],
    lists: wp.array2d[wp.int32],
):
    """List the lamps whose glow may be seen within a tile; entry 0 is the count."""
    tile = wp.tid()
    columns = (lens.width + TILE - 1) / TILE
    focal = wp.float32(lens.focal)
    middle_x = (wp.float32((tile % columns) * TILE + TILE / 2) - wp.float32(lens.cx)) / focal
    middle_y = (wp.float32((tile / columns) * TILE + TILE / 2) - wp.float32(lens.cy)) / focal
    half = 0.75 * wp.float32(TILE) / focal
    n = wp.int32(0)
    for i in range(lamps[0].count):
        p = lamps[0].position[i]
        x = (view[0, 0] * p[0] + view[0, 1] * p[1]) + view[0, 2] * p[2] + view[0, 3]
        y = (view[0, 4] * p[0] + view[0, 5] * p[1]) + view[0, 6] * p[2] + view[0, 7]
        z = (view[0, 8] * p[0] + view[0, 9] * p[1]) + view[0, 10] * p[2] + view[0, 11]
        # How far the lamp stands beside the tile's middle, in the plane across the optical axis.
        depth = greater(z, 0.0)
        dx = x - middle_x * depth
        dy = y - middle_y * depth
        reach = WIDEST * wp.sqrt(1.0 + middle_x * middle_x + middle_y * middle_y) + half * depth
        if z > -WIDEST and z < FARTHEST and dx * dx + dy * dy < reach * reach and n < MOST:
            n = n + 1
            lists[tile, n] = i
    lists[tile, 0] = n


@wp.func
def murk(air: wp.array[Air], z: wp.float32, distance: wp.float32) -> wp.float32:
    """Extinction of the air at a height and a distance from the eye, 1/m."""
    begun = clamp01((distance - air[0].fog_start) * 0.1 + 1.0)
    return air[0].haze + air[0].fog * begun * decay(air, greater(z, 0.0) * air[0].fog_thin)


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
    """The light of a tile's lamps that the air before `distance` metres scatters into a sight."""
    total = wp.vec3f(0.0, 0.0, 0.0)
    for k in range(lists[tile, 0]):
        i = lists[tile, k + 1]
        to = lamps[0].position[i] - eye
        along = inner(to, sight)
        apart = inner(to, to)
        beside = greater(apart - along * along, 0.0)
        edge = (1.0 - beside * (1.0 / (WIDEST * WIDEST))) * (1.0 - apart * (1.0 / (FARTHEST * FARTHEST)))
        if beside < WIDEST * WIDEST and apart < FARTHEST * FARTHEST:
            h = wp.sqrt(beside + SMALLEST * SMALLEST)
            seen = angle_of((distance - along) / h) + angle_of(along / h)
            near = lesser(greater(along, 0.0), distance)
            q = sight * near - to  # from the lamp to the nearest point of the way
            r = 1.0 / wp.sqrt(inner(q, q) + SMALLEST * SMALLEST)
            cone = lamps[0].cone[i]
            within = step_between(cone[0] - 0.25, cone[1], inner(q, lamps[0].direction[i]) * r)
            # A narrow beam is soon crossed; the rest of a lamp's flux, thrown about, glows on all sides.
            beam = 0.65 * within * wp.sqrt(greater(1.0 - cone[0] * cone[0], 0.0)) + 0.3 * (1.0 - cone[0])
            sigma = murk(air, lamps[0].position[i][2], near)
            share = sigma * air[0].glow * decay(air, sigma * near) * seen * edge * edge / h * beam
            power = lamps[0].power[i]
            total = total + power * (share / (1.0 + power[0] * BLINDING))
    return total
