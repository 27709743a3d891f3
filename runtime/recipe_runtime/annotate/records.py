"""The records of objects, frames and videos from which every annotation file is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, TypedDict

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import SensorPlan


class Box3d(TypedDict):
    """The oriented box of an actor, in the sensor's frame: x forward, y left, z up.

    The box contains the actor in all of its poses, so that its size is constant over a track.
    """

    centre: list[float]  # x, y, z in metres
    size: list[float]  # length, width, height in metres
    rotation: list[float]  # unit quaternion w, x, y, z from the axes of the box to those of the sensor
    yaw: float  # degrees; the whole rotation if sensor and actor are level


class LabelRecord(TypedDict):
    """One visible object of one frame, as plain JSON. Non-integers have six decimal places."""

    instance: int  # class tag * 1000 + number: the identity of the track in every sensor, frame and variant
    actor: str  # name in the recipe
    bbox: list[int]  # x, y, width, height of the visible pixels
    area: int  # number of visible pixels
    counts: str  # mask of the visible pixels in COCO's compressed run-length code
    amodal_bbox: list[int]  # x, y, width, height of the pixels within the image that it would cover unoccluded
    amodal_area: int  # number of those pixels
    visible_fraction: float  # area / amodal_area
    truncation: float  # share of its projected box, occluded or not, that lies outside the image, 0 to 1
    box3d: Box3d
    distance: float  # from the sensor to the centre of the box, metres
    velocity: list[float]  # x, y, z in the world frame, m/s


_LENGTHS = {"bbox": 4, "amodal_bbox": 4, "velocity": 3}  # of lists of numbers
_BOX_LENGTHS = {"centre": 3, "size": 3, "rotation": 4}
_TEXTS = ("actor", "counts")
_NUMBERS = ("instance", "area", "amodal_area", "visible_fraction", "truncation", "distance")


def is_label(record: object) -> bool:
    """Whether plain JSON has the fields of a `LabelRecord`, and nothing else."""
    if not isinstance(record, dict) or record.keys() != LabelRecord.__annotations__.keys():
        return False
    box = record["box3d"]
    if not isinstance(box, dict) or box.keys() != Box3d.__annotations__.keys() or not _is_number(box["yaw"]):
        return False
    return (
        all(_are_numbers(box[key], length) for key, length in _BOX_LENGTHS.items())
        and all(_are_numbers(record[key], length) for key, length in _LENGTHS.items())
        and all(isinstance(record[key], str) for key in _TEXTS)
        and all(_is_number(record[key]) for key in _NUMBERS)
    )


def _are_numbers(value: object, length: int) -> bool:
    return isinstance(value, list) and len(value) == length and all(map(_is_number, value))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


FileRow: TypeAlias = tuple[int, str] | tuple[int, str, str]
"""Size in bytes, SHA-256, and, of a file in a workspace, its stamp (`core.files.stamp_of`)."""


class LabelledFrame(TypedDict):
    """The labels of one frame of one sensor."""

    frame: int
    objects: list[LabelRecord]


class FrameRecord(LabelledFrame):
    """One frame of one view: its labels, its digests and the files written for it."""

    digests: dict[str, str]  # by label modality, and `labels` for the objects
    rgb: dict[str, str]  # digest of the colour image, by variant
    files: dict[str, FileRow]  # by path in the dataset


def label_digest(records: Sequence[LabelRecord]) -> str:
    """Return the identity of the labels of a frame."""
    return digest("labels/1", list(records))


@dataclass(frozen=True)
class Video:
    """The frames of one sensor in one variant, in order. `fps` is the clip's rate, in which frames are numbered."""

    variant: str
    sensor: SensorPlan
    fps: int
    frames: Sequence[FrameRecord]  # that the sensor takes

    @property
    def length(self) -> int:
        """The number of frames from the clip's first to the last that the sensor takes, at `fps`."""
        return (len(self.frames) - 1) * self.sensor.interval + 1 if self.frames else 0

    @property
    def name(self) -> str:
        """The name of the video in every annotation file."""
        return f"{self.variant}/{self.sensor.name}"
