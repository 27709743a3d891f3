"""The weather of a plan, and the declaration of every weather parameter.

Recipes, presets, imports from CARLA, portraits and the tables of the documentation follow from these declarations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema

from recipe_compiler.ir.plan_types import Number, Plan

UNSET = -1.0
"""CARLA's mark of a parameter without a value."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of the weather: a number from `low` to `high`; by default a percentage."""

    effect: str  # on a picture, for documentation and editors
    low: float = 0
    high: float = 100
    engine: float = 0.0  # the engine's own default, the value of an unset parameter
    constructor: float = 0.0  # default of CARLA's Python constructor
    in_carla: bool = True  # whether CARLA has it; otherwise imports from CARLA leave it out
    usual: float = 0.0  # in presets whose table has no column for it, and in portraits

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return handler(Annotated[source, Field(ge=self.low, le=self.high)])


class Weather(Plan):
    """CARLA's weather parameters, in its order, and then those that it lacks.

    The angles of the sun are not part of a plan, which has a `Sun`.
    """

    cloudiness: Annotated[Number, Parameter("percent of clouds, which cover the sky, dim the sun and soften shadows")]
    precipitation: Annotated[
        Number, Parameter("percent of rain: streaks that fall through the scene, mist, grey clouds, wet ground")
    ]
    precipitation_deposits: Annotated[Number, Parameter("percent of puddles, at fixed hollows of the ground")]
    wind_intensity: Annotated[
        Number,
        Parameter("percent of wind, which slants rain and moves clouds and the light on leaves", engine=0.35),
    ]
    sun_azimuth_angle: ClassVar = Parameter(
        "degrees to the sun from +x, clockwise seen from above, as in CARLA", high=360, usual=UNSET
    )
    sun_altitude_angle: ClassVar = Parameter(
        "degrees of the sun above the horizon; between 5 and -1, windows are lit one by one and lamps are switched on",
        low=-90,
        high=90,
        engine=75.0,
    )
    fog_density: Annotated[
        Number, Parameter("percent of fog: visual range by Koschmieder's law, 45 m at 100, 180 m at 50, 4.5 km at 10")
    ]
    fog_distance: Annotated[Number, Parameter("metres to where fog begins", high=10_000)]
    fog_falloff: Annotated[
        Number,
        Parameter("how fast fog thins with height: at 1, by a factor of e every 10 m", high=1000, engine=0.2),
    ]
    wetness: Annotated[
        Number, Parameter("percent: darkens porous surfaces, adds a glossy film to the ground and to vehicles")
    ]
    scattering_intensity: Annotated[
        Number,
        Parameter("percent: light that fog, rain and dust scatter, so lamps and the sun glow; none at 0", usual=1.0),
    ]
    mie_scattering_scale: Annotated[
        Number,
        Parameter("haze, as by pollen: a milky sky, light around the sun, less contrast far away", high=5, usual=0.03),
    ]
    rayleigh_scattering_scale: Annotated[
        Number,
        Parameter(
            "scattering by air molecules: a bluer zenith and redder sunsets",
            high=2,
            engine=0.0331,
            constructor=0.0331,
            usual=0.0331,
        ),
    ]
    dust_storm: Annotated[Number, Parameter("percent of dust: brown air, in which only outlines are visible at 45 m")]


def _declared(name: str) -> Parameter:
    field = Weather.model_fields.get(name)
    parameter = getattr(Weather, name) if field is None else field.metadata[-1]
    assert isinstance(parameter, Parameter)
    return parameter


PARAMETERS: dict[str, Parameter] = {name: _declared(name) for name in Weather.__annotations__}
"""All parameters of a recipe's weather by name, in the order of `Weather`."""
