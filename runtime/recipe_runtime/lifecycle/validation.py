"""Checks what docs/dataset.md states about a dataset, from its files alone: nothing is simulated or rendered.

Files are compared with the manifest, and text files with what follows from plan and labels. Then labels, pictures and
tables are compared with each other, so an error is found even if the manifest was written again to match.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, groupby

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ScenarioPlan, SensorPlan

from recipe_runtime.annotate.masks import unpacked
from recipe_runtime.annotate.records import Box3d, LabelledFrame, LabelRecord
from recipe_runtime.core import layout
from recipe_runtime.core.files import read_inside
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset import events
from recipe_runtime.dataset.reader import Dataset, damaged_files, text_differences
from recipe_runtime.dataset.tracks import COLUMNS
from recipe_runtime.transfer.formats.sequence import ExportSequence
from recipe_runtime.webdataset import decode

_MAX_TABLE_BYTES = 1 << 30
_NEAR = 2e-3  # metres: numbers have six decimals, and rotations are those of grids
_MARGIN = 0.1  # metres by which a pixel may lie outside the tight box
_INSIDE = 0.98  # of an object's pixels must lie in its tight box: with distortion, a pixel has a neighbour's depth
_RIDER, _TWO_WHEELERS = 13, (18, 19)


Array = NDArray[np.float64]
Rows = dict[tuple[int, str], dict[str, float]]  # by frame and actor, the numbers of tracks.csv


@dataclass(frozen=True)
class Fault:
    """What a dataset has wrong: the path of a file in it, its line or frame (-1: the whole file), and a message."""

    path: str
    row: int
    message: str

    def __str__(self) -> str:
        return f"{self.path}{'' if self.row < 0 else f', {self.row}'}: {self.message}"


def validate(dataset: Dataset, progress: Progress) -> list[Fault]:
    """Return all faults of a dataset, those of its files first."""
    found = [_whole(path, message) for path, message in damaged_files(dataset, progress)]
    found += [_whole(path, message) for path, message in text_differences(dataset, {})]
    known: set[tuple[str, str]] = set()  # scenes and rigs whose labels were checked: variants share the files
    variants, done = dataset.plan.variants, 0
    frames = sum(len(s.frames(v.scene.clock.frames)) for v in variants for s in v.rig.sensors)
    for number, variant in enumerate(variants):
        rows: Rows = {}
        shared = (variant.scene.digest, variant.rig.digest) in known
        known.add((variant.scene.digest, variant.rig.digest))
        if not shared:
            try:
                rows = _tracks(dataset, variant)
            except (OSError, ValueError) as error:
                found.append(_whole(layout.tracks_file(variant.variant), str(error)))
        seen: dict[tuple[str, str], list[int]] = {}
        for sensor in variant.rig.sensors:
            sequence = ExportSequence(dataset, variant, sensor, number)
            try:
                for frame in sequence.labels():
                    found += _picture_faults(sequence, frame, rows, labelled=not shared)
                    for record in frame["objects"]:
                        seen.setdefault((record["actor"], sensor.name), []).append(frame["frame"])
                    done += 1
                    progress("frames", done, frames)
            except InputError as error:
                found.append(_whole(layout.labels_file(variant.variant, sensor.name), _reason(error, dataset)))
        if not shared:
            found += _event_faults(dataset, variant, seen)
    unique = dict.fromkeys(found)
    return list(unique)


def _whole(path: str, message: str) -> Fault:
    return Fault(path, -1, message.removeprefix(f"{path} ").removeprefix(f"{path}: "))


def _reason(error: Exception, dataset: Dataset) -> str:
    text = error.problems[0].message if isinstance(error, InputError) else str(error)
    return (text.splitlines() or [type(error).__name__])[0].removeprefix(f"{dataset.root}/")


def _picture_faults(sequence: ExportSequence, frame: LabelledFrame, rows: Rows, *, labelled: bool) -> Iterator[Fault]:
    """Compare a frame's pictures with its labels, and these with `tracks.csv`; only RGB unless `labelled`."""
    number, sensor = frame["frame"], sequence.sensor
    path = layout.labels_file(sequence.variant.variant, sensor.name)
    pictures: dict[str, NDArray[np.generic]] = {}
    for modality in sensor.capture:
        if not labelled and modality != "rgb":
            continue
        try:
            file, content = sequence.file(modality, number)
            pictures[modality] = decode(f".{modality}.{file.rpartition('.')[2]}", content)
            if pictures[modality].shape[:2] != (sensor.camera.height, sensor.camera.width):
                yield _whole(file, "it has another size than the camera's pictures")
                return
        except (InputError, ValueError) as error:
            yield Fault(path, number + 1, _reason(error, sequence.dataset))
            return
    if not labelled:
        return
    faults = chain(
        _mask_faults(frame, sensor, pictures),
        _depth_faults(frame, sensor, pictures),
        *(_record_faults(record, frame, rows) for record in frame["objects"]),
    )
    yield from (Fault(path, number + 1, message) for message in faults)


def _mask_faults(
    frame: LabelledFrame, sensor: SensorPlan, pictures: Mapping[str, NDArray[np.generic]]
) -> Iterator[str]:
    """Masks, areas and boxes are those of the instance picture; semantic pixels have the class of the instance."""
    width, height = sensor.camera.width, sensor.camera.height
    drawn = np.zeros((height, width), np.int64)
    for record in frame["objects"]:
        mask = unpacked(record["counts"], width, height) > 0
        y, x = np.nonzero(mask)
        if not len(x):
            yield f"{record['actor']} has no pixels"
            continue
        box = [int(x.min()), int(y.min()), int(np.ptp(x)) + 1, int(np.ptp(y)) + 1]
        if (list(record["bbox"]), record["area"]) != (box, len(x)):
            yield f"bbox and area of {record['actor']} are {record['bbox']} and {record['area']}; its mask has {box}"
        if drawn[mask].any():
            yield f"the mask of {record['actor']} covers that of another actor"
        drawn[mask] = record["instance"]
    if "instance" in pictures:
        other = np.asarray(pictures["instance"], np.int64) != drawn
        if other.any():
            yield f"{int(other.sum())} pixels of the instance picture differ from the masks"
    if "semantic" in pictures:
        tag, semantic = drawn // 1000, np.asarray(pictures["semantic"], np.int64)
        rider = np.isin(tag, _TWO_WHEELERS) & (semantic == _RIDER)
        other = (drawn > 0) & (semantic != tag) & ~rider
        if other.any():
            yield f"{int(other.sum())} pixels of the semantic picture have another class than their actor"


def _depth_faults(
    frame: LabelledFrame, sensor: SensorPlan, pictures: Mapping[str, NDArray[np.generic]]
) -> Iterator[str]:
    """Visible pixels, placed in the world by depth and calibration, lie in the tight box of their actor."""
    calibration = frame["calibration"]
    to_world, to_camera = (_matrix(calibration[key]) for key in ("camera_to_world", "world_to_camera"))
    if np.abs(_product(to_world, to_camera) - np.eye(4)).max() > _NEAR:
        yield "camera_to_world is not the inverse of world_to_camera"
    if "depth" not in pictures or sensor.camera.lens_k or sensor.camera.lens_kcube:
        return
    depth, k = np.asarray(pictures["depth"], np.float64), np.array(calibration["K"])
    if not (depth > 0.0).all():
        yield "the depth picture has distances that are not positive"
    for record in frame["objects"]:
        y, x = np.nonzero(unpacked(record["counts"], sensor.camera.width, sensor.camera.height))
        z = depth[y, x]
        optical = np.stack([(x + 0.5 - k[0, 2]) / k[0, 0] * z, (y + 0.5 - k[1, 2]) / k[1, 1] * z, z, np.ones(len(z))])
        place = _product(to_world, optical)[:3]
        box = record["tight3d_world"]
        inside = np.abs(_in_box(place, box)) <= np.array(box["size"])[:, None] / 2 + _MARGIN + 1e-3 * z
        if inside.all(axis=0).mean() < _INSIDE:
            yield f"pixels of {record['actor']} lie outside of its tight box"


def _record_faults(record: LabelRecord, frame: LabelledFrame, rows: Rows) -> Iterator[str]:
    """The numbers of a record agree with each other, with the calibration, and with `tracks.csv`."""
    name = record["actor"]
    if abs(record["visible_fraction"] - record["area"] / max(record["amodal_area"], 1)) > 1e-6:
        yield f"visible_fraction of {name} is not area / amodal_area"
    x, y, wide, tall = record["bbox"]
    left, top, width, height = record["amodal_bbox"]
    if record["amodal_area"] < record["area"] or not (
        left <= x and top <= y and left + width >= x + wide and top + height >= y + tall
    ):
        yield f"the amodal box of {name} does not contain its visible pixels"
    if not 0.0 <= record["truncation"] <= 1.0:
        yield f"truncation of {name} is not between 0 and 1"
    centre = np.array(record["box3d_world"]["centre"])
    camera = _matrix(frame["calibration"]["world_to_camera"])
    x_right, y_down, z_ahead = _product(camera, np.append(centre, 1.0)[:, None])[:3, 0]
    own = np.array(record["box3d"]["centre"])
    if np.abs(own - (z_ahead, -x_right, -y_down)).max() > _NEAR:
        yield f"box3d and box3d_world of {name} are different places"
    if abs(record["distance"] - float(np.sqrt((own * own).sum()))) > _NEAR:
        yield f"distance of {name} is not that of the centre of its body box"
    if not rows:
        return
    row = rows.get((frame["frame"], name))
    if row is None or row["present"] != 1.0:
        yield f"{name} is visible, and tracks.csv says that it is not in the scene"
        return
    there = np.array([row[f"box_{axis}"] for axis in "xyz"])
    speed = np.array([row[f"v{axis}"] for axis in "xyz"])
    if np.abs(there - centre).max() > _NEAR:
        yield f"the body box of {name} is elsewhere in tracks.csv"
    if np.abs(speed - np.array(record["velocity"])).max() > _NEAR:
        yield f"{name} has another velocity in tracks.csv"


def _tracks(dataset: Dataset, variant: ScenarioPlan) -> Rows:
    """Return the rows of `tracks.csv`.

    Raises:
        ValueError: it lacks a row, has one twice, or a row has no finite numbers; the message names the line.
        OSError: it cannot be read.
    """
    numbers = {actor.name: actor.tag * 1000 + actor.instance for actor in variant.scene.actors}
    lines = _table(dataset, layout.tracks_file(variant.variant), COLUMNS)
    expected = ((frame, name) for frame in range(variant.scene.clock.frames) for name in numbers)
    rows: Rows = {}
    for line, (frame, name) in enumerate(expected, start=2):
        row = next(lines, None)
        if row is None:
            raise ValueError(f"line {line} is missing: frame {frame} of {name}")
        if (row["frame"], row["actor"], row["instance"]) != (str(frame), name, str(numbers[name])):
            raise ValueError(f"line {line} is not that of frame {frame} of {name}")
        try:
            values = {key: float(text) for key, text in row.items() if key != "actor"}
        except (TypeError, ValueError):
            raise ValueError(f"line {line} has a value that is not a number") from None
        turn = sum(values[f"q{axis}"] * values[f"q{axis}"] for axis in "xyzw")
        if not np.isfinite([*values.values()]).all() or abs(turn - 1.0) > 1e-4 or values["present"] not in (0.0, 1.0):
            raise ValueError(f"line {line} has numbers out of their range")
        rows[frame, name] = values
    if next(lines, None) is not None:
        raise ValueError("it has more rows than frames and actors")
    return rows


def _event_faults(
    dataset: Dataset, variant: ScenarioPlan, seen: Mapping[tuple[str, str], Sequence[int]]
) -> Iterator[Fault]:
    """Frames of `events.csv` are in the clip and in order; `track` rows agree with the labels."""
    path = layout.events_file(variant.variant)
    expected = {(*key, str(min(at)), str(max(at)), str(len(at))) for key, at in seen.items()}
    found: set[tuple[str, ...]] = set()
    try:
        before = 0
        for line, row in enumerate(_table(dataset, path, events.COLUMNS), start=2):
            first, last = int(row["frame"]), int(row["end_frame"])
            if not before <= first <= last < variant.scene.clock.frames:
                yield Fault(path, line, "its frames are out of order, or not of the clip")
            before = max(before, min(first, variant.scene.clock.frames - 1))
            if row["event"] == "track":
                found.add((row["subject"], row["sensor"], row["frame"], row["end_frame"], row["value"]))
    except (OSError, ValueError, TypeError) as error:
        yield _whole(path, f"{error}")
        return
    for (subject, sensor), rows in groupby(sorted(found ^ expected), key=lambda row: row[:2]):
        yield _whole(path, f"labels and `track` rows of {subject} in {sensor} differ: {next(iter(rows))[2:]}")


def _table(dataset: Dataset, path: str, columns: str) -> Iterator[dict[str, str]]:
    """Yield the rows of a CSV file.

    Raises:
        ValueError: it has other columns, or is not UTF-8.
        OSError: it cannot be read.
    """
    body = read_inside(dataset.root, path, _MAX_TABLE_BYTES)
    reader = csv.DictReader(io.StringIO(body.decode(), newline=""))
    if ",".join(reader.fieldnames or ()) != columns:
        raise ValueError("it has other columns")
    return reader


def _matrix(rows: Sequence[Sequence[float]]) -> Array:
    return np.array(rows, np.float64)


def _in_box(places: Array, box: Box3d) -> Array:
    """Return places [3, N] of the world in the axes of a box, from its centre."""
    w, x, y, z = box["rotation"]
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return _product(axes.T, places - np.array(box["centre"])[:, None])


def _product(a: Array, b: Array) -> Array:
    """Return the product of two matrices, in the same order of sums on every host."""
    total: Array = a[:, 0, None] * b[None, 0]
    for k in range(1, a.shape[1]):
        total = total + a[:, k, None] * b[None, k]
    return total
