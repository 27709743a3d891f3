"""Procedural patterns: the appearance of surfaces at close range, from texture coordinates, faded with distance.

A pattern returns a tone (a factor of the base colour), the share of the surface's second colour (mortar, joints, sunlit
leaves), a wear, and a parameter of its kind. All patterns are analytic and filtered by the pixel's footprint, which
prevents aliasing at a distance.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import clamp01
from recipe_runtime.render.texture.cloth import is_cloth, worn
from recipe_runtime.render.texture.detail import Detail
from recipe_runtime.render.texture.green import is_plant, plant
from recipe_runtime.render.texture.ground import asphalt, kerb, lanes, paving, ripples, road_paint
from recipe_runtime.render.texture.lettering import letter, poster
from recipe_runtime.render.texture.vehicle import is_lamp, is_of_vehicle, vehicle
from recipe_runtime.render.texture.wall import boards, bricks, panels, planks, roof_tiles, stones, wall
from recipe_runtime.render.texture.window import curtain_wall, facade, shop_window, window

wp.set_module_options(OPTIONS)


@wp.func
def pavement(d: Detail, pattern: wp.int32, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Slabs, setts, plates or kerb stones."""
    if pattern == Pattern.KERB:
        return kerb(d, uv, p, foot)
    size = wp.vec2f(0.6, 0.4)
    gap = wp.float32(0.012)
    bond = wp.float32(0.5)
    if pattern == Pattern.SETTS:
        size = wp.vec2f(0.11, 0.1)
        gap = 0.014
    elif pattern == Pattern.PLATES:
        size = wp.vec2f(1.5, 1.5)
        gap = 0.018
        bond = 0.0
    return paving(d, uv, p, foot, size, gap, bond)


@wp.func
def masonry(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Dressed stones of a wall, or of paving, which wears and collects dirt and water."""
    if d.normal[2] > 0.9:
        return paving(d, uv, p, foot, wp.vec2f(0.9, 0.42), 0.014, 0.5)
    return stones(d, uv, p, foot)


@wp.func
def timber(d: Detail, pattern: wp.int32, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """Horizontal boards or upright planks."""
    if pattern == Pattern.CLAPBOARD:
        return boards(d, uv, foot)
    return planks(d, uv, foot)


@wp.func
def front(d: Detail, pattern: wp.int32, uv: wp.vec2f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """A pane of a curtain wall or of a shop."""
    if pattern == Pattern.CURTAIN_WALL:
        return curtain_wall(d, uv, sight, foot)
    return shop_window(d, uv, sight, foot)


@wp.func
def print_of(d: Detail, pattern: wp.int32, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A letter or a poster."""
    if pattern == Pattern.LETTER:
        return letter(d, uv, foot)
    return poster(d, uv, foot)


@wp.func
def plain_tone(pattern: wp.int32, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32, surface: wp.uint32) -> wp.float32:
    """Return the tone of a pattern that has nothing else; 1 for a surface without a pattern."""
    tone = wp.float32(1.0)
    if pattern == Pattern.NICHE:
        tone = 1.0 - 0.62 * clamp01(uv[1])
    return tone


@wp.func
def detail_of(
    pattern: wp.int32,
    uv: wp.vec2f,
    p: wp.vec3f,
    normal: wp.vec3f,
    sight: wp.vec3f,
    footprint: wp.vec2f,
    surface: wp.uint32,
) -> Detail:
    """Return the pattern at a point of the world, seen along the unit direction `sight`.

    `footprint` is the size of a pixel there, across and along the line of sight.
    """
    d = Detail()
    d.tone = 1.0
    d.normal = normal
    d.parameter = 0.5
    d.code = surface
    # Return early: Warp copies the values that a branch assigns at its end.
    foot = 0.5 * (footprint[1] + wp.sqrt(footprint[0] * footprint[1]))
    if pattern == Pattern.ASPHALT:
        return asphalt(d, p, foot)
    elif pattern == Pattern.LANES:
        return lanes(d, uv, p, foot)
    elif pattern == Pattern.SLABS or (pattern >= Pattern.SETTS and pattern <= Pattern.KERB):
        return pavement(d, pattern, uv, p, foot)
    elif pattern == Pattern.PANELS:
        return panels(d, uv, p, foot)
    elif pattern == Pattern.ROAD_PAINT:
        return road_paint(d, p, foot)
    elif pattern == Pattern.BRICK:
        return bricks(d, uv, p, foot)
    elif pattern == Pattern.PLASTER:
        return wall(d, uv, p, foot, 0.10)
    elif pattern == Pattern.CONCRETE:
        return wall(d, uv, p, foot, 0.18)
    elif is_plant(pattern):
        return plant(d, pattern, uv, p, foot)
    elif pattern == Pattern.WINDOW:
        return window(d, uv, sight, foot)
    elif pattern == Pattern.ROOF:
        return roof_tiles(d, uv, p, foot)
    elif pattern == Pattern.STONE:
        return masonry(d, uv, p, foot)
    elif pattern == Pattern.CLAPBOARD or pattern == Pattern.WOOD:
        return timber(d, pattern, uv, foot)
    elif pattern == Pattern.CURTAIN_WALL or pattern == Pattern.SHOP_WINDOW:
        return front(d, pattern, uv, sight, foot)
    elif pattern == Pattern.FACADE:
        return facade(d, uv, p, foot)
    elif pattern == Pattern.LETTER or pattern == Pattern.POSTER:
        return print_of(d, pattern, uv, foot)
    elif pattern == Pattern.WATER:
        return ripples(d, p, foot)
    elif is_lamp(pattern) or is_of_vehicle(pattern) or pattern == Pattern.NUMBER_PLATE:
        return vehicle(d, pattern, uv, p, sight, foot)
    elif is_cloth(pattern) or pattern == Pattern.HAIR:
        return worn(d, pattern, uv, foot, surface)
    d.tone = plain_tone(pattern, uv, p, foot, surface)
    return d
