"""Projection of points and of patches' faces into a camera's picture, in float64 with a fixed order of operations.

Pixel (0, 0) has its top-left corner at (0, 0) and its centre at (0.5, 0.5). The view has x right, y down, z forward.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import optics
from recipe_compiler.ir.patches import STATIC, PatchFace, PatchPlan
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import VIEW_FROM_SENSOR, Array, compose, invert, part_transforms

Matrix = NDArray[np.float64]

_NEWTON_STEPS = 12
_STRIP = 1 << 16  # pixels of a picture that are projected at once


def intrinsics(camera: CameraPlan) -> Matrix:
    """Return the camera matrix [3, 3] without lens distortion: from directions in the view to pixels."""
    focal = optics.focal_length(camera)
    return np.array([[focal, 0.0, camera.width / 2.0], [0.0, focal, camera.height / 2.0], [0.0, 0.0, 1.0]])


def view_from_world(world_from_sensor: Array) -> Array:
    """Return the transform [3, 4] from the world to the view of a sensor.

    Args:
        world_from_sensor: Pose of the sensor, [3, 4], x forward, y left, z up, metres.
    """
    return compose(VIEW_FROM_SENSOR, invert(world_from_sensor))


def view_from_part(patch: PatchPlan, trace: Trace, frame: int, view: Array) -> Array:
    """Return the transform [3, 4] to the view from the part that a patch's first face is on.

    Args:
        patch: The patch.
        trace: The motion of the scene.
        frame: Number of the frame.
        view: The transform from the world to the view, [3, 4].
    """
    part = patch.faces[0].part
    if part == STATIC:
        return view
    return compose(view, part_transforms(trace, frame)[trace.parts.index(f"{patch.body}/{part}")])


def homography(face: PatchFace, camera: CameraPlan, view_from_part: Array) -> Matrix:
    """Return the homography [3, 3] of a face, from (u, v, 1), 0 to 1 each, to (x w, y w, w).

    x and y are pixels of the camera without distortion, to which `distort` can be applied; w is the depth in metres
    along the optical axis.

    Args:
        face: The face.
        camera: The camera.
        view_from_part: The transform [3, 4] from the face's part to the view.
    """
    columns = [
        [v * face.width for v in face.right],
        [v * face.height for v in face.down],
        list(face.corner),
    ]
    r, rows = view_from_part, []
    for axis in range(3):
        rotated = [(r[axis, 0] * x + r[axis, 1] * y) + r[axis, 2] * z for x, y, z in columns]
        rows.append([rotated[0], rotated[1], rotated[2] + r[axis, 3]])
    k = intrinsics(camera)
    x, y, z = (np.array(row) for row in rows)
    return np.stack([k[0, 0] * x + k[0, 2] * z, k[1, 1] * y + k[1, 2] * z, z])


def apply_homography(h: Matrix, u: Array, v: Array) -> tuple[Array, Array, Array]:
    """Apply a homography to points u, v, arrays of any shape; return x, y and w."""
    x, y, w = ((h[row, 0] * u + h[row, 1] * v) + h[row, 2] for row in range(3))
    return x / w, y / w, w


def inverse(h: Matrix) -> Matrix:
    """Return the inverse of a matrix [3, 3] by its cofactors.

    Raises:
        ZeroDivisionError: The matrix is singular.
    """
    (a, b, c), (d, e, f), (g, i, j) = ([float(v) for v in row] for row in h)
    minors = [[e * j - f * i, c * i - b * j, b * f - c * e], [f * g - d * j, a * j - c * g, c * d - a * f],
              [d * i - e * g, b * g - a * i, a * e - b * d]]  # fmt: skip
    one = 1.0 / ((a * minors[0][0] + b * minors[1][0]) + c * minors[2][0])
    return np.array([[value * one for value in row] for row in minors])


def distort(camera: CameraPlan, x: float, y: float) -> tuple[float, float]:
    """Apply the lens distortion to a point of the pinhole camera's picture; pixels.

    This is the inverse of the formula in `recipe_compiler.ir.optics`. Beyond the picture's corners it is continued
    linearly.
    """
    if not optics.bends(camera):
        return x, y
    half, limit = camera.width / 2.0, optics.corner(camera)
    dx, dy = x - half, y - camera.height / 2.0
    goal = float(np.sqrt(dx * dx + dy * dy)) / half
    end = limit * optics.factor(camera, limit)
    if goal >= end:
        r = limit + (goal - end) / optics.slope(camera, limit)
    else:
        r = goal * limit / end
        for _ in range(_NEWTON_STEPS):
            r -= (r * optics.factor(camera, r) - goal) / optics.slope(camera, r)
            r = min(max(r, 0.0), limit)
    scale = r / goal if goal > 1e-12 else 1.0
    return half + dx * scale, camera.height / 2.0 + dy * scale


def undistorted(camera: CameraPlan, x: Array, y: Array) -> tuple[Array, Array]:
    """Remove the lens distortion from points x, y of the picture, arrays of any shape; pixels."""
    dx, dy = x - camera.width / 2.0, y - camera.height / 2.0
    half = camera.width / 2.0
    square = (dx * dx + dy * dy) / (half * half)
    factor = 1.0 + square * (camera.lens_k + camera.lens_kcube * np.sqrt(square))
    return camera.width / 2.0 + factor * dx, camera.height / 2.0 + factor * dy


def covered_pixels(face: PatchFace, camera: CameraPlan, view_from_part: Array) -> NDArray[np.bool_]:
    """Return the pixels whose centres a face covers without occlusion, bool [H, W].

    Args:
        face: The face, a rectangle.
        camera: The camera.
        view_from_part: The transform [3, 4] from the face's part to the view.
    """
    covered = np.zeros((camera.height, camera.width), bool)
    if not _is_front_facing(face, view_from_part):
        return covered
    try:
        back = inverse(homography(face, camera, view_from_part))
    except ZeroDivisionError:
        return covered
    rows = max(1, _STRIP // camera.width)
    for top in range(0, camera.height, rows):
        x, y = undistorted(camera, *_centres(camera, top, min(top + rows, camera.height)))
        nearness = (back[2, 0] * x + back[2, 1] * y) + back[2, 2]  # 1 / depth
        ahead = nearness * camera.near < 1.0
        ahead &= nearness > 0.0
        one = np.where(ahead, nearness, 1.0)
        u, v = (((back[row, 0] * x + back[row, 1] * y) + back[row, 2]) / one for row in range(2))
        covered[top : top + rows] = ahead & (u >= 0.0) & (u <= 1.0) & (v >= 0.0) & (v <= 1.0)
    return covered


def _centres(camera: CameraPlan, top: int, end: int) -> tuple[Array, Array]:
    """Return x and y, [rows, W], of the centres of the pixels of some rows."""
    x, y = np.broadcast_arrays(np.arange(camera.width)[None, :] + 0.5, np.arange(top, end)[:, None] + 0.5)
    return x, y


def _is_front_facing(face: PatchFace, view_from_part: Array) -> bool:
    """Return whether the front of a face is towards the camera."""
    r = view_from_part
    n, c = face.normal, face.corner
    normal = [(r[a, 0] * n[0] + r[a, 1] * n[1]) + r[a, 2] * n[2] for a in range(3)]
    corner = [((r[a, 0] * c[0] + r[a, 1] * c[1]) + r[a, 2] * c[2]) + r[a, 3] for a in range(3)]
    return bool((normal[0] * corner[0] + normal[1] * corner[1]) + normal[2] * corner[2] < 0.0)
