"""The joints of pedestrians and vehicles: which part hangs on which, where, and how it turns.

Meshes and simulation share it. At rest all parts have the actor's orientation: x forward, y left, z up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Offset = tuple[float, float, float]


@dataclass(frozen=True)
class Joint:
    """A part that turns about an axis ("y": revolute, "z": revolute, "zy": steered and rolling) of its parent."""

    part: str
    parent: str
    offset: Offset  # of its origin from its parent's, metres
    axis: str


def _at(*offset: float) -> Offset:
    x, y, z = (round(v, 6) for v in offset)
    return x, y, z


@dataclass(frozen=True)
class Figure:
    """A pedestrian's measures in metres, from its blueprint's shape."""

    height: float
    shoulder: float  # half the distance between the shoulder joints
    girth: float
    head: float  # scale of the head

    @classmethod
    def of(cls, shape: Mapping[str, float]) -> Figure:
        """The figure of a shape."""
        height = shape["height"]
        return cls(height, 0.1 * height * shape["shoulder"], shape["girth"], shape["head"])

    @property
    def hip(self) -> float:
        """Height of the hip joints."""
        return 0.52 * self.height

    @property
    def ankle(self) -> float:
        """Height of the ankle joints above the sole."""
        return 0.045 * self.height

    @property
    def thigh(self) -> float:
        """From hip to knee."""
        return 0.24 * self.height

    @property
    def shin(self) -> float:
        """From knee to ankle."""
        return 0.235 * self.height

    @property
    def chest(self) -> float:
        """Height at which the torso turns on the pelvis."""
        return 0.58 * self.height

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints, parents first; the base part is `pelvis`, its origin on the ground."""
        h = self.height
        found = [
            Joint("torso", "pelvis", _at(0, 0, self.chest), "z"),
            Joint("head", "torso", _at(0.004 * h, 0, 0.835 * h - self.chest), "z"),
        ]
        for side, s in (("left", 1.0), ("right", -1.0)):
            found += [
                Joint(f"upper_arm_{side}", "torso", _at(0, s * self.shoulder, 0.797 * h - self.chest), "y"),
                Joint(f"forearm_{side}", f"upper_arm_{side}", _at(0, s * 0.008 * h, -0.172 * h), "y"),
            ]
        for side, s in (("left", 1.0), ("right", -1.0)):
            found += [
                Joint(f"thigh_{side}", "pelvis", _at(0, s * 0.05 * h, self.hip), "y"),
                Joint(f"shin_{side}", f"thigh_{side}", _at(0, 0, -self.thigh), "y"),
                Joint(f"foot_{side}", f"shin_{side}", _at(0, 0, -self.shin), "y"),
            ]
        return tuple(found)


def wheel_joints(shape: Mapping[str, float]) -> tuple[Joint, ...]:
    """A vehicle's wheels on its base part `chassis`: front left, front right, rear left, rear right."""
    track = shape["width"] / 2 - 0.13 - 0.03 * (shape["width"] > 2.1)
    found = []
    for end, x in (("front", 0.5), ("rear", -0.5)):
        axle = x * shape["wheelbase"] + axle_shift(shape)
        for side, s in (("left", 1.0), ("right", -1.0)):
            axis = "zy" if end == "front" else "y"
            found.append(Joint(f"wheel_{end}_{side}", "chassis", _at(axle, s * track, shape["wheel"]), axis))
    return tuple(found)


def axle_shift(shape: Mapping[str, float]) -> float:
    """How far the middle of the wheelbase lies before the middle of the vehicle."""
    return {5: 0.35, 6: 0.25}.get(int(shape["body"]), 0.04)
