"""Camera transforms and projection parameters for kernels."""

from __future__ import annotations

import numpy as np
from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.core.transforms import SENSOR_FROM_VIEW, VIEW_FROM_SENSOR, Array, compose, invert
from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.pinhole import Pinhole

_HERE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def pinhole_of(camera: CameraPlan, rows: int) -> Pinhole:
    """Return the struct `Pinhole` of a camera, with `rows` samples per pixel, each in a row of its own."""
    return set_fields(
        Pinhole(),
        focal=optics.focal_length(camera),
        cx=camera.width / 2.0,
        cy=camera.height / 2.0,
        near=camera.near,
        far=camera.far,
        width=camera.width,
        height=camera.height,
        rows=rows,
    )


def world_from_parts(parts: Array) -> Array:
    """Prepend the identity, the world as part 0, to transforms of moving parts [..., P, 3, 4]: [..., 1 + P, 3, 4]."""
    here = np.broadcast_to(_HERE, (*parts.shape[:-3], 1, 3, 4))
    return np.concatenate([here, parts], axis=-3)


def view_from_parts(world_from_sensor: Array, parts: Array) -> Array:
    """Return the transforms from the world and from each moving part to view space, [..., 1 + P, 3, 4]."""
    view = compose(VIEW_FROM_SENSOR, invert(world_from_sensor))
    return compose(view[..., None, :, :], world_from_parts(parts))


def world_from_view(world_from_sensor: Array) -> Array:
    """Return the transform from view space (x right, y down, z forward) to the world, [..., 3, 4]."""
    return compose(world_from_sensor, SENSOR_FROM_VIEW)


def upload_transforms(transforms: Array, device: str) -> DeviceArray:
    """Upload 3x4 transforms as float32 [N, 12]."""
    return wp.array(transforms.reshape(-1, 12).astype(np.float32), dtype=wp.float32, device=device)
