"""The pinhole camera, a struct for kernels."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.struct
class Pinhole:
    """A pinhole camera: focal length and centre in pixels, depth limits in metres, 1 or 2 samples per pixel side."""

    focal: wp.float64
    cx: wp.float64
    cy: wp.float64
    near: wp.float64
    far: wp.float64
    width: wp.int32  # pixels
    height: wp.int32
    side: wp.int32  # samples along a pixel's side
