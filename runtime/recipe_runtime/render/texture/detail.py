"""Detail: the result of a pattern at a point, and filtered shapes for patterns.

All are analytic and averaged over a pixel's footprint, which prevents aliasing at a distance.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.numeric.vectors import normalize

wp.set_module_options(OPTIONS)


@wp.struct
class Detail:
    """The result of a pattern at a point; `code` is a hash that identifies a window."""

    tone: wp.float32
    second: wp.float32
    wear: wp.float32
    parameter: wp.float32  # paved ground: the pixel's footprint in metres; windows: see `window`
    code: wp.uint32
    normal: wp.vec3f


@wp.func
def fade(width: wp.float32, footprint: wp.float32) -> wp.float32:
    """Return the contrast left of a feature `width` metres wide in pixels `footprint` wide: 1 near, 0 far away."""
    return clamp01(1.5 - 2.0 * footprint / width)


@wp.func
def joint_share(t: wp.float32, half: wp.float32, footprint: wp.float32) -> wp.float32:
    """Return the share of a pixel covered by joints 2 half wide at whole numbers; box-filtered, so exact on average."""
    w = maximum(footprint, 1.0e-4) * 0.5
    low = t - w + half
    high = t + w + half
    a = wp.float32(floor(low)) * 2.0 * half + minimum(low - wp.float32(floor(low)), 2.0 * half)
    b = wp.float32(floor(high)) * 2.0 * half + minimum(high - wp.float32(floor(high)), 2.0 * half)
    return clamp01((b - a) / (2.0 * w))


@wp.func
def union_share(a: wp.float32, b: wp.float32) -> wp.float32:
    """Return the share covered by at least one of two independent shares."""
    return a + b - a * b


@wp.func
def tiles(
    uv: wp.vec2f, width: wp.float32, height: wp.float32, gap: wp.float32, bond: wp.float32, foot: wp.float32
) -> wp.vec3f:
    """Return, for courses of stones, the share of joint, the tone of the stone in [0, 1), and that tone's contrast."""
    v = uv[1] / height
    course = floor(v)
    u = uv[0] / width + bond * wp.float32(course & 1)
    mortar = union_share(
        joint_share(u, 0.5 * gap / width, foot / width), joint_share(v, 0.5 * gap / height, foot / height)
    )
    return wp.vec3f(mortar, unit(hash2(floor(u), course, seeds.TILE_TONE)), fade(height, foot))


@wp.func
def lean(n: wp.vec3f, u: wp.float32, v: wp.float32) -> wp.vec3f:
    """Return a unit normal tilted by the slopes of a relief along u, which is level, and v of texture coordinates."""
    across = n[0] * n[0] + n[1] * n[1]
    flat = across < 1.0e-4
    s = 1.0 / wp.sqrt(wp.where(flat, 1.0, across))
    x = wp.where(flat, 1.0, -n[1] * s)
    y = wp.where(flat, 0.0, n[0] * s)
    return normalize(
        wp.vec3f(n[0] - x * u + n[2] * y * v, n[1] - y * u - n[2] * x * v, n[2] - (n[0] * y - n[1] * x) * v)
    )


@wp.func
def bevel(t: wp.float32, rim: wp.float32) -> wp.float32:
    """Return -1 to 1, the slope of a stone's rounded edges: t is the place in [0, 1), and rim the share of an edge."""
    return maximum((rim - t) / rim, 0.0) - maximum((t - 1.0 + rim) / rim, 0.0)
