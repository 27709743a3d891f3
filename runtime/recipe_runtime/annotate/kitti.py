"""KITTI's tracking layout: labels with 2-D and 3-D boxes, calibration and camera poses as text.

Formats are those of the development kit of KITTI's tracking benchmark (A. Geiger, P. Lenz, R. Urtasun, CVPR 2012):
frames are counted from 0, boxes include their last row and column, and pixel coordinates are (0, 0) at the centre of
the first pixel. The camera frame is x right, y down, z forward. The laser scanner's frame (`velo`) is the sensor frame,
x forward, y left, z up, with the same origin.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan_types import fixed
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.annotate.calibration import Calibration
from recipe_runtime.annotate.records import LabelledFrame, LabelRecord
from recipe_runtime.core.transforms import VIEW_FROM_SENSOR

_DEGREE = math.pi / 180.0
TYPES: dict[int, str] = {
    Tag.PEDESTRIAN.value: "Pedestrian",
    Tag.CAR.value: "Car",
    Tag.TRUCK.value: "Truck",
    Tag.BICYCLE.value: "Cyclist",
    Tag.TRAIN.value: "Tram",
}
"""KITTI's type of each tag; all others are `Misc`."""


def label_lines(frames: Iterable[LabelledFrame]) -> Iterator[str]:
    """Yield the lines of `label_02/<sequence>.txt`.

    The fields are frame, track, type, truncated, occluded, alpha, left, top, right, bottom, height, width, length, x,
    y, z, rotation_y. The 2-D box is the amodal box, clipped to the picture; x, y, z is the centre of the bottom of the
    body box in the camera frame, metres; angles are in radians; the track is the instance value.
    """
    for frame in frames:
        for item in frame["objects"]:
            yield f"{frame['frame']} {_label(item)}\n"


def calibration_text(calibration: Calibration) -> str:
    """Return `calib/<sequence>.txt`: equal projections for all four cameras, identity rectification and IMU pose."""
    (focal, _, cx), (_, _, cy), _ = calibration["K"]
    projection = [[focal, 0.0, cx - 0.5, 0.0], [0.0, focal, cy - 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]
    unit = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
    rows = {f"P{number}:": projection for number in range(4)}
    rows |= {"R_rect": [row[:3] for row in unit], "Tr_velo_cam": VIEW_FROM_SENSOR.tolist(), "Tr_imu_velo": unit}
    return "".join(f"{name} {_numbers(matrix)}\n" for name, matrix in rows.items())


def pose_lines(frames: Iterable[LabelledFrame]) -> Iterator[str]:
    """Yield the lines of `poses/<sequence>.txt`: camera to world of each frame, the first three rows.

    Line k, from 0, is that of frame k; of a frame without a picture, it consists of `nan`.
    """
    line = 0
    for frame in frames:
        for _ in range(line, frame["frame"]):
            yield " ".join(["nan"] * 12) + "\n"
        line = frame["frame"] + 1
        yield _numbers(frame["calibration"]["camera_to_world"][:3]) + "\n"


def _label(item: LabelRecord) -> str:
    x, y, z = bottom(item)
    w, qx, qy, qz = item["box3d"]["rotation"]
    ahead, left = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + w * qz)  # of the box's front, in the sensor's frame
    turn = exact.atan2_deg(-ahead, -left)  # about the camera's y axis, 0 where the front points to the right
    alpha = _wrapped(turn - exact.atan2_deg(x, z))
    length, width, height = item["box3d"]["size"]
    x0, y0, wide, high = item["amodal_bbox"]
    fields = [
        item["instance"],
        TYPES.get(item["instance"] // 1000, "Misc"),
        _level(item["truncation"], 0.02, 0.5),
        _level(1.0 - item["visible_fraction"], 0.1, 0.5),
        _text(alpha * _DEGREE),
        *(f"{value}.00" for value in (x0, y0, x0 + wide - 1, y0 + high - 1)),
        *(_text(value) for value in (height, width, length, x, y, z)),
        _text(turn * _DEGREE),
    ]
    return " ".join(map(str, fields))


def bottom(item: LabelRecord) -> tuple[float, float, float]:
    """Return the centre of the bottom of an actor's body box in the camera frame, metres."""
    box = item["box3d"]
    w, x, y, z = box["rotation"]
    half = box["size"][2] / 2.0
    up = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    ahead, left, above = (c - half * u for c, u in zip(box["centre"], up, strict=True))
    return -left, -above, ahead


def _level(share: float, partly: float, largely: float) -> int:
    """Return KITTI's level of a share: 0 up to `partly`, 1 up to `largely`, else 2."""
    return 0 if share <= partly else 1 if share <= largely else 2


def _wrapped(degrees: float) -> float:
    return degrees - 360.0 * math.floor(degrees / 360.0 + 0.5)


def _text(value: float) -> str:
    return f"{fixed(value):.6f}"


def _numbers(matrix: list[list[float]]) -> str:
    return " ".join(f"{value:.6f}" for row in matrix for value in row)
