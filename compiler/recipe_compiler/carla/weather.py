"""The weather of a configuration: CARLA's parameters, with the defaults of its Python constructor."""

from __future__ import annotations

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Data
from recipe_compiler.carla.report import Node
from recipe_compiler.library.weather import ENGINE_DEFAULTS, PARAMETERS, UNSET

COLLECTOR = dict.fromkeys(PARAMETERS, 0.0) | {"rayleigh_scattering_scale": 0.0331}
"""The parameters of `carla.WeatherParameters()`, which the collector uses for those that a configuration lacks."""

OSCAR = COLLECTOR | {"cloudiness": 25.0, "sun_altitude_angle": 20.0}
"""OSCAR's own weather, of its configs/context/default.yaml."""

_LIMITS = {
    "fog_distance": 10_000.0,
    "fog_falloff": 1000.0,
    "mie_scattering_scale": 5.0,
    "rayleigh_scattering_scale": 2.0,
}


def read(reader: Reader, node: Node, to: str) -> dict[str, Data]:
    """Read the parameters that a map has.

    Args:
        reader: collects what became of them.
        node: the map.
        to: the path of the weather in the recipe.
    """
    found: dict[str, Data] = {}
    for parameter in PARAMETERS:
        child = node.get(parameter)
        value = reader.number(child)
        if child is None or value is None:
            continue
        fits, why = _fitting(parameter, value)
        found[parameter] = fits
        if why:
            reader.ledger.mapped(child, f"{to}.{parameter}", fits, why)
        else:
            reader.ledger.kept(child, f"{to}.{parameter}")
    for child in node.children():
        if child.path[-1] not in PARAMETERS and child.path[-1] != "_target_":
            reader.ledger.ignored(child, "CARLA has no such weather parameter")
    return found


def complete(reader: Reader, given: dict[str, Data], defaults: dict[str, float], to: str) -> dict[str, Data]:
    """All fourteen parameters; those that are not given have defaults.

    Args:
        reader: collects the defaults.
        given: the parameters of the configuration.
        defaults: the others.
        to: the path of the weather in the recipe.
    """
    for parameter in PARAMETERS:
        if parameter not in given:
            why = "not given: the collector's default"
            reader.ledger.default(f"{to}.{parameter}", defaults[parameter], why)
    return {parameter: given.get(parameter, defaults[parameter]) for parameter in PARAMETERS}


def _fitting(parameter: str, value: float) -> tuple[float, str]:
    """The value as recipes allow it, and why it differs; an empty reason if it does not."""
    if value == UNSET and parameter != "sun_altitude_angle":
        return ENGINE_DEFAULTS[parameter], "-1 means unset in CARLA: the engine's default"
    if parameter == "sun_azimuth_angle":
        return (value, "") if 0.0 <= value <= 360.0 else (value % 360.0, "the same direction, from 0 to 360 degrees")
    low, high = (-90.0, 90.0) if parameter == "sun_altitude_angle" else (0.0, _LIMITS.get(parameter, 100.0))
    fits = min(max(value, low), high)
    return fits, "" if fits == value else f"outside {low:g} to {high:g}: the nearest value that the parameter can have"
