"""Traffic lights: which light of a signal is lit, from its plan and the time alone.

The time is in seconds since frame 0; it is negative during the warm-up. A `traffic_light` element has the parameters
`cycle` (seconds from one green to the next), `green_from` (when green begins, within the cycle), `green` and `amber`
(seconds); it is red for the rest of the cycle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

Light = Literal["red", "amber", "green"]
LAMPS = ("red", "amber", "green", "dont_walk", "walk")
"""The lamps of a signal: three for vehicles, two for the pedestrians who cross before it."""
WALK_DELAY = 2.0  # seconds
WALK_CLEARANCE = 8.0  # seconds, the time to cross ten metres at 1.25 m/s


def lit(shape: Mapping[str, float], seconds: float) -> tuple[bool, ...]:
    """Return which of `LAMPS` are lit."""
    shown, walk = light(shape, seconds), may_walk(shape, seconds)
    return shown == "red", shown == "amber", shown == "green", not walk, walk


def light(shape: Mapping[str, float], seconds: float) -> Light:
    """Return the light that a signal shows.

    Args:
        shape: The parameters of its `traffic_light` element.
        seconds: Time since frame 0; negative during the warm-up.
    """
    passed = _passed(shape, seconds)
    if passed < shape["green"]:
        return "green"
    return "amber" if passed < shape["green"] + shape["amber"] else "red"


def _passed(shape: Mapping[str, float], seconds: float) -> float:
    """Return the seconds since the last green began."""
    since = seconds - shape["green_from"]
    return since - shape["cycle"] * math.floor(since / shape["cycle"])


def may_walk(shape: Mapping[str, float], seconds: float) -> bool:
    """Return whether pedestrians may begin to cross the road whose vehicles a signal controls.

    They may from `WALK_DELAY` seconds after the signal has become red until `WALK_CLEARANCE` seconds before it is green
    again, so that they can reach the other side.
    """
    begin, end = shape["green"] + shape["amber"] + WALK_DELAY, shape["cycle"] - WALK_CLEARANCE
    return begin <= _passed(shape, seconds) < end
