"""The sky of a recipe: weather, and the place and date that turn a time of day into a sun position."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field, StringConstraints, create_model

from recipe_compiler.ir.weather import PARAMETERS, Parameter
from recipe_compiler.schema.fields import NAME_LENGTH, Model, bounded


class Preset(Model):
    """CARLA's weather parameters. Parameters that are absent have the values of the preset."""

    preset: Annotated[
        str, Field(max_length=NAME_LENGTH, description="Name of a CARLA preset. `weather: ClearNoon` is short for it.")
    ] = "Default"


def _optional(parameter: Parameter) -> tuple[object, None]:
    description = f"{parameter.effect[0].upper()}{parameter.effect[1:]}."
    return Annotated[float | None, bounded(parameter.low, parameter.high, description)], None


if TYPE_CHECKING:
    Weather = Preset
else:
    _fields = {name: _optional(parameter) for name, parameter in PARAMETERS.items()}
    Weather = create_model("Weather", __base__=Preset, __doc__=Preset.__doc__, **_fields)


class Geography(Model):
    """The location and the date for `time`. +x points east, +y north."""

    latitude: Annotated[float, bounded(-89, 89, "Degrees north.")] = 49.0
    longitude: Annotated[float, bounded(-180, 180, "Degrees east.")] = 8.0
    date: Annotated[
        str,
        StringConstraints(pattern=r"^(19|20)[0-9]{2}-[0-9]{2}-[0-9]{2}$"),
        Field(description='Date, quoted: "2022-08-12".'),
    ] = "2022-08-12"
    utc_offset: Annotated[float | None, bounded(-14, 14, "Hours ahead of UTC. Default: longitude / 15, rounded.")] = (
        None
    )
