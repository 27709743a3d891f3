"""Detail: what a pattern says of a point, and the filtered shapes that patterns are drawn with.

All are analytic, and averaged over a pixel's footprint, so that nothing aliases at a distance.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum

wp.set_module_options(OPTIONS)


@wp.struct
class Detail:
    """A pattern at a point; `code` is a hash that names the window."""

    tone: wp.float32
    second: wp.float32
    wear: wp.float32
    parameter: wp.float32  # of paved ground, the pixel's footprint, m; of windows, see those
    code: wp.uint32
    normal: wp.vec3f


@wp.func
def fade(width: wp.float32, footprint: wp.float32) -> wp.float32:
    """How much of a feature `width` metres wide is left in pixels `footprint` wide: 1 close by, 0 far off."""
    return clamp01(1.5 - 2.0 * footprint / width)


@wp.func
def joint_share(t: wp.float32, half: wp.float32, footprint: wp.float32) -> wp.float32:
    """Share of a pixel that lies on joints 2 half wide, one at each whole number; box-filtered, so exact on average."""
    w = maximum(footprint, 1.0e-4) * 0.5
    low = t - w + half
    high = t + w + half
    a = wp.float32(floor(low)) * 2.0 * half + minimum(low - wp.float32(floor(low)), 2.0 * half)
    b = wp.float32(floor(high)) * 2.0 * half + minimum(high - wp.float32(floor(high)), 2.0 * half)
    return clamp01((b - a) / (2.0 * w))


@wp.func
def tiles(
    uv: wp.vec2f, width: wp.float32, height: wp.float32, gap: wp.float32, bond: wp.float32, foot: wp.float32
) -> wp.vec3f:
    """Courses of stones: the share of joint, a tone of the stone in [0, 1), and how much of that tone is left."""
    v = uv[1] / height
    course = floor(v)
    u = uv[0] / width + bond * wp.float32(course & 1)
    mortar = maximum(joint_share(u, 0.5 * gap / width, foot / width), joint_share(v, 0.5 * gap / height, foot / height))
    return wp.vec3f(mortar, unit(hash2(floor(u), course, seeds.TILE_TONE)), fade(height, foot))


@wp.func
def union_share(a: wp.float32, b: wp.float32) -> wp.float32:
    """The share covered by at least one of two things that lie independently."""
    return a + b - a * b
