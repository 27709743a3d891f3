"""Limits and field types of plans."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

# Limits of a plan, whether it was compiled here or read from a file. `plan_bounds` has the ranges
# of bodies' shapes, and how many things a town may have of each kind.
MAX_VARIANTS, MAX_SENSORS, MAX_FRAMES = 10_000, 1_000, 1_000_000
MAX_ELEMENTS, MAX_ACTORS, MAX_PROPS, MAX_POINTS = 10_000, 1_000, 1_000, 10_000
MAX_BODIES = MAX_ELEMENTS + MAX_ACTORS + MAX_PROPS
MAX_SLOTS = 64
MAX_FILE_BYTES = 32 << 20
MAX_PIXELS_A_SIDE = 4096
MAX_VARIANT_NAME, MAX_DESCRIPTION = 240, 2000  # characters


def fixed(value: float) -> float:
    """The value as a fixed decimal of six places; -0 becomes 0."""
    return round(value, 6) + 0.0


Number = Annotated[float, Field(allow_inf_nan=False), AfterValidator(fixed)]
Metres = Annotated[Number, Field(ge=-100_000, le=100_000)]
Degrees = Annotated[Number, Field(ge=-10_000, le=10_000)]
Percent = Annotated[Number, Field(ge=0, le=100)]
Colour = Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")]  # sRGB
Name = Annotated[str, Field(min_length=1, max_length=100)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Share = Annotated[Number, Field(ge=0, le=1)]
Ten = Annotated[Number, Field(ge=0, le=10)]
Tag = Annotated[int, Field(ge=0, le=255)]  # CARLA 0.9.14+ semantic tag
Slot = Annotated[str, Field(max_length=1000)]
Shape = Annotated[dict[Name, Number], Field(max_length=32)]
Slots = Annotated[dict[Slot, Colour], Field(max_length=MAX_SLOTS)]
