"""The layout of KITTI's tracking and MOTS benchmarks.

    training/label_02/0000.txt              2-D and 3-D boxes
    training/calib/0000.txt
    training/poses/0000.txt                 `camera_to_world` of each frame, 3 x 4 numbers
    training/image_02/0000/000000.png
    training/evaluate_tracking.seqmap.training
    mots/label_02/0000.txt                  masks
    mots/evaluate_mots.seqmap.training
    sequences.csv                           variant and sensor of each sequence

Formats are those of the development kit of KITTI's tracking benchmark (A. Geiger, P. Lenz, R. Urtasun, CVPR 2012).
Frames count from 0. Types are Pedestrian, Cyclist for bicycles, Car, Truck, Tram and Misc. The 2-D box is `amodal_bbox`
with its last row and column; pixel coordinates are (0, 0) at the centre of the first pixel, so the principal point in
`calib/` is 0.5 less than in `K`. `calib/` cannot describe lens distortion: a warning names such a sensor. The 3-D box
is the body box in the camera frame, x right, y down, z forward; `rotation_y` describes its rotation completely only if
camera and actor are level. The frame of the laser scanner (`velo`) is the sensor frame, x forward, y left, z up, with
the same origin. `occluded` is 0 if at most 10 % are hidden, 1 up to 50 %, else 2. `truncated` is an integer, as in the
tracking benchmark's labels (in the detection benchmark's, it is a share): 0 if at most 2 % of the area of the unclipped
2-D box are outside of the picture, 1 up to 50 %, else 2. The benchmark's evaluation leaves out objects with 1 or 2.
Objects whose 2-D box is one pixel wide or high are `DontCare`, because such a box has no area: its right edge is its
left one, so no detection matches it. With `--categories`, types are the names of the map, and actors without one are
`DontCare`; classes in `mots/` stay those of the benchmark. In `poses/`, frames that a sensor with a `tick` does not
take are `nan`; each counts 48 bytes when the size of an export is compared with the limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.optics import bends
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.plan_types import fixed
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.calibration import Calibration
from recipe_runtime.annotate.mots import mots_lines
from recipe_runtime.annotate.records import LabelledFrame, LabelRecord
from recipe_runtime.core.transforms import VIEW_FROM_SENSOR
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.formats.category_map import CategoryMap, of_benchmark
from recipe_runtime.transfer.formats.format import Entry, Format, Options, Remarks, Row, categories_of
from recipe_runtime.transfer.formats.sequence import ExportSequence, names_table

_POSE_BYTES = 48  # of a frame without a picture
_MAX_NAMES = 20  # of sensors in a warning
_DEGREE = math.pi / 180.0
_CATEGORIES = of_benchmark(
    dict(enumerate(("Pedestrian", "Car", "Truck", "Cyclist", "Tram", "Misc"), start=1)),
    {"Pedestrian": 1, "Rider": 6, "Car": 2, "Truck": 3, "Bus": 6, "Train": 5, "Motorcycle": 6, "Bicycle": 4},
)
_UNKNOWN = " ".join(["-1000.000000"] * 3 + ["-10.000000"] + ["-1.000000"] * 3)  # of DontCare: sizes, position, rotation


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    categories = categories_of(options, _CATEGORIES)
    for sequence in sequences:
        camera, name = sequence.sensor.camera, f"{sequence.number:04d}"
        yield Entry(f"training/label_02/{name}.txt", label_lines(sequence.labels(), categories))
        first = next(sequence.labels(), None)
        if first is not None:
            yield Entry(f"training/calib/{name}.txt", calibration_text(first["calibration"]).encode())
        yield Entry(f"training/poses/{name}.txt", pose_lines(sequence.labels()))
        yield Entry(f"mots/label_02/{name}.txt", mots_lines(sequence.labels(), camera.width, camera.height, first=0))
        for frame, picture in sequence.pictures():
            yield Entry(f"training/image_02/{name}/{frame:06d}.png", picture)
    lengths = [(f"{sequence.number:04d} empty 000000", sequence.length) for sequence in sequences]
    yield Entry("training/evaluate_tracking.seqmap.training", [f"{row} {length:06d}\n" for row, length in lengths])
    last_frames = [f"{row} {length - 1:06d}\n" for row, length in lengths]  # as KITTI's MOTS list has them
    yield Entry("mots/evaluate_mots.seqmap.training", last_frames)
    yield Entry("sequences.csv", names_table(sequences))


def _pose_bytes(plan: DatasetPlan) -> int:
    """Return the bytes of the poses of all frames, as if none had a picture."""
    return _POSE_BYTES * sum(variant.scene.clock.frames * len(variant.rig.sensors) for variant in plan.variants)


def _warn_of_distortion(dataset: Dataset, out: Path, rows: Sequence[Row]) -> Remarks:
    """Warn of sensors whose pictures a calibration of KITTI does not describe."""
    sensors = [sensor for variant in dataset.plan.variants for sensor in variant.rig.sensors]
    bent = list(dict.fromkeys(sensor.name for sensor in sensors if bends(sensor.camera)))
    if not bent:
        return Remarks()
    more = f" and {count(len(bent) - _MAX_NAMES, 'other sensor')}" if len(bent) > _MAX_NAMES else ""
    names = ", ".join(bent[:_MAX_NAMES]) + more
    what = f"pictures of {names} have lens distortion, which KITTI's calibration cannot describe"
    remedy = "undistort them with the `distortion` in labels.jsonl, or set lens_k and lens_kcube to 0"
    return Remarks([Problem(what, None, remedy, Code.INVALID_DATASET)])


def label_lines(frames: Iterable[LabelledFrame], categories: CategoryMap = _CATEGORIES) -> Iterator[str]:
    """Yield the lines of `label_02/<sequence>.txt`.

    The fields are frame, track, type, truncated, occluded, alpha, left, top, right, bottom, height, width, length, x,
    y, z, rotation_y. The 2-D box is the amodal box, clipped to the picture; x, y, z is the centre of the bottom of the
    body box in the camera frame, metres; angles are in radians; the track is the instance value. A box of one pixel in
    width or height becomes a region `DontCare` with the outer edges of its pixels, and track -1.
    """
    for frame in frames:
        for item in frame["objects"]:
            _, _, wide, high = item["amodal_bbox"]
            category = categories.id(item["instance"])
            is_counted = category is not None and min(wide, high) > 1
            label = _label(item, categories.names[category or 0]) if is_counted else _ignored(item)
            yield f"{frame['frame']} {label}\n"


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


def _label(item: LabelRecord, category: str) -> str:
    x, y, z = bottom(item)
    w, qx, qy, qz = item["box3d"]["rotation"]
    ahead, left = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + w * qz)  # of the box's front, in the sensor's frame
    turn = exact.atan2_deg(-ahead, -left)  # about the camera's y axis, 0 where the front points to the right
    alpha = _wrapped(turn - exact.atan2_deg(x, z))
    length, width, height = item["box3d"]["size"]
    x0, y0, wide, high = item["amodal_bbox"]
    fields = [
        item["instance"],
        "_".join(category.split()),
        _level(item["truncation"], 0.02, 0.5),
        _level(1.0 - item["visible_fraction"], 0.1, 0.5),
        _text(alpha * _DEGREE),
        *(f"{value}.00" for value in (x0, y0, x0 + wide - 1, y0 + high - 1)),
        *(_text(value) for value in (height, width, length, x, y, z)),
        _text(turn * _DEGREE),
    ]
    return " ".join(map(str, fields))


def _ignored(item: LabelRecord) -> str:
    x0, y0, wide, high = item["amodal_bbox"]
    edges = " ".join(f"{edge - 0.5:.2f}" for edge in (x0, y0, x0 + wide, y0 + high))
    return f"-1 DontCare -1 -1 -10.000000 {edges} {_UNKNOWN}"


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


FORMAT = Format(files=_files, more_bytes=_pose_bytes, remarks=_warn_of_distortion)
