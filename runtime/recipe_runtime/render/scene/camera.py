"""Where a camera stands and how it projects: the numbers that a frame's kernels are given."""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from typing import Any

import numpy as np
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.core.transforms import Array, compose, invert
from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)

# Camera x right, y down, z forward, from sensor x forward, y left, z up; and the reverse.
_VIEW_FROM_SENSOR = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
_SENSOR_FROM_VIEW = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0]])
_HERE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def pinhole_of(camera: CameraPlan, side: int) -> Any:
    """The camera as kernels want it, with side x side samples a pixel."""
    sine, cosine = exact.sin_cos_deg(camera.fov / 2.0)
    lens = Pinhole()
    lens.focal = camera.width / 2.0 * cosine / sine
    lens.cx, lens.cy = camera.width / 2.0, camera.height / 2.0
    lens.near, lens.far = camera.near, camera.far
    lens.width, lens.height, lens.side = camera.width, camera.height, side
    return lens


def world_from_parts(parts: Array) -> Array:
    """The world itself as part 0, then the moving parts [..., P, 3, 4]. [..., 1 + P, 3, 4]."""
    here = np.broadcast_to(_HERE, (*parts.shape[:-3], 1, 3, 4))
    return np.concatenate([here, parts], axis=-3)


def view_from_parts(world_from_sensor: Array, parts: Array) -> Array:
    """Camera-from-part transforms of the world and of the moving parts. [..., 1 + P, 3, 4]."""
    view = compose(_VIEW_FROM_SENSOR, invert(world_from_sensor))
    return compose(view[..., None, :, :], world_from_parts(parts))


def world_from_view(world_from_sensor: Array) -> Array:
    """World-from-camera, the camera with x right, y down, z forward. [..., 3, 4]."""
    return compose(world_from_sensor, _SENSOR_FROM_VIEW)


@wp.struct
class Pinhole:
    """A pinhole camera: focal length and centre in pixels, depth limits in metres, samples a pixel (1 or 2 a side)."""

    focal: wp.float64
    cx: wp.float64
    cy: wp.float64
    near: wp.float64
    far: wp.float64
    width: wp.int32  # pixels
    height: wp.int32
    side: wp.int32  # samples along a pixel's side


def upload_transforms(transforms: Array, device: str) -> Any:
    """3x4 transforms as rows of twelve float32 on the device."""
    return wp.array(transforms.reshape(-1, 12).astype(np.float32), dtype=wp.float32, device=device)
