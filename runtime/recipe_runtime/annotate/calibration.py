"""The calibration of a frame: the projection from world space to pixels, with all conventions.

The camera frame is that of OpenCV and of REP-103's optical frames: x right, y down, z forward, metres. Pixel
coordinates are continuous: (0, 0) is the outer corner of the top-left pixel, whose centre is (0.5, 0.5). A point p of
the world projects as

    x, y, z = world_to_camera p,  u = K (x / z, y / z, 1),

and depth is z. With lens distortion, let q be a pixel's offset from the principal point (K's last column), in units of
half the image's width, and r its length; the undistorted offset is (1 + lens_k r^2 + lens_kcube r^3) q.
"""

from __future__ import annotations

from typing import Literal, TypedDict

from recipe_compiler.ir.optics import bends, focal_length
from recipe_compiler.ir.plan import CameraPlan
from recipe_compiler.ir.plan_types import fixed

from recipe_runtime.core.documents import Matrix3, Matrix4, Number
from recipe_runtime.core.transforms import SENSOR_FROM_VIEW, Array, compose, invert


class Distortion(TypedDict):
    """The distortion of the lens; the coefficients are 0 for the model `none`."""

    model: Literal["none", "radial"]
    lens_k: Number
    lens_kcube: Number


class Calibration(TypedDict):
    """Calibration of one frame of one camera; non-integers have six decimal places."""

    K: Matrix3  # pixels
    distortion: Distortion
    camera_to_world: Matrix4
    world_to_camera: Matrix4


def calibration(camera: CameraPlan, world_from_sensor: Array) -> Calibration:
    """Return the calibration of a camera at a pose.

    Args:
        camera: The camera.
        world_from_sensor: Pose of the sensor, [3, 4], x forward, y left, z up, metres.
    """
    focal = fixed(focal_length(camera))
    pose = compose(world_from_sensor, SENSOR_FROM_VIEW)
    return {
        "K": [[focal, 0.0, camera.width / 2.0], [0.0, focal, camera.height / 2.0], [0.0, 0.0, 1.0]],
        "distortion": {
            "model": "radial" if bends(camera) else "none",
            "lens_k": camera.lens_k,
            "lens_kcube": camera.lens_kcube,
        },
        "camera_to_world": _rows(pose),
        "world_to_camera": _rows(invert(pose)),
    }


def _rows(transform: Array) -> list[list[float]]:
    return [*([fixed(v) for v in row] for row in transform.tolist()), [0.0, 0.0, 0.0, 1.0]]
