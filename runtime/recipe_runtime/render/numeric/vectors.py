"""Vectors in kernels, with a fixed order of operations in place of Warp's dot, length and normalize."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.func
def dot(a: wp.vec3f, b: wp.vec3f) -> wp.float32:
    """Return the dot product."""
    return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]


@wp.func
def cross(a: wp.vec3f, b: wp.vec3f) -> wp.vec3f:
    """Return the cross product."""
    return wp.vec3f(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@wp.func
def normalize(a: wp.vec3f) -> wp.vec3f:
    """Return a scaled to unit length; +z for the null vector."""
    # (A second `return` would pass the vector through memory in pieces, for which a CPU has to wait.)
    s = dot(a, a)
    null = s < 1.0e-20
    r = 1.0 / wp.sqrt(wp.where(null, 1.0, s))
    return wp.vec3f(wp.where(null, 0.0, a[0] * r), wp.where(null, 0.0, a[1] * r), wp.where(null, 1.0, a[2] * r))


@wp.func
def mix(a: wp.vec3f, b: wp.vec3f, t: wp.float32) -> wp.vec3f:
    """Interpolate linearly: a at t = 0, b at t = 1."""
    return wp.vec3f(a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t)


@wp.func
def multiply(a: wp.vec3f, b: wp.vec3f) -> wp.vec3f:
    """Multiply by components."""
    return wp.vec3f(a[0] * b[0], a[1] * b[1], a[2] * b[2])


@wp.func
def rotate(m: wp.array2d[wp.float32], row: wp.int32, v: wp.vec3f) -> wp.vec3f:
    """Rotate v by the 3x4 matrix in a row of m."""
    return wp.vec3f(
        (m[row, 0] * v[0] + m[row, 1] * v[1]) + m[row, 2] * v[2],
        (m[row, 4] * v[0] + m[row, 5] * v[1]) + m[row, 6] * v[2],
        (m[row, 8] * v[0] + m[row, 9] * v[1]) + m[row, 10] * v[2],
    )


@wp.func
def rotate_back(m: wp.array2d[wp.float32], row: wp.int32, v: wp.vec3f) -> wp.vec3f:
    """Rotate v by the inverse of the 3x4 matrix in a row of m."""
    return wp.vec3f(
        (m[row, 0] * v[0] + m[row, 4] * v[1]) + m[row, 8] * v[2],
        (m[row, 1] * v[0] + m[row, 5] * v[1]) + m[row, 9] * v[2],
        (m[row, 2] * v[0] + m[row, 6] * v[1]) + m[row, 10] * v[2],
    )


@wp.func
def transform_point(m: wp.array2d[wp.float32], part: wp.int32, v: wp.vec3f) -> wp.vec3f:
    """Transform a point from a part's frame by the matrix of the part in m."""
    return wp.vec3f(
        m[part, 0] * v[0] + m[part, 1] * v[1] + m[part, 2] * v[2] + m[part, 3],
        m[part, 4] * v[0] + m[part, 5] * v[1] + m[part, 6] * v[2] + m[part, 7],
        m[part, 8] * v[0] + m[part, 9] * v[1] + m[part, 10] * v[2] + m[part, 11],
    )


@wp.func
def box_extent(m: wp.array2d[wp.float32], part: wp.int32, half: wp.vec3f, n: wp.vec3f) -> wp.float32:
    """Return the extent, from its centre along n, of a box in a part's frame; n is in the target frame of m."""
    a = n[0] * m[part, 0] + n[1] * m[part, 4] + n[2] * m[part, 8]
    b = n[0] * m[part, 1] + n[1] * m[part, 5] + n[2] * m[part, 9]
    c = n[0] * m[part, 2] + n[1] * m[part, 6] + n[2] * m[part, 10]
    return wp.abs(a) * half[0] + wp.abs(b) * half[1] + wp.abs(c) * half[2]
