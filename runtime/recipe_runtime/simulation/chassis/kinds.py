"""Masses and limits of the kinds of vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from recipe_compiler.ir.semantic_tags import BODIES

GRIP = 0.8 * 9.81  # m/s2, of tyres in any direction


@dataclass(frozen=True)
class VehicleKind:
    """What a kind of vehicle weighs, with its driver, and can do."""

    mass: float  # kg
    drive: float  # m/s2, the most that its engine can give
    brake: float  # m/s2, in an emergency


_KINDS = {
    "sedan": VehicleKind(1400.0, 3.5, 7.8),
    "hatchback": VehicleKind(1200.0, 3.5, 7.8),
    "suv": VehicleKind(2000.0, 3.5, 7.8),
    "van": VehicleKind(2400.0, 3.0, 7.5),
    "pickup": VehicleKind(2000.0, 3.5, 7.5),
    "bus": VehicleKind(12000.0, 1.8, 6.5),
    "truck": VehicleKind(9000.0, 1.8, 6.5),
    "motorcycle": VehicleKind(280.0, 3.5, 7.8),
    "scooter": VehicleKind(190.0, 2.5, 7.0),
    "bicycle": VehicleKind(90.0, 1.5, 5.0),
}


def vehicle_kind(shape: Mapping[str, float]) -> VehicleKind:
    """Return the kind of a vehicle's shape."""
    return _KINDS[BODIES[int(shape["body"])]]


def yaw_inertia(mass: float, length: float, width: float) -> float:
    """Return the moment of inertia of a box about the vertical, kg m2."""
    return mass * (length * length + width * width) / 12.0
