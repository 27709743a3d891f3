"""Reads the weather of a configuration: CARLA's parameters, with the defaults of CARLA's Python constructor."""

from __future__ import annotations

from collections.abc import Mapping

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Data
from recipe_compiler.carla.report import Node
from recipe_compiler.ir.weather import PARAMETERS, UNSET
from recipe_compiler.schema.messages import near

COLLECTOR = {name: parameter.constructor for name, parameter in PARAMETERS.items() if parameter.in_carla}
"""The parameters of `carla.WeatherParameters()`, the collector's defaults."""

OSCAR = COLLECTOR | {"cloudiness": 25.0, "sun_altitude_angle": 20.0}
"""OSCAR's default weather, from its configs/context/default.yaml."""


def read(reader: Reader, node: Node | None, to: str, defaults: Mapping[str, float] | None = None) -> dict[str, Data]:
    """Read the weather parameters of a map.

    Args:
        reader: collects problems and outcomes.
        node: the map; None if it is absent.
        to: the path of the weather in the recipe.
        defaults: the values of all parameters that are not given; None: leave these out.
    """
    found: dict[str, Data] = {}
    for parameter in COLLECTOR:
        child = None if node is None else node.get(parameter)
        value = reader.number(child)
        if value is not None:
            valid, why = _clamped(parameter, value)
            found[parameter] = valid
            reader.ledger.record(child, f"{to}.{parameter}", valid, why)
        elif defaults is not None:
            found[parameter] = defaults[parameter]
            reader.ledger.default(f"{to}.{parameter}", defaults[parameter], "not given: the collector's default")
    for child in node.children() if node is not None else ():
        if child.path[-1] not in COLLECTOR and child.path[-1] != "_target_":
            meant = near(str(child.path[-1]), COLLECTOR)
            hint = f", did you mean {meant}?" if meant else ""
            reader.ledger.ignored(child, f"CARLA has no such weather parameter{hint}")
    return found


def _clamped(parameter: str, value: float) -> tuple[float, str]:
    """Return the nearest value that a recipe may have, and the reason if it differs, else an empty text."""
    declared = PARAMETERS[parameter]
    if value == UNSET < declared.low:
        return declared.engine, "-1 means unset in CARLA: the engine's default"
    if parameter == "sun_azimuth_angle":
        return (value, "") if 0.0 <= value <= 360.0 else (value % 360.0, "the same direction, from 0 to 360 degrees")
    valid = min(max(value, float(declared.low)), float(declared.high))
    return valid, "" if valid == value else f"outside {declared.low:g} to {declared.high:g}: clamped"
