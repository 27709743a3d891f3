"""The lesser and the greater of two numbers, a number kept within [0, 1], and an index that is not below 0.

Warp's own `min` and `max` mind NaN, which costs a CPU five instructions instead of one, in every pattern and every
light; here the second number counts only if it is beyond the first.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.func
def minimum(a: wp.float32, b: wp.float32) -> wp.float32:
    """The lesser of two numbers."""
    return wp.where(b < a, b, a)


@wp.func
def maximum(a: wp.float32, b: wp.float32) -> wp.float32:
    """The greater of two numbers."""
    return wp.where(b > a, b, a)


@wp.func
def clamp01(t: wp.float32) -> wp.float32:
    """t, kept within [0, 1]."""
    return minimum(maximum(t, 0.0), 1.0)


@wp.func
def nonnegative(i: wp.int32) -> wp.int32:
    """i >= 0, in a form that shows it.

    Warp lets an index count from an array's end, and so tests every access for it; this form needs no test.
    """
    return i & 0x7FFFFFFF
