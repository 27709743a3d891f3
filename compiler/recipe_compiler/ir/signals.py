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


def green_left(shape: Mapping[str, float], seconds: float) -> float:
    """Return the seconds for which a signal stays green; 0 if it is not green."""
    return max(0.0, shape["green"] - _passed(shape, seconds))


def _passed(shape: Mapping[str, float], seconds: float) -> float:
    """Return the seconds since the last green began."""
    since = seconds - shape["green_from"]
    return since - shape["cycle"] * math.floor(since / shape["cycle"])
