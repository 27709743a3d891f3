"""What a driver wants of its vehicle."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Command:
    """The wanted motion until the next decision. Engine, brakes, tyres and bends limit what comes of it."""

    acceleration: float  # m/s2 along the path
    offset: float = 0.0  # metres to the left of the route's line
