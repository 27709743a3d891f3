"""Mount positions of dashcams: ahead of the windscreen, because vehicle glass is opaque."""

from __future__ import annotations

import math
from collections.abc import Mapping

from recipe_runtime.body.skeleton import Bike, has_rider, is_person
from recipe_runtime.meshes.vehicle import shell_of

CLEARANCE = 0.15  # metres between the camera and the body, more than a camera's near plane
_HIGH, _HIGHEST = 0.85, 1.9  # of the cabin's roof; metres, for what is taller than a car
_STEP = 0.01  # metres along the body


def dashcam_mount(shape: Mapping[str, float]) -> tuple[float, float, float] | None:
    """A mount for a dashcam, level and facing ahead.

    Args:
        shape: A blueprint's shape.

    Returns:
        x, y, z in the vehicle's frame (x forward, origin on the ground below its middle), metres; None for a
        pedestrian. It is at least `CLEARANCE` from the body, and nothing of the body is level with it or above it
        ahead.
    """
    if is_person(shape):
        return None
    if has_rider(shape):
        bike = Bike.of(shape)
        x, _, z = bike.steering
        return _rounded(x + 0.12 + CLEARANCE, z + bike.grips[2] + 0.05)
    shell = shell_of(shape)
    count = int(shell.length * (1.0 - shell.style.start) / _STEP)
    places = [shell.length / 2 - _STEP * k for k in range(count)]
    outline = [(x, shell.profile(x)[-1][1]) for x in places]  # along the middle of the roof, from the nose
    z = min(_HIGH * max(top for _, top in outline), _HIGHEST)
    return _rounded(next(x for x, top in outline if top >= z - CLEARANCE) + CLEARANCE, z)


def _rounded(x: float, z: float) -> tuple[float, float, float]:
    """A place in steps of five centimetres, ahead of and above the exact one."""
    return math.ceil(round(x / 0.05, 6)) / 20, 0.0, math.ceil(round(z / 0.05, 6)) / 20
