"""Bloom: the light that the lens spreads around bright points, a blurred image of low resolution."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.kernel
def downsample(
    hdr_image: wp.array[wp.vec3f], wide: wp.int32, high: wp.int32, side: wp.int32, columns: wp.int32,
    out_light: wp.array[wp.vec3f],
):  # fmt: skip
    """Write the mean of a square of samples."""
    i = wp.tid()
    x0 = i % columns * side
    y0 = i / columns * side
    total = wp.vec3f(0.0, 0.0, 0.0)
    count = wp.float32(0.0)
    for y in range(y0, wp.min(y0 + side, high)):
        for x in range(x0, wp.min(x0 + side, wide)):
            total = total + hdr_image[y * wide + x]
            count = count + 1.0
    out_light[i] = total / count


@wp.kernel
def blur_rows(
    light: wp.array[wp.vec3f], weights: wp.array[wp.float32], wide: wp.int32, high: wp.int32, across: wp.int32,
    out_light: wp.array[wp.vec3f],
):  # fmt: skip
    """Blur along rows (across = 1) or columns (across = 0); samples of the border are repeated beyond it."""
    i = wp.tid()
    x = i % wide
    y = i / wide
    reach = (weights.shape[0] - 1) / 2
    total = wp.vec3f(0.0, 0.0, 0.0)
    for n in range(-reach, reach + 1):
        u = wp.min(wp.max(x + n * across, 0), wide - 1)
        v = wp.min(wp.max(y + n * (1 - across), 0), high - 1)
        total = total + light[v * wide + u] * weights[n + reach]
    out_light[i] = total
