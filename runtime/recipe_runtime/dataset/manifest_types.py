"""Typed records of a dataset's `manifest.json`."""

from __future__ import annotations

from typing import Literal, TypeAlias, TypedDict

FrameDigests: TypeAlias = dict[
    str, dict[str, list[str]]
]  # by sensor and modality, in the order of the frames that the sensor takes


class OutputRecord(TypedDict):
    """The outputs that the recipe requests besides pictures."""

    annotations: list[Literal["kwcoco", "coco", "mots_txt", "mots_png"]]
    depth: Literal["carla", "npy"]


class FileRecord(TypedDict):
    """A file of the dataset: size in bytes, SHA-256 in hex."""

    size: int
    sha256: str


class _Intervals(TypedDict, total=False):
    """Frames from one picture to the next, by sensor; without sensors that take every frame, absent if all do."""

    intervals: dict[str, int]


class PlannedVariant(_Intervals):
    """The part of a variant's record that depends on its plan only: digests of the plan and its parts, the folder."""

    plan: str
    scene: str
    rig: str
    appearance: str
    folder: str


class VariantRecord(PlannedVariant):
    """A variant: the digests of its plan, of the plan's parts, of its Trace and of its frames, and its folder."""

    trace: str
    frames: FrameDigests


class ManifestHead(TypedDict):
    """The part of a manifest that depends on the plan only."""

    format: str
    recipe: str
    description: str
    plan: str
    outputs: OutputRecord
    stages: dict[str, int]


class RequiredManifest(ManifestHead):
    """The fields that every manifest has."""

    identity: str
    tools: dict[str, str]
    order: list[str]
    variants: dict[str, VariantRecord]
    files: dict[str, FileRecord]
    pictures: dict[str, FileRecord]


class Manifest(RequiredManifest, total=False):
    """All of `manifest.json`; `manifest.py` describes the fields."""

    recipe_file: str | None
