"""Patterns of print: posters and letters."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, hash2, noise2, scramble, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum
from recipe_runtime.render.texture.detail import Detail, fade, joint_share, union_share

wp.set_module_options(OPTIONS)


@wp.func
def poster(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A printed poster, by its number: a disc over hills, or bands, and lines of text below."""
    i = floor(uv[0])
    fu = uv[0] - wp.float32(i)
    fv = uv[1] - wp.float32(floor(uv[1]))
    w = maximum(foot * 0.25, 0.003)
    code = hash2(i, 3, seeds.POSTER)
    cx = 0.3 + 0.4 * unit(code)
    cy = 0.52 + 0.2 * unit(scramble(code))
    r = 0.1 + 0.14 * unit(scramble(code + wp.uint32(1)))
    x = fu - cx
    y = (fv - cy) * 0.9
    disc = clamp01((r - wp.sqrt(x * x + y * y)) / w + 0.5)
    hill = 0.3 + 0.22 * noise2(fu * 3.0 + wp.float32(i), 0.5, code)
    ground = clamp01((hill - fv) / w + 0.5)
    if (code & wp.uint32(1)) == wp.uint32(1):
        ground = joint_share(fu * 5.0 + fv * 4.0, 0.5 * (0.2 + 0.4 * unit(code)), w * 6.0) * clamp01(
            (fv - 0.3) / w + 0.5
        )
    d.second = union_share(disc, 0.0) * (1.0 - 0.5 * ground)
    d.tone = 1.0 - 0.55 * ground
    if fv < 0.2:
        word = unit(hash2(floor(fu * 24.0), floor(fv * 15.0), code))
        line = joint_share(fv * 15.0 - 0.5, 0.28, w * 15.0) * clamp01(fu * 14.0 - 1.0) * clamp01(11.0 - fu * 14.0)
        ink = 0.5
        if word < 0.8:
            ink = 0.9
        if word < 0.2:
            ink = 0.0
        ink = 0.6 + (ink - 0.6) * fade(0.04, w)
        d.second = line * ink
        d.tone = 0.75
    margin = union_share(joint_share(uv[0], 0.02, w), joint_share(uv[1], 0.02, w))
    d.second = d.second + (1.0 - d.second) * margin
    d.tone = d.tone + (1.0 - d.tone) * margin
    near = fade(2.0, foot)
    d.second = 0.22 + (d.second - 0.22) * near
    d.tone = 0.84 + (d.tone - 0.84) * near
    return d


@wp.func
def ink_at(high: wp.int32, low: wp.int32, column: wp.int32, row: wp.int32) -> wp.float32:
    """Return 1 where a letter's dot is inked; rows count from the bottom, and there is no ink outside."""
    if column < 0 or column > 3 or row < 0 or row > 5:
        return 0.0
    half = high
    place = 4 * (row - 3) + 3 - column
    if row < 3:
        half = low
        place = 4 * row + 3 - column
    return wp.float32((half >> place) & 1)


@wp.func
def letter(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A letter's strokes: its dots, blended into each other, and cut where the blend is half."""
    high = floor(uv[0])
    low = floor(uv[1])
    x = (uv[0] - wp.float32(high)) * 4.0 - 0.5
    y = (uv[1] - wp.float32(low)) * 6.0 - 0.5
    i = floor(x)
    j = floor(y)
    fx = x - wp.float32(i)
    fy = y - wp.float32(j)
    below = ink_at(high, low, i, j) * (1.0 - fx) + ink_at(high, low, i + 1, j) * fx
    above = ink_at(high, low, i, j + 1) * (1.0 - fx) + ink_at(high, low, i + 1, j + 1) * fx
    ink = below + (above - below) * fy
    sharp = 1.0 / maximum(foot * 22.0, 0.12)
    d.second = clamp01((ink - 0.42) * maximum(sharp, 1.0) + 0.42)
    return d
