"""Minimum, maximum, clamping and non-negative indices in kernels.

Warp's own `min` and `max` handle NaN, which costs five CPU instructions instead of one; these return the first number
unless the second is smaller or larger.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.func
def minimum(a: wp.float32, b: wp.float32) -> wp.float32:
    """Return the smaller of two numbers."""
    return wp.where(b < a, b, a)


@wp.func
def maximum(a: wp.float32, b: wp.float32) -> wp.float32:
    """Return the larger of two numbers."""
    return wp.where(b > a, b, a)


@wp.func
def clamp01(t: wp.float32) -> wp.float32:
    """Clamp t to [0, 1]."""
    return minimum(maximum(t, 0.0), 1.0)


@wp.func
def nonnegative(i: wp.int32) -> wp.int32:
    """Return i, which must not be negative, in a form that the compiler recognises as such.

    Warp lets negative indices count from an array's end, and tests every access for them; this form needs no test.
    """
    return i & 0x7FFFFFFF
