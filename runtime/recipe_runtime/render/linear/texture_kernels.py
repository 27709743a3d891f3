"""Kernels of textures: linear light, mip levels with and without rounding, and exchange with planes of tensors.

Values are float64 and sums have a fixed order, so that a CPU and a GPU give equal bytes. A texture is [h * w], row by
row; its mip levels are [T], finest first.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)

INTERVALS = 255  # of the table of linear light, whose nodes are the 8-bit values
_TOP = wp.constant(INTERVALS)
_SPAN = wp.constant(wp.float64(255.0))
_ZERO = wp.constant(wp.float64(0.0))
_HALF = wp.constant(wp.float64(0.5))
_ONE = wp.constant(wp.float64(1.0))
_TWO = wp.constant(wp.float64(2.0))
_THREE = wp.constant(wp.float64(3.0))


@wp.func
def decoded(value: wp.float64, light: wp.array[wp.float64], slope: wp.array[wp.float64]) -> wp.vec2d:
    """Return the linear light of an sRGB value, and its derivative, which is 0 outside 0 to 1.

    Both are exact at 8-bit values; between them, light is a cubic Hermite interpolation with the sRGB curve's slopes.
    """
    t = wp.min(wp.max(value, _ZERO), _ONE) * _SPAN
    i = wp.min(wp.int32(t), _TOP - 1)
    t = t - wp.float64(i)
    a = light[i]
    b = light[i + 1]
    p = slope[i]
    q = slope[i + 1]
    c = _THREE * (b - a) - _TWO * p - q
    d = _TWO * (a - b) + p + q
    derivative = (p + t * (_TWO * c + t * _THREE * d)) * _SPAN
    if value < _ZERO or value > _ONE:
        derivative = _ZERO
    return wp.vec2d(a + t * (p + t * (c + t * d)), derivative)


@wp.kernel
def decode_texture(
    texture: wp.array[wp.vec3d],
    light: wp.array[wp.float64],
    slope: wp.array[wp.float64],
    out_light: wp.array[wp.vec3d],
    out_slope: wp.array[wp.vec3d],
):
    """Write the linear light of an sRGB texture, and its derivative."""
    k = wp.tid()
    r = decoded(texture[k][0], light, slope)
    g = decoded(texture[k][1], light, slope)
    b = decoded(texture[k][2], light, slope)
    out_light[k] = wp.vec3d(r[0], g[0], b[0])
    out_slope[k] = wp.vec3d(r[1], g[1], b[1])


@wp.kernel
def halve_level(
    sums: wp.array[wp.vec3d],
    finer: wp.int32,
    width: wp.int32,
    height: wp.int32,
    coarser: wp.int32,
    out_sums: wp.array[wp.vec3d],
):
    """Write the sums of 2 x 2 texels of a level, its columns first; at odd ends, of those that exist."""
    k = wp.tid()
    wide = (width + 1) / 2
    x = 2 * (k % wide)
    y = 2 * (k / wide)
    i = finer + y * width + x
    total = sums[i]
    if y + 1 < height:
        total = total + sums[i + width]
    if x + 1 < width:
        right = sums[i + 1]
        if y + 1 < height:
            right = right + sums[i + 1 + width]
        total = total + right
    out_sums[coarser + k] = total


@wp.kernel
def mean_texels(sums: wp.array[wp.vec3d], counts: wp.array[wp.float64], out_texels: wp.array[wp.vec3d]):
    """Write the means of texels."""
    t = wp.tid()
    out_texels[t] = sums[t] / counts[t]


@wp.kernel
def spread_level(
    gradient: wp.array[wp.vec3d],
    counts: wp.array[wp.float64],
    totals: wp.array[wp.vec3d],
    finer: wp.int32,
    width: wp.int32,
    coarser: wp.int32,
    out_totals: wp.array[wp.vec3d],
):
    """Write the gradient of the sums of a level: that of the next level's sums, then that of its own texels.

    The last level has none after it: `coarser` is then -1.
    """
    k = wp.tid()
    wide = (width + 1) / 2
    above = wp.vec3d(_ZERO, _ZERO, _ZERO)
    if coarser >= 0:
        above = totals[coarser + (k / width) / 2 * wide + (k % width) / 2]
    out_totals[finer + k] = above + gradient[finer + k] / counts[finer + k]


@wp.func
def packed(red: wp.int32, green: wp.int32, blue: wp.int32) -> wp.uint32:
    """Return a texel: red, green << 8, blue << 16."""
    return wp.uint32(red | (green << 8) | (blue << 16))


@wp.func
def nearest_level(total: wp.float64, count: wp.float64, middles: wp.array[wp.int64]) -> wp.int32:
    """Return the 8-bit level whose linear light is nearest to a mean, as `mipmaps.mip_levels` does.

    Args:
        total: Sum of linear light, a whole number.
        count: Number of its terms.
        middles: Sums of the linear light of neighbouring levels, ascending, [255].
    """
    n = wp.int64(count)
    twice = (wp.int64(2) * wp.int64(total) + n - wp.int64(1)) / n
    first = wp.int32(0)
    last = wp.int32(255)
    while first < last:
        middle = (first + last) / 2
        if middles[middle] < twice:
            first = middle + 1
        else:
            last = middle
    return first


@wp.kernel
def round_texture(
    texture: wp.array[wp.vec3d],
    linear: wp.array[wp.float64],
    out_sums: wp.array[wp.vec3d],
    out_texels: wp.array[wp.uint32],
):
    """Write the 8-bit texels of an sRGB texture, rounded, halves up, and their linear light, whole numbers."""
    k = wp.tid()
    colour = texture[k] * _SPAN
    r = wp.int32(colour[0] + _HALF)
    g = wp.int32(colour[1] + _HALF)
    b = wp.int32(colour[2] + _HALF)
    out_sums[k] = wp.vec3d(linear[r], linear[g], linear[b])
    out_texels[k] = packed(r, g, b)


@wp.kernel
def round_means(
    sums: wp.array[wp.vec3d],
    counts: wp.array[wp.float64],
    middles: wp.array[wp.int64],
    after: wp.int32,
    first: wp.int32,
    out_texels: wp.array[wp.uint32],
):
    """Write the 8-bit texels of all levels after the first `after` texels; `first` is the place of texel 0."""
    t = after + wp.tid()
    r = nearest_level(sums[t][0], counts[t], middles)
    g = nearest_level(sums[t][1], counts[t], middles)
    b = nearest_level(sums[t][2], counts[t], middles)
    out_texels[first + t] = packed(r, g, b)


@wp.kernel
def take_planes(planes: wp.array[wp.float64], places: wp.array[wp.int32], out_vectors: wp.array[wp.vec3d]):
    """Write the colours of some places of an image whose three channels are stored one after the other."""
    k = wp.tid()
    i = places[k]
    size = planes.shape[0] / 3
    out_vectors[k] = wp.vec3d(planes[i], planes[size + i], planes[2 * size + i])


@wp.kernel
def put_planes(vectors: wp.array[wp.vec3d], places: wp.array[wp.int32], out_planes: wp.array[wp.float64]):
    """Write colours at some places of an image, the inverse of `take_planes`."""
    k = wp.tid()
    i = places[k]
    size = out_planes.shape[0] / 3
    out_planes[i] = vectors[k][0]
    out_planes[size + i] = vectors[k][1]
    out_planes[2 * size + i] = vectors[k][2]


@wp.kernel
def put_bytes(rgb: wp.array[wp.uint8], out_planes: wp.array[wp.float32]):
    """Write the bytes of a picture, divided by 255, channel after channel."""
    i = wp.tid()
    size = out_planes.shape[0] / 3
    for c in range(3):
        out_planes[c * size + i] = wp.float32(rgb[3 * i + c]) / 255.0


@wp.kernel
def put_shares(rgb: wp.array[wp.uint8], out_planes: wp.array[wp.float64]):
    """Write the bytes of a picture, divided by 255, as float64, channel after channel."""
    i = wp.tid()
    size = out_planes.shape[0] / 3
    for c in range(3):
        out_planes[c * size + i] = wp.float64(rgb[3 * i + c]) / _SPAN
