"""The projection of points and of patches' faces into a camera's picture, in float64 and in a fixed order.

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


def intrinsics(camera: CameraPlan) -> Matrix:
    """Return the camera matrix [3, 3] of the camera without its lens' distortion: pixels from view directions."""
    focal = optics.focal_length(camera)
    return np.array([[focal, 0.0, camera.width / 2.0], [0.0, focal, camera.height / 2.0], [0.0, 0.0, 1.0]])


def view_from_world(world_from_sensor: Array) -> Array:
    """Return the transform [3, 4] into the view of a sensor with this pose [3, 4] (x forward, y left, z up)."""
    return compose(VIEW_FROM_SENSOR, invert(world_from_sensor))


def view_from_part(patch: PatchPlan, trace: Trace, frame: int, view: Array) -> Array:
    """Return the transform [3, 4] into the view of the part that carries a patch's first face.

    Args:
        patch: The patch.
        trace: The motion of the scene.
        frame: Number of the frame.
        view: The view from the world, [3, 4].
    """
    part = patch.faces[0].part
    if part == STATIC:
        return view
    return compose(view, part_transforms(trace, frame)[trace.parts.index(f"{patch.body}/{part}")])


def homography(face: PatchFace, camera: CameraPlan, view_from_part: Array) -> Matrix:
    """Return the homography [3, 3] of a face: from its (u, v, 1), 0 to 1 each, to pixels times depth, and depth.

    Pixels are those of the camera without distortion (`distort` follows); depth is in metres along the optical axis.

    Args:
        face: The face.
        camera: The camera.
        view_from_part: The transform [3, 4] of the face's part into the view.
    """
    columns = [
        [v * face.width for v in face.right],
        [v * face.height for v in face.down],
        list(face.corner),
    ]
    r, rows = view_from_part, []
    for axis in range(3):
        turned = [(r[axis, 0] * x + r[axis, 1] * y) + r[axis, 2] * z for x, y, z in columns]
        rows.append([turned[0], turned[1], turned[2] + r[axis, 3]])
    k = intrinsics(camera)
    x, y, z = (np.array(row) for row in rows)
    return np.stack([k[0, 0] * x + k[0, 2] * z, k[1, 1] * y + k[1, 2] * z, z])


def apply_homography(h: Matrix, u: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return x, y and the third coordinate of points u, v (arrays of any shape)."""
    x, y, w = ((h[row, 0] * u + h[row, 1] * v) + h[row, 2] for row in range(3))
    return x / w, y / w, w


def inverse(h: Matrix) -> Matrix:
    """Return the inverse of a matrix [3, 3] by its cofactors.

    Raises:
        ZeroDivisionError: It has none.
    """
    (a, b, c), (d, e, f), (g, i, j) = ([float(v) for v in row] for row in h)
    minors = [[e * j - f * i, c * i - b * j, b * f - c * e], [f * g - d * j, a * j - c * g, c * d - a * f],
              [d * i - e * g, b * g - a * i, a * e - b * d]]  # fmt: skip
    one = 1.0 / ((a * minors[0][0] + b * minors[1][0]) + c * minors[2][0])
    return np.array([[value * one for value in row] for row in minors])


def distort(camera: CameraPlan, x: float, y: float) -> tuple[float, float]:
    """Return where in the picture the lens shows what a pinhole camera shows at (x, y), in pixels.

    `recipe_compiler.ir.optics` has the formula, whose inverse this is. Beyond the corners it goes on straight.
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


def undistorted_centres(camera: CameraPlan) -> tuple[Array, Array]:
    """Return x and y [H, W] of where a pinhole camera would show what the picture has at its pixels' centres."""
    x, y = np.broadcast_arrays(np.arange(camera.width)[None, :] + 0.5, np.arange(camera.height)[:, None] + 0.5)
    return undistorted(camera, x, y)


def undistorted(camera: CameraPlan, x: Array, y: Array) -> tuple[Array, Array]:
    """Return where a pinhole camera would show what the picture has at points x, y (arrays of any shape)."""
    dx, dy = x - camera.width / 2.0, y - camera.height / 2.0
    half = camera.width / 2.0
    square = (dx * dx + dy * dy) / (half * half)
    factor = 1.0 + square * (camera.lens_k + camera.lens_kcube * np.sqrt(square))
    return camera.width / 2.0 + factor * dx, camera.height / 2.0 + factor * dy


def covered_pixels(face: PatchFace, camera: CameraPlan, view_from_part: Array) -> NDArray[np.bool_]:
    """Return which pixels' centres a face would show with nothing before it, [H, W].

    Args:
        face: The face, a rectangle.
        camera: The camera.
        view_from_part: The transform [3, 4] of the face's part into the view.
    """
    nowhere = np.zeros((camera.height, camera.width), bool)
    h = homography(face, camera, view_from_part)
    if not _faces(face, view_from_part):
        return nowhere
    try:
        back = inverse(h)
    except ZeroDivisionError:
        return nowhere
    x, y = undistorted_centres(camera)
    nearness = (back[2, 0] * x + back[2, 1] * y) + back[2, 2]  # 1 / depth
    ahead = nearness * camera.near < 1.0
    ahead &= nearness > 0.0
    one = np.where(ahead, nearness, 1.0)
    u, v = (((back[row, 0] * x + back[row, 1] * y) + back[row, 2]) / one for row in range(2))
    covered: NDArray[np.bool_] = ahead & (u >= 0.0) & (u <= 1.0) & (v >= 0.0) & (v <= 1.0)
    return covered


def _faces(face: PatchFace, view_from_part: Array) -> bool:
    """Whether the front of a face is turned to the eye."""
    r = view_from_part
    normal, corner = face.normal, face.corner
    turned = [(r[a, 0] * normal[0] + r[a, 1] * normal[1]) + r[a, 2] * normal[2] for a in range(3)]
    there = [((r[a, 0] * corner[0] + r[a, 1] * corner[1]) + r[a, 2] * corner[2]) + r[a, 3] for a in range(3)]
    return bool((turned[0] * there[0] + turned[1] * there[1]) + turned[2] * there[2] < 0.0)
