"""Vertices and normals of moving bodies: rigid, or blended between several parts (linear blend skinning)."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.vectors import rotate, transform_point

wp.set_module_options(OPTIONS)

FULL = wp.constant(wp.float32(1.0 / 255.0))  # of a weight of 1


@wp.func
def blended_point(
    m: wp.array2d[wp.float32], parts: wp.vec4i, weights: wp.vec4f, origins: wp.array[wp.vec3f], v: wp.vec3f
) -> wp.vec3f:
    """Return the mean, by weight, of a point of the rest pose as each of its parts moves it.

    `origins` are those of the parts at rest, in the frame that the point is in.
    """
    total = wp.vec3f(0.0, 0.0, 0.0)
    for k in range(4):
        if weights[k] > 0.0:
            total = total + transform_point(m, parts[k], v - origins[parts[k]]) * weights[k]
    return total * FULL


@wp.func
def blended_normal(m: wp.array2d[wp.float32], parts: wp.vec4i, weights: wp.vec4f, n: wp.vec3f) -> wp.vec3f:
    """Return the mean, by weight, of a normal as each of its parts turns it; it is not of unit length."""
    total = wp.vec3f(0.0, 0.0, 0.0)
    for k in range(4):
        if weights[k] > 0.0:
            total = total + rotate(m, parts[k], n) * weights[k]
    return total * FULL
