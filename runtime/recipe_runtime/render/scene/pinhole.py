"""The pinhole camera, a struct for kernels."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)


@wp.struct
class Pinhole:
    """A pinhole camera: focal length and centre in pixels, depth limits in metres, rows of samples."""

    focal: wp.float64
    cx: wp.float64
    cy: wp.float64
    near: wp.float64
    far: wp.float64
    width: wp.int32  # pixels
    height: wp.int32
    rows: wp.int32  # of samples in a pixel, one sample each: 1 or `triangles.ROWS`
