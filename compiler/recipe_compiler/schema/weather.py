"""The sky of a recipe: weather, and the place and date that turn a time of day into a sun position."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from recipe_compiler.schema.fields import NAME_LENGTH, Model, Percent, bounded


class Weather(Model):
    """CARLA's weather parameters. Parameters that are absent have the values of the preset."""

    preset: Annotated[
        str, Field(max_length=NAME_LENGTH, description="Name of a CARLA preset. `weather: ClearNoon` is short for it.")
    ] = "Default"
    cloudiness: Annotated[Percent | None, Field(description="Cloud cover, percent.")] = None
    precipitation: Annotated[Percent | None, Field(description="Intensity of rain, percent.")] = None
    precipitation_deposits: Annotated[Percent | None, Field(description="Amount of puddles, percent.")] = None
    wind_intensity: Annotated[Percent | None, Field(description="Intensity of wind, percent.")] = None
    sun_azimuth_angle: Annotated[
        float | None, bounded(0, 360, "Azimuth of the sun, degrees clockwise from +x seen from above, as in CARLA.")
    ] = None
    sun_altitude_angle: Annotated[float | None, bounded(-90, 90, "Altitude of the sun above the horizon, degrees.")] = (
        None
    )
    fog_density: Annotated[Percent | None, Field(description="Density of fog, percent.")] = None
    fog_distance: Annotated[float | None, bounded(0, 10_000, "Distance at which fog starts, metres.")] = None
    fog_falloff: Annotated[float | None, bounded(0, 1000, "Decrease of the fog's density with height; 0: none.")] = None
    wetness: Annotated[Percent | None, Field(description="Wetness of surfaces, percent.")] = None
    scattering_intensity: Annotated[Percent | None, Field(description="Light scattered by fog, percent.")] = None
    mie_scattering_scale: Annotated[
        float | None, bounded(0, 5, "Mie scattering: by large particles such as pollen and pollution.")
    ] = None
    rayleigh_scattering_scale: Annotated[float | None, bounded(0, 2, "Rayleigh scattering: by air molecules.")] = None
    dust_storm: Annotated[Percent | None, Field(description="Amount of dust in the air, percent.")] = None


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
