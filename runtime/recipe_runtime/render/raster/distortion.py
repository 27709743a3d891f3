"""Lens distortion, host side: the undistorted camera, and resampling of its image."""

from __future__ import annotations

from recipe_compiler.ir import exact, optics
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster.distortion_kernels import Distortion, resample_words


def undistorted_camera(camera: CameraPlan, supersample: int = 1) -> CameraPlan:
    """Return the pinhole camera whose image a picture is resampled from.

    Args:
        camera: The camera of the picture.
        supersample: Samples along the side of a pixel.

    Returns:
        The camera itself if it has no distortion and one sample per pixel.
    """
    if supersample == 1 and not optics.bends(camera):
        return camera
    width, height, fine = optics.undistorted_size(camera, supersample)
    fov = camera.fov
    if optics.bends(camera):
        sine, cosine = exact.sin_cos_deg(fov / 2.0)
        fov = 2.0 * exact.atan2_deg(sine * width, cosine * camera.width * fine)
    update = {"width": width, "height": height, "fov": fov, "lens_k": 0.0, "lens_kcube": 0.0}
    return camera.model_copy(update=update)


def distortion_of(camera: CameraPlan, supersample: int = 1) -> Distortion:
    """Return the mapping from a camera's picture to its undistorted image."""
    wide, high, fine = optics.undistorted_size(camera, supersample)
    return set_fields(
        Distortion(),
        k=camera.lens_k,
        kcube=camera.lens_kcube,
        limit=optics.corner(camera),
        width=camera.width,
        height=camera.height,
        wide=wide,
        high=high,
        fine=fine,
        bends=int(optics.bends(camera)),
    )


def apply_distortion(words: DeviceArray, camera: CameraPlan, device: str) -> DeviceArray:
    """Resample an image of 64-bit words (visibility keys or bit masks) with a camera's distortion.

    Args:
        words: uint64, of the undistorted image, row by row.
        camera: The camera of the picture.
        device: The device of the arrays.

    Returns:
        uint64 [H * W]; `words` itself if the camera has no distortion.
    """
    if not optics.bends(camera):
        return words
    pixels = camera.width * camera.height
    out = wp.empty(pixels, dtype=wp.uint64, device=device)
    launch(resample_words, pixels, device, words=words, distortion=distortion_of(camera), out_words=out)
    return out
