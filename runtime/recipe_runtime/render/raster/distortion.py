"""The plate: the straight picture that a lens bends into the camera's, and the words of one from the other."""

from __future__ import annotations

from recipe_compiler.ir import exact, optics
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray, filled
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster.distortion_kernels import Distortion, resample_words


def plate_of(camera: CameraPlan, supersample: int = 1) -> CameraPlan:
    """The pinhole camera that a picture is cut from: itself, if it is one and takes one sample a pixel."""
    if supersample == 1 and not optics.bends(camera):
        return camera
    width, height, fine = optics.plate_size(camera, supersample)
    fov = camera.fov
    if optics.bends(camera):
        sine, cosine = exact.sin_cos_deg(fov / 2.0)
        fov = 2.0 * exact.atan2_deg(sine * width, cosine * camera.width * fine)
    update = {"width": width, "height": height, "fov": fov, "lens_k": 0.0, "lens_kcube": 0.0}
    return camera.model_copy(update=update)


def distortion_of(camera: CameraPlan, supersample: int = 1) -> Distortion:
    """The way from a camera's picture to its plate."""
    wide, high, fine = optics.plate_size(camera, supersample)
    return filled(
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


def apply_distortion(plate: DeviceArray, camera: CameraPlan, device: str) -> DeviceArray:
    """The 64-bit words (keys or bits) of a picture's pixels, from those of its plate."""
    if not optics.bends(camera):
        return plate
    pixels = camera.width * camera.height
    out = wp.empty(pixels, dtype=wp.uint64, device=device)
    launch(resample_words, pixels, device, plate=plate, distortion=distortion_of(camera), out_words=out)
    return out
