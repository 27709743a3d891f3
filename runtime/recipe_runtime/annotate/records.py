"""The records of objects, frames and videos from which every annotation file is written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias, TypedDict

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import SensorPlan

from recipe_runtime.annotate.calibration import Calibration
from recipe_runtime.core.documents import Box, Four, Number, Triple, Whole


class Box3d(TypedDict):
    """An oriented box in a frame of reference with z up: the world's, or the sensor's with x forward and y left."""

    centre: Triple  # x, y, z in metres
    size: Triple  # length, width, height in metres
    rotation: Four  # unit quaternion w, x, y, z from the axes of the box to those of the frame of reference
    yaw: Number  # degrees; the whole rotation if the actor, and the sensor in its frame, are level


class Boxes(TypedDict):
    """The boxes of an actor in a frame, see `annotate.actor_boxes`."""

    box3d: Box3d  # body box, in the sensor's frame
    box3d_world: Box3d  # body box, in the world frame
    tight3d: Box3d  # tight box, in the sensor's frame
    tight3d_world: Box3d  # tight box, in the world frame


class LabelRecord(Boxes):
    """One visible object of one frame, as plain JSON. Non-integers have six decimal places."""

    instance: Whole  # class tag * 1000 + number of the actor, in every sensor and frame; for tracks see `ids`
    actor: str  # name in the recipe
    bbox: Box  # x, y, width, height of the visible pixels
    area: Whole  # number of visible pixels
    counts: str  # mask of the visible pixels in COCO's compressed run-length code
    amodal_bbox: Box  # x, y, width, height of the pixels within the image that it would cover unoccluded
    amodal_area: Whole  # number of those pixels
    visible_fraction: Number  # area / amodal_area
    truncation: Number  # share of its projected box, occluded or not, that lies outside the image, 0 to 1
    distance: Number  # from the sensor to the centre of the body box, metres
    velocity: Triple  # x, y, z in the world frame, m/s


FileRow: TypeAlias = tuple[int, str]
"""Size in bytes and SHA-256 of a file."""


class LabelledFrame(TypedDict):
    """The labels of one frame of one sensor: a line of `labels.jsonl`."""

    frame: Whole
    time: Number  # seconds since frame 0
    calibration: Calibration
    objects: list[LabelRecord]


class FrameRecord(LabelledFrame):
    """One frame of one view: its labels, its digests and the files written for it."""

    digests: dict[str, str]  # by label modality, and `labels` for the objects
    rgb: dict[str, str]  # digest of the colour image, by variant
    files: dict[str, FileRow]  # by path in the dataset


def only_labels(record: LabelledFrame) -> LabelledFrame:
    """Return the labels of a frame, without what else is recorded of it."""
    return {
        "frame": record["frame"],
        "time": record["time"],
        "calibration": record["calibration"],
        "objects": record["objects"],
    }


def label_digest(frame: LabelledFrame) -> str:
    """Return the identity of the labels of a frame."""
    return digest("labels/2", only_labels(frame))


@dataclass(frozen=True)
class Video:
    """The frames of one sensor in one variant, in order. `fps` is the clip's rate, in which frames are numbered."""

    variant: str
    scene: str  # digest of the scene; variants with equal scenes have equal motion
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


def by_variant(videos: Iterable[Video]) -> dict[str, list[Video]]:
    """Return the videos of each variant, in their order."""
    found: dict[str, list[Video]] = {}
    for video in videos:
        found.setdefault(video.variant, []).append(video)
    return found
