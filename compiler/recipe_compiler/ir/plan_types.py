"""Limits, field types and the base class of plans."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from recipe_compiler.ir.canonical import JsonValue

# Limits of a plan, whether it was compiled here or read from a file. `plan_bounds` has the ranges
# of bodies' shapes, and how many things a town may have of each kind.
MAX_VARIANTS = 10_000
MAX_SENSORS = 1_000
MAX_FRAMES = 1_000_000
MAX_ELEMENTS = 10_000
MAX_ACTORS = 1_000
MAX_PROPS = 1_000
MAX_POINTS = 10_000
MAX_BODIES = MAX_ELEMENTS + MAX_ACTORS + MAX_PROPS
MAX_SLOTS = 64
MAX_FILE_BYTES = 32 << 20
MAX_INTERVAL = 86_400 * 1000  # frames from one picture of a sensor to the next: a day at the highest frame rate
MAX_PIXELS_A_SIDE = 4096
MAX_VARIANT_NAME = 240  # characters
MAX_DESCRIPTION = 2000  # characters


def fixed(value: float) -> float:
    """The value as a fixed decimal of six places; -0 becomes 0."""
    return round(value, 6) + 0.0


Number = Annotated[float, Field(allow_inf_nan=False), AfterValidator(fixed)]
Metres = Annotated[Number, Field(ge=-100_000, le=100_000)]
Degrees = Annotated[Number, Field(ge=-10_000, le=10_000)]
Colour = Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")]  # sRGB
Name = Annotated[str, Field(min_length=1, max_length=100)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Share = Annotated[Number, Field(ge=0, le=1)]
Ten = Annotated[Number, Field(ge=0, le=10)]
Tag = Annotated[int, Field(ge=0, le=255)]  # CARLA 0.9.14+ semantic tag
Slot = Annotated[str, Field(max_length=1000)]
Shape = Annotated[dict[Name, Number], Field(max_length=32)]
Slots = Annotated[dict[Slot, Colour], Field(max_length=MAX_SLOTS)]

P = TypeVar("P", bound="Plan")


class Plan(BaseModel):
    """A frozen value with a canonical form."""

    model_config = ConfigDict(frozen=True, extra="forbid", ignored_types=(cached_property,))

    def document(self) -> dict[str, JsonValue]:
        """This plan as plain JSON values."""
        return self.model_dump(mode="json")

    def model_copy(self: P, *, update: Mapping[str, object] | None = None, deep: bool = False) -> P:
        """Copy the plan. The copy computes its own digests: pydantic would keep those of the original."""
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(copied).model_fields.keys():
            del copied.__dict__[name]
        return copied


class Pose(Plan):
    """A position in metres and an orientation in degrees."""

    x: Metres = 0.0
    y: Metres = 0.0
    z: Metres = 0.0
    yaw: Degrees = 0.0
    pitch: Degrees = 0.0
    roll: Degrees = 0.0


class Point(Plan):
    """A point on the ground plan, in metres."""

    x: Metres
    y: Metres


class FilePlan(Plan):
    """A file that a recipe uses, identified by its content; its path is not part of a plan."""

    sha256: Sha256
    bytes: Annotated[int, Field(ge=0, le=MAX_FILE_BYTES)]
    kind: Literal["glb", "gltf", "obj", "png", "stl"]


class ActorMesh(Plan):
    """The glTF file of an actor's body, in place of a mesh of the library."""

    file: FilePlan
    scale: Annotated[Number, Field(gt=0, le=100_000)] = 1.0  # metres of one unit of the file
    low: tuple[Metres, Metres, Metres]  # its body box, metres; 0 is on the ground midway between axles or hips
    high: tuple[Metres, Metres, Metres]

    @model_validator(mode="after")
    def _size(self) -> ActorMesh:
        if self.file.kind not in ("glb", "gltf") or any(a >= b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError("a body that is not a glTF file with a size")
        return self
