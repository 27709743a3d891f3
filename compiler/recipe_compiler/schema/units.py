"""Remedies for numbers that are written with a unit: the value in the unit of the field."""

from __future__ import annotations

import math
import re

_NUMBER_WITH_UNIT = re.compile(r"([-+]?[0-9]{1,9}(?:\.[0-9]{1,9})?) ?([A-Za-zµ°%/²]{1,12})\Z")
_UNIT = re.compile(r"\b(m/s|metres|degrees|seconds|hours|percent|kelvins|1/s)(?!\w)", re.IGNORECASE)  # in descriptions
_FACTORS: dict[str, dict[str, float]] = {  # unit of a field -> other spellings and units, each in that unit
    "metres": dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0)
    | dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 0.01)
    | dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 0.001)
    | dict.fromkeys(("km", "kilometer", "kilometers", "kilometre", "kilometres"), 1000.0)
    | dict.fromkeys(("ft", "foot", "feet"), 0.3048)
    | dict.fromkeys(("in", "inch", "inches"), 0.0254)
    | {"yd": 0.9144, "mi": 1609.344, "mile": 1609.344, "miles": 1609.344},
    "degrees": dict.fromkeys(("°", "deg", "degs", "degree", "degrees"), 1.0)
    | dict.fromkeys(("rad", "rads", "radian", "radians"), 180.0 / math.pi),
    "seconds": dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0)
    | dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 0.001)
    | dict.fromkeys(("min", "mins", "minute", "minutes"), 60.0)
    | dict.fromkeys(("h", "hour", "hours"), 3600.0),
    "m/s": dict.fromkeys(("m/s", "mps"), 1.0)
    | dict.fromkeys(("km/h", "kmh", "kmph", "kph"), 1 / 3.6)
    | dict.fromkeys(("kn", "kt", "kts", "knot", "knots"), 1852 / 3600)
    | {"mph": 0.44704, "mi/h": 0.44704, "ft/s": 0.3048, "cm/s": 0.01},
    "percent": {"%": 1.0, "percent": 1.0, "pct": 1.0},
    "kelvins": {"k": 1.0, "kelvin": 1.0, "kelvins": 1.0},
    "hours": dict.fromkeys(("h", "hour", "hours"), 1.0) | {"min": 1 / 60, "minutes": 1 / 60},
    "1/s": {"/s": 1.0, "hz": 1.0},
}
_KNOWN = frozenset(unit for units in _FACTORS.values() for unit in units) - {"%", "hz"}  # % of a share, Hz of fps
_DECIMALS = {"m/s": 1, "degrees": 2}  # of converted values; three for other units


def unit_of(description: str | None) -> str | None:
    """Return the unit that the description of a field names; None if it names none."""
    found = _UNIT.search(description or "")
    return found[1].lower() if found else None


def remedy(text: str, unit: str | None) -> str | None:
    """Return the remedy for a number with a unit; None if the text is something else.

    Args:
        text: the value that is given.
        unit: the unit of the field, as `unit_of` returns it.
    """
    found = _NUMBER_WITH_UNIT.match(text)
    if found is None:
        return None
    number, given = found[1], found[2].lower()
    if unit is None:
        return "write a number without a unit" if given in _KNOWN else f"write {number}, without the unit"
    factor = _FACTORS[unit].get(given)
    if factor is None:
        return f"write it in {unit}, without the unit"
    if factor == 1.0:
        return f"write {number}, without the unit"
    value = float(number) * factor
    rounded = round(value, _DECIMALS.get(unit, 3)) or float(f"{value:.3g}")
    return f"write {rounded:.10g}: the unit is {unit}"
