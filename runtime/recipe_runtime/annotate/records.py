"""What is recorded of a frame and of a video: the input of every annotation file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import SensorPlan

from recipe_runtime.annotate.objects import Record


def label_digest(records: list[Record]) -> str:
    """Identity of a frame's labels."""
    return digest("labels/1", records)


@dataclass(frozen=True)
class Video:
    """The frames of one sensor in one variant, in order."""

    variant: str
    sensor: SensorPlan
    fps: int
    frames: tuple[FrameRecord, ...]

    @property
    def name(self) -> str:
        """Its name in every annotation file."""
        return f"{self.variant}/{self.sensor.name}"


# frame, objects, digests {modality: digest}, rgb {variant: digest},
# files {path: [size, SHA-256, stamp of the written file]}
FrameRecord = dict[str, Any]
