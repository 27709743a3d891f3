"""Kernels of linear algebra: sums and products of vectors, and products with sparse matrices, in float64."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.kernel
def add_vectors(a: wp.array[wp.vec3d], b: wp.array[wp.vec3d], out_sum: wp.array[wp.vec3d]):
    """Write a + b."""
    k = wp.tid()
    out_sum[k] = a[k] + b[k]


@wp.kernel
def subtract_vectors(a: wp.array[wp.vec3d], b: wp.array[wp.vec3d], out_difference: wp.array[wp.vec3d]):
    """Write a - b."""
    k = wp.tid()
    out_difference[k] = a[k] - b[k]


@wp.kernel
def multiply_vectors(a: wp.array[wp.vec3d], b: wp.array[wp.vec3d], out_product: wp.array[wp.vec3d]):
    """Write the product of each component of a with that of b."""
    k = wp.tid()
    out_product[k] = wp.vec3d(a[k][0] * b[k][0], a[k][1] * b[k][1], a[k][2] * b[k][2])


@wp.kernel
def multiply_rows(
    firsts: wp.array[wp.int32],
    columns: wp.array[wp.int32],
    weights: wp.array[wp.float64],
    x: wp.array[wp.vec3d],
    out_y: wp.array[wp.vec3d],
):
    """Multiply a sparse matrix (CSR) by a matrix of three columns; each row is summed in the order of its entries."""
    row = wp.tid()
    total = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    for e in range(firsts[row], firsts[row + 1]):
        total = total + x[columns[e]] * weights[e]
    out_y[row] = total
