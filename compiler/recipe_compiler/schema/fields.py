"""Field types that the parts of the recipe language share, and the limits of the language.

Models are frozen, refuse unknown keys and convert no types (`"30"` is not a number). Shorthands are expanded before
validation. Lengths are in metres, times in seconds, angles in degrees, speeds in metres per second.
"""

from __future__ import annotations

from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

MAX_FRAMES = 100_000
MAX_VARIANTS = 10_000
MAX_DRAWS = 100_000  # of all variants together
MAX_SEED = 2**32 - 1
MAX_DRAWN = 1e15  # limit of the bounds of a draw: far larger than any number in a recipe, and the sum of two is finite
NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"  # names become folder names; tools that use file stems do not expect dots
BLUEPRINT = r"^[A-Za-z0-9_.?*-]+$"
OWN_BLUEPRINT = r"^(walker\.pedestrian|vehicle\.(sedan|hatchback|suv|van|pickup|bus|truck))\.[A-Za-z0-9_-]+$"
NAME_LENGTH = 64
MAX_PROPS = 1000
MAX_ASSETS = 100
MAX_BLUEPRINTS = 50
TRAFFIC_LIMIT = 250  # instance numbers are three digits, assigned in lowering/placement.py
PARKED_LIMIT = 100  # likewise

Name = Annotated[str, StringConstraints(pattern=NAME, max_length=NAME_LENGTH)]
ActorName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=NAME_LENGTH)]
OwnBlueprint = Annotated[str, StringConstraints(pattern=OWN_BLUEPRINT, max_length=NAME_LENGTH)]
Glob = Annotated[str, StringConstraints(pattern=BLUEPRINT, max_length=NAME_LENGTH)]
Weight = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Colour = Annotated[str, StringConstraints(pattern=r"^#[0-9A-Fa-f]{6}$")]
Metres = Annotated[float, Field(ge=-10_000, le=10_000, allow_inf_nan=False)]
Degrees = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]
Percent = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
Magnitude = Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)]
Turn = Annotated[float, Field(ge=0, le=180, allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]
Loose = Field(strict=False)  # accept a list for a tuple

Pair = TypeVar("Pair", tuple[int, int], tuple[float, float])


def bounded(low: float, high: float, description: str) -> FieldInfo:
    """Return the field of a finite number from low to high, both included."""
    field: FieldInfo = Field(ge=low, le=high, allow_inf_nan=False, description=description)
    return field


class Model(BaseModel):
    """Base class of all parts of a recipe: frozen, and strict about keys and types."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def ordered(value: Pair) -> Pair:
    """Return the range unchanged.

    Raises:
        PydanticCustomError: the first number is above the second.
    """
    if value[0] > value[1]:
        low, high = (f"{number:g}" for number in value)
        raise PydanticCustomError(
            "range",
            "the range [{low}, {high}] has its larger number first; write the lower number first",
            {"low": low, "high": high},
        )
    return value


def distinct(value: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names unchanged.

    Raises:
        PydanticCustomError: a name is listed twice.
    """
    for name in value:
        if value.count(name) > 1:
            raise PydanticCustomError("once", "names {name} twice; once is enough", {"name": name})
    return value
