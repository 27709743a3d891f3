"""The types of a dataset's `manifest.json`, into which it is decoded; `manifest.py` describes the fields."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias, TypedDict

from recipe_compiler.ir.about import MAX_AUTHORS, MAX_LINE, MAX_TEXT
from recipe_compiler.ir.modalities import DIGEST_KINDS
from recipe_compiler.ir.plan_types import MAX_DESCRIPTION, MAX_INTERVAL, MAX_SENSORS, MAX_VARIANT_NAME, MAX_VARIANTS

from recipe_runtime.core.documents import Meta, Sha256

_Name: TypeAlias = Annotated[str, Meta(min_length=1, max_length=100)]
_Variant: TypeAlias = Annotated[str, Meta(max_length=MAX_VARIANT_NAME)]
_Path: TypeAlias = Annotated[str, Meta(max_length=2000)]
_Interval: TypeAlias = Annotated[int, Meta(gt=1, le=MAX_INTERVAL)]
_Line: TypeAlias = Annotated[str, Meta(max_length=MAX_LINE)]
_Frames: TypeAlias = Annotated[list[Sha256], Meta(min_length=1)]  # in the order of the frames that the sensor takes
_Kind: TypeAlias = Annotated[str, Meta(pattern=f"^({'|'.join(DIGEST_KINDS)})$")]
_Modalities: TypeAlias = Annotated[dict[_Kind, _Frames], Meta(min_length=1)]
FrameDigests: TypeAlias = dict[_Name, _Modalities]  # by sensor
Outputs: TypeAlias = Annotated[
    dict[_Name, list[_Name] | _Name], Meta(max_length=100)
]  # the annotation formats, and the form of each listed modality's files; `reader` checks them


class FileRecord(TypedDict):
    """A file of the dataset: size in bytes, SHA-256 in hex."""

    size: Annotated[int, Meta(ge=0, le=1 << 40)]
    sha256: Sha256


class _Intervals(TypedDict, total=False):
    """Frames from one picture to the next, by sensor; without sensors that take every frame, absent if all do."""

    intervals: Annotated[
        dict[_Name, Annotated[int, Meta(gt=1, le=MAX_INTERVAL)]], Meta(min_length=1, max_length=MAX_SENSORS)
    ]


class PlannedVariant(_Intervals):
    """The part of a variant's record that depends on its plan only: digests of the plan and its parts, the folder."""

    plan: Sha256
    scene: Sha256
    rig: Sha256
    appearance: Sha256
    folder: str


class VariantRecord(PlannedVariant):
    """A variant: the digests of its plan, of the plan's parts, of its Trace and of its frames, and its folder."""

    trace: Sha256
    frames: FrameDigests


class _About(TypedDict, total=False):
    """What the recipe states about the dataset; absent if it states nothing. `reader` checks it."""

    about: Annotated[
        dict[_Name, Annotated[str, Meta(max_length=MAX_TEXT)] | Annotated[list[_Line], Meta(max_length=MAX_AUTHORS)]],
        Meta(min_length=1, max_length=100),
    ]


class ManifestHead(_About):
    """The part of a manifest that depends on the plan only."""

    format: Literal["recipe/manifest/1"]
    recipe: _Name
    description: Annotated[str, Meta(max_length=MAX_DESCRIPTION)]
    plan: Sha256
    outputs: Outputs
    stages: Annotated[dict[_Name, Annotated[int, Meta(ge=0, le=10**6)]], Meta(max_length=100)]


class RequiredManifest(ManifestHead):
    """The fields that every manifest has."""

    identity: Annotated[str, Meta(max_length=400)]
    tools: Annotated[dict[_Name, Annotated[str, Meta(max_length=100)]], Meta(max_length=100)]
    order: Annotated[list[_Variant], Meta(min_length=1, max_length=MAX_VARIANTS)]
    variants: dict[_Variant, VariantRecord]
    files: dict[_Path, FileRecord]
    pictures: dict[_Path, FileRecord]


class Manifest(RequiredManifest, total=False):
    """All of `manifest.json`; `manifest.py` describes the fields."""

    recipe_file: _Path | None
