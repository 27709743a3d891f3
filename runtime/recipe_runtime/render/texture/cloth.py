"""Patterns of people: folds, stripes, checks and prints of cloth, denim, reflecting bands, and strands of hair.

`uv` is in metres: u around the body, 0 in the middle of the front, v upwards. On the trunk v is 0 at the shoulders.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import noise2
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.numeric.vectors import normalize
from recipe_runtime.render.texture.detail import Detail, fade, joint_share, union_share

wp.set_module_options(OPTIONS)

STEP = wp.constant(0.006)  # metres over which the slope of a fold is measured


@wp.func
def is_cloth(pattern: wp.int32) -> bool:
    """Return whether a surface is cloth."""
    return pattern == Pattern.CLOTH or (pattern >= Pattern.STRIPES and pattern <= Pattern.VEST)


@wp.func
def fold(u: wp.float32, v: wp.float32, surface: wp.uint32) -> wp.float32:
    """Return the height of folds, in [0, 1): long slanting ones and short creases across them."""
    long = noise2((u + 0.45 * v) * 17.0, v * 4.5, surface ^ seeds.CLOTH_FOLD)
    across = noise2(u * 8.0 - 2.0 * v, (v + 0.3 * u) * 26.0, surface ^ seeds.CLOTH_CREASE)
    return 0.62 * long + 0.38 * across


@wp.func
def band(x: wp.float32, middle: wp.float32, half: wp.float32, foot: wp.float32) -> wp.float32:
    """Return the share of a pixel within a band."""
    w = 0.5 * maximum(foot, 0.001)
    return clamp01((minimum(x + w, middle + half) - maximum(x - w, middle - half)) / (2.0 * w))


@wp.func
def cloth(d: Detail, pattern: wp.int32, uv: wp.vec2f, foot: wp.float32, surface: wp.uint32) -> Detail:
    """Cloth with folds, and the pattern of its kind in the second colour."""
    u = uv[0]
    v = uv[1]
    near = fade(0.09, foot)
    if near > 0.0:
        height = fold(u, v, surface)
        across = (fold(u + STEP, v, surface) - height) * near * 3.2
        along = (fold(u, v + STEP, surface) - height) * near * 3.2
        n = d.normal
        flat = maximum(wp.sqrt(n[0] * n[0] + n[1] * n[1]), 0.05)
        tx = -n[1] / flat
        ty = n[0] / flat
        d.normal = normalize(
            wp.vec3f(
                n[0] - across * tx,
                n[1] - across * ty,
                n[2] - along * flat,
            )
        )
        d.tone = 1.0 + 0.34 * (height - 0.5) * near
    if pattern == Pattern.STRIPES:
        d.second = joint_share(v / 0.05, 0.22, foot / 0.05)
    elif pattern == Pattern.CHECKS:
        d.second = 0.5 * (joint_share(u / 0.07, 0.22, foot / 0.07) + joint_share(v / 0.07, 0.22, foot / 0.07))
    elif pattern == Pattern.PRINT:
        disc = band(wp.sqrt(u * u + (v + 0.13) * (v + 0.13)), 0.0, 0.075, foot)
        text = band(v, -0.25, 0.018, foot) * band(u, 0.0, 0.10, foot)
        if foot < 0.006:
            text = text * (0.35 + 0.65 * joint_share(u / 0.024, 0.3, foot / 0.024))
        d.second = union_share(disc * (1.0 - band(u - v - 0.13, 0.0, 0.018, foot)), text)
    elif pattern == Pattern.DENIM:
        worn = noise2(u * 9.0, v * 5.0, seeds.DENIM)
        grain = noise2(u * 420.0, v * 160.0, seeds.DENIM) - 0.5
        d.second = clamp01(0.75 * worn - 0.15 + 0.5 * grain * fade(0.004, foot))
    elif pattern == Pattern.VEST:
        rings = union_share(band(v, -0.24, 0.026, foot), band(v, -0.36, 0.026, foot))
        straps = band(maximum(u, -u), 0.10, 0.024, foot) * band(v, -0.08, 0.14, foot)
        d.second = union_share(rings, straps)
    return d


@wp.func
def hair(d: Detail, uv: wp.vec2f, foot: wp.float32, surface: wp.uint32) -> Detail:
    """Strands of hair that run along v."""
    lock = noise2(uv[0] * 46.0, uv[1] * 5.0, surface) - 0.5
    strand = noise2(uv[0] * 260.0, uv[1] * 9.0, surface ^ seeds.HAIR_STRAND) - 0.5
    locks = lock * fade(0.03, foot)
    strands = strand * fade(0.006, foot)
    d.tone = 1.0 + 0.55 * locks + 0.5 * strands
    lean = 0.5 * locks + 0.35 * strands
    d.normal = normalize(d.normal + wp.vec3f(-d.normal[1] * lean, d.normal[0] * lean, 0.0))
    return d


@wp.func
def worn(d: Detail, pattern: wp.int32, uv: wp.vec2f, foot: wp.float32, surface: wp.uint32) -> Detail:
    """Cloth or hair."""
    if pattern == Pattern.HAIR:
        return hair(d, uv, foot, surface)
    return cloth(d, pattern, uv, foot, surface)
