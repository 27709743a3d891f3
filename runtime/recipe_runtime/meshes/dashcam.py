"""Mount positions of dashcams: ahead of the windscreen, because vehicle glass is opaque."""

from __future__ import annotations

import math
from collections.abc import Mapping

from recipe_runtime.body.skeleton import Bike, has_rider, is_person
from recipe_runtime.meshes.vehicle import shell_of

CLEARANCE = 0.15  # distance between the camera and the body, more than the default near plane; metres
_HIGH, _HIGHEST = 0.85, 1.9  # camera height as a fraction of the cabin's roof, and its upper limit in metres
_STEP = 0.01  # metres along the body


def dashcam_mount(shape: Mapping[str, float]) -> tuple[float, float, float] | None:
    """Return a mount for a dashcam that is level and faces ahead.

    Args:
        shape: A blueprint's shape.

    Returns:
        x, y, z in the vehicle's frame (x forward, origin on the ground below its middle), metres; None for a
        pedestrian. The mount is at least `CLEARANCE` from the body, and no part of the body ahead is as high as it.
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
    """Round a position to 0.05 m, forwards and upwards."""
    return math.ceil(round(x / 0.05, 6)) / 20, 0.0, math.ceil(round(z / 0.05, 6)) / 20
