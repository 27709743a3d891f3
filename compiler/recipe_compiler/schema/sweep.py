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
    """The distribution of a random draw: exactly one of uniform, normal, integer and choice."""

    uniform: Annotated[Range | None, Field(description="Continuous uniform distribution, [low, high].")] = None
    normal: Annotated[
        Annotated[tuple[Bound, Bound], Loose] | None,
        Field(description="Normal distribution, [mean, standard deviation]."),
    ] = None
    integer: Annotated[
        WholeRange | None, Field(description="Uniform distribution over the integers [low, high], both included.")
    ] = None
    choice: Annotated[
        tuple[bool | int | float | str, ...] | None,
        Field(strict=False, min_length=1, max_length=1000, description="List of values with equal probability."),
    ] = None
    clip: Annotated[Range | None, Field(description="Limits [low, high] of a `normal` draw.")] = None

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
    """Random draws, resolved at compile time. Draw k has the same values in every combination of the axes."""

    count: Annotated[
        int, Field(ge=1, le=MAX_VARIANTS, description="Number of draws; each variant is repeated for every draw.")
    ]
    values: Annotated[
        dict[Annotated[str, StringConstraints(min_length=1, max_length=200)], Distribution],
        Field(min_length=1, max_length=100, description="Distributions by path, such as actors.hero1.speed."),
    ]


class Sweep(Model):
    """The selection of variants."""

    axes: Annotated[
        tuple[str, ...] | None,
        Field(strict=False, min_length=1, description="Axes to combine. Default: all, in file order."),
    ] = None
    exclude: Annotated[
        tuple[dict[str, str], ...],
        Field(strict=False, max_length=1000, description="Combinations to leave out, such as `{weather: foggy}`."),
    ] = ()
    repeats: Annotated[
        int, Field(ge=1, le=MAX_VARIANTS, description="Number of repetitions of each variant, each with its own seed.")
    ] = 1
    draw: Annotated[Draw | None, Field(description="Random draws of values.")] = None
