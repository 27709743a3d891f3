"""The distances at which a level of an object is shown, a struct for kernels."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.struct
class LevelRange:
    """A level of an object: the camera of `REFERENCE_FOCAL` shows it from `near` to `far` of its anchor."""

    part: wp.int32  # whose frame the anchor is in: 0 for the world, 1 + p for part p of the Trace
    anchor: wp.vec3f  # metres
    near: wp.float32  # square of the smallest distance, square metres
    far: wp.float32  # square of the distance where it ends
