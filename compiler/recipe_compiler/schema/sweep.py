"""The sweep of a recipe: which variants it has, and the random draws of their values."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, StringConstraints, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.schema.fields import MAX_DRAWN, MAX_VARIANTS, Loose, Model, ordered

Bound = Annotated[float, Field(ge=-MAX_DRAWN, le=MAX_DRAWN, allow_inf_nan=False)]
Range = Annotated[tuple[Bound, Bound], Loose, AfterValidator(ordered)]
WholeRange = Annotated[tuple[int, int], Loose, AfterValidator(ordered)]


class Distribution(Model):
    """What a draw takes its value from: exactly one of the four."""

    uniform: Annotated[Range | None, Field(description="[low, high].")] = None
    normal: Annotated[Annotated[tuple[Bound, Bound], Loose] | None, Field(description="[mean, deviation].")] = None
    integer: Annotated[WholeRange | None, Field(description="[low, high], both included.")] = None
    choice: Annotated[
        tuple[bool | int | float | str, ...] | None,
        Field(strict=False, min_length=1, max_length=1000, description="One of these."),
    ] = None
    clip: Annotated[Range | None, Field(description="With `normal`: [low, high].")] = None

    @model_validator(mode="after")
    def _one(self) -> Distribution:
        given = [name for name in ("uniform", "normal", "integer", "choice") if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none"
            raise PydanticCustomError(
                "distribution",
                "a draw is one of uniform, normal, integer, choice, and this has {found}; give one",
                {"found": found},
            )
        if self.clip and not self.normal:
            raise PydanticCustomError("clip", "goes with `normal` only; remove it", {"key": "clip"})
        if self.normal and self.normal[1] < 0:
            raise PydanticCustomError(
                "deviation",
                "the deviation {it} is negative; write 0 or more",
                {"key": "normal", "it": f"{self.normal[1]:g}"},
            )
        return self


class Draw(Model):
    """Random draws, resolved when compiled; each is a variant with the same draws in all axes' values."""

    count: Annotated[int, Field(ge=1, le=MAX_VARIANTS, description="How many draws of each variant.")]
    values: Annotated[
        dict[Annotated[str, StringConstraints(min_length=1, max_length=200)], Distribution],
        Field(min_length=1, max_length=100, description="Path, such as actors.hero1.speed, to distribution."),
    ]


class Sweep(Model):
    """Which variants there are."""

    axes: Annotated[
        tuple[str, ...] | None,
        Field(strict=False, min_length=1, description="Axes to multiply; absent: all, in file order."),
    ] = None
    exclude: Annotated[
        tuple[dict[str, str], ...],
        Field(strict=False, max_length=1000, description="Combinations to leave out: `{weather: foggy}`."),
    ] = ()
    repeats: Annotated[
        int, Field(ge=1, le=MAX_VARIANTS, description="Runs of each variant, each with a seed of its own.")
    ] = 1
    draw: Annotated[Draw | None, Field(description="Random draws.")] = None
