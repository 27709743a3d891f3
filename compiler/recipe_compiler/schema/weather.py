"""The sky of a recipe: weather, and the place and date that turn a time of day into a sun position."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from recipe_compiler.schema.fields import NAME_LENGTH, Model, Percent, bounded


class Weather(Model):
    """CARLA's fourteen weather parameters, over a preset. Absent ones are the preset's."""

    preset: Annotated[
        str, Field(max_length=NAME_LENGTH, description="A CARLA preset; `weather: ClearNoon` is short for it.")
    ] = "Default"
    cloudiness: Annotated[Percent | None, Field(description="Clouds, 0 to 100.")] = None
    precipitation: Annotated[Percent | None, Field(description="Rain, 0 to 100.")] = None
    precipitation_deposits: Annotated[Percent | None, Field(description="Puddles, 0 to 100.")] = None
    wind_intensity: Annotated[Percent | None, Field(description="Wind, 0 to 100.")] = None
    sun_azimuth_angle: Annotated[
        float | None, bounded(0, 360, "CARLA's azimuth: clockwise, seen from above, from +x.")
    ] = None
    sun_altitude_angle: Annotated[float | None, bounded(-90, 90, "Degrees above the horizon.")] = None
    fog_density: Annotated[Percent | None, Field(description="Fog, 0 to 100.")] = None
    fog_distance: Annotated[float | None, bounded(0, 10_000, "Metres at which fog starts.")] = None
    fog_falloff: Annotated[float | None, bounded(0, 1000, "How fast fog thins with height.")] = None
    wetness: Annotated[Percent | None, Field(description="How wet surfaces are, 0 to 100.")] = None
    scattering_intensity: Annotated[Percent | None, Field(description="Light that fog scatters, 0 to 100.")] = None
    mie_scattering_scale: Annotated[float | None, bounded(0, 5, "Scattering by large particles.")] = None
    rayleigh_scattering_scale: Annotated[float | None, bounded(0, 2, "Scattering by air.")] = None
    dust_storm: Annotated[Percent | None, Field(description="Dust in the air, 0 to 100.")] = None


class Geography(Model):
    """Where and on which day `time` is told. The town's +x points east, its +y north."""

    latitude: Annotated[float, bounded(-89, 89, "Degrees north.")] = 49.0
    longitude: Annotated[float, bounded(-180, 180, "Degrees east.")] = 8.0
    date: Annotated[
        str,
        StringConstraints(pattern=r"^(19|20)[0-9]{2}-[0-9]{2}-[0-9]{2}$"),
        Field(description='The day, quoted: "2022-08-12".'),
    ] = "2022-08-12"
    utc_offset: Annotated[float | None, bounded(-14, 14, "Hours ahead of UTC; absent: longitude / 15, rounded.")] = None
