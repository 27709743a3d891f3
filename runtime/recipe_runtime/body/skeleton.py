"""The skeletons of pedestrians, vehicles and riders: the joints, their parents and their offsets.

Meshes and simulation share them. At rest all parts have the actor's orientation: x forward, y left, z up; limbs point
down.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from recipe_compiler.ir.plan import ActorPlan
from recipe_compiler.ir.plan_bounds import POSE, SITTING, TALKING
from recipe_compiler.ir.semantic_tags import BODIES

Offset = tuple[float, float, float]
SIDES = (("left", 1.0), ("right", -1.0))

PICKUP, BUS, TRUCK = BODIES.index("pickup"), BODIES.index("bus"), BODIES.index("truck")
MOTORCYCLE, BICYCLE, SCOOTER = (BODIES.index(name) for name in ("motorcycle", "bicycle", "scooter"))


@dataclass(frozen=True)
class Joint:
    """A part, and the offset of its origin from its parent's origin, in metres."""

    part: str
    parent: str
    offset: Offset


def _at(*offset: float) -> Offset:
    x, y, z = (round(v, 6) + 0.0 for v in offset)
    return x, y, z


@dataclass(frozen=True)
class Figure:
    """The proportions of a person, from the shape of its blueprint. Lengths are in metres."""

    height: float
    shoulder: float  # half the distance between the shoulder joints
    girth: float  # scale of the widths of the body
    head: float  # scale of the head
    limb: float  # scale of the legs, less than 1 for children
    stoop: float = 0.0  # degrees by which an old back is bent
    phone: float = 0.0  # 1 for a person who holds a telephone to the ear
    pose: float = 0.0  # TALKING, SITTING or 0

    @property
    def sits(self) -> bool:
        """Whether the person sits."""
        return self.pose == SITTING

    @property
    def talks(self) -> bool:
        """Whether the person stands and talks."""
        return self.pose == TALKING

    @classmethod
    def of(cls, shape: Mapping[str, float]) -> Figure:
        """Return the figure of a pedestrian, or of the rider of a two-wheeler.

        Args:
            shape: the blueprint's shape; `rider`, if present, is the rider's height.
        """
        height = shape.get("rider", shape["height"])
        wide = 0.1 * height * shape["shoulder"]
        posture = shape.get("stoop", 0.0), shape.get("phone", 0.0), shape.get(POSE, 0.0)
        return cls(height, wide, shape["girth"], shape["head"], shape["limb"], *posture)

    @cached_property
    def hip(self) -> float:
        """Height of the hip joints."""
        return self.ankle + self.thigh + self.shin

    @cached_property
    def ankle(self) -> float:
        """Height of the ankle joints above the sole."""
        return 0.045 * self.height

    @cached_property
    def thigh(self) -> float:
        """Length from hip to knee."""
        return 0.24 * self.height * self.limb

    @cached_property
    def shin(self) -> float:
        """Length from knee to ankle."""
        return 0.235 * self.height * self.limb

    @cached_property
    def upper_arm(self) -> float:
        """Length from shoulder to elbow."""
        return 0.172 * self.height

    @cached_property
    def chest(self) -> float:
        """Height of the joint between pelvis and torso."""
        return self.hip + 0.06 * self.height

    @cached_property
    def neck(self) -> float:
        """Height of the joint between torso and head."""
        return (0.978 - 0.142 * self.head) * self.height

    @cached_property
    def shoulders(self) -> float:
        """Height of the shoulder joints."""
        return self.neck - 0.038 * self.height

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """All joints, parents first. The base part is `pelvis`, whose origin is on the ground."""
        return (
            Joint("torso", "pelvis", _at(0, 0, self.chest)),
            Joint("head", "torso", _at(0.004 * self.height, 0, self.neck - self.chest)),
            *self._arms(),
            *self._legs(self.hip),
        )

    def seated(self, seat: Offset) -> tuple[Joint, ...]:
        """Return the joints of a rider.

        Args:
            seat: the point midway between the hips, in the frame of the chassis: the origin of `pelvis`.
        """
        return (
            Joint("pelvis", "chassis", _at(*seat)),
            Joint("torso", "pelvis", _at(0, 0, self.chest - self.hip)),
            Joint("head", "torso", _at(0.004 * self.height, 0, self.neck - self.chest)),
            *self._arms(),
            *self._legs(0.0),
        )

    def _arms(self) -> list[Joint]:
        found = []
        for side, s in SIDES:
            found += [
                Joint(f"upper_arm_{side}", "torso", _at(0, s * self.shoulder, self.shoulders - self.chest)),
                Joint(f"forearm_{side}", f"upper_arm_{side}", _at(0, 0, -self.upper_arm)),
            ]
        return found

    def _legs(self, hip: float) -> list[Joint]:
        found = []
        for side, s in SIDES:
            found += [
                Joint(f"thigh_{side}", "pelvis", _at(0, s * 0.05 * self.height, hip)),
                Joint(f"shin_{side}", f"thigh_{side}", _at(0, 0, -self.thigh)),
                Joint(f"foot_{side}", f"shin_{side}", _at(0, 0, -self.shin)),
            ]
        return found


def is_person(shape: Mapping[str, float]) -> bool:
    """Return whether a shape is that of a pedestrian."""
    return "body" not in shape


def has_rider(shape: Mapping[str, float]) -> bool:
    """Return whether a shape is that of a two-wheeler with a rider."""
    return "rider" in shape


def is_parked(actor: ActorPlan) -> bool:
    """Return whether a vehicle has no route, no speed and no rider."""
    return not actor.route and actor.speed == 0.0 and not has_rider(actor.shape)


@dataclass(frozen=True)
class Bike:
    """The dimensions of a two-wheeler, metres. The chassis frame has its origin on the ground between the wheels."""

    motor: bool
    wheel: float  # radius
    wheelbase: float
    figure: Figure

    @classmethod
    def of(cls, shape: Mapping[str, float]) -> Bike:
        """Return the dimensions of a shape with a rider."""
        return cls(int(shape["body"]) != BICYCLE, shape["wheel"], shape["wheelbase"], Figure.of(shape))

    @cached_property
    def tyre(self) -> float:
        """Half the width of a tyre."""
        return 0.055 if self.motor else 0.02

    @cached_property
    def hips(self) -> Offset:
        """Position of the rider's hips."""
        h = self.figure.height
        if self.motor:
            return _at(-0.19 * self.wheelbase + 0.7 * (1.78 - h), 0, self.wheel + 0.285 * h)
        return _at(-0.25 * self.wheelbase, 0, self.figure.hip + 0.05 * h + 0.02)

    @cached_property
    def crank(self) -> Offset:
        """Position of a bicycle's bottom bracket."""
        return _at(-0.10 * self.wheelbase, 0, 0.285)

    @cached_property
    def pedals(self) -> float:
        """Radius of a bicycle's cranks."""
        return 0.17 * self.figure.height / 1.75

    @cached_property
    def steering(self) -> Offset:
        """Position of the lower end of the steering axis, above and behind the front hub."""
        return _at(self.wheelbase / 2 - 0.09, 0, self.wheel + 0.32)

    @cached_property
    def grips(self) -> Offset:
        """Position of the left handlebar grip, relative to `steering`."""
        if self.motor:
            return _at(-0.22, 0.34, 0.40)
        return _at(-0.19, 0.28, 0.44)

    def joints(self) -> tuple[Joint, ...]:
        """Return the joints: fork, wheels, cranks (bicycles only) and the rider's."""
        half, (sx, _, sz) = self.wheelbase / 2, self.steering
        found = [
            Joint("fork", "chassis", self.steering),
            Joint("wheel_front", "fork", _at(half - sx, 0, self.wheel - sz)),
            Joint("wheel_rear", "chassis", _at(-half, 0, self.wheel)),
        ]
        if not self.motor:
            found.append(Joint("crank", "chassis", self.crank))
        return (*found, *self.figure.seated(self.hips))


def wheel_joints(shape: Mapping[str, float]) -> tuple[Joint, ...]:
    """Return the joints of a car's wheels, children of `chassis`: front left, front right, rear left, rear right."""
    track = shape["width"] / 2 - 0.13 - 0.03 * (shape["width"] > 2.1)
    found = []
    for end, x in (("front", 0.5), ("rear", -0.5)):
        axle = x * shape["wheelbase"] + axle_shift(shape)
        found += [Joint(f"wheel_{end}_{side}", "chassis", _at(axle, s * track, shape["wheel"])) for side, s in SIDES]
    return tuple(found)


def axle_shift(shape: Mapping[str, float]) -> float:
    """Return how far the middle of the wheelbase is ahead of the middle of the vehicle, in metres."""
    return {BUS: 0.45, TRUCK: 0.25, MOTORCYCLE: 0.0, BICYCLE: 0.0, SCOOTER: 0.0}.get(int(shape["body"]), 0.04)


def joints_of(shape: Mapping[str, float]) -> tuple[Joint, ...]:
    """Return all joints of an actor, parents first. The parent of the first joint is the base part."""
    if is_person(shape):
        return Figure.of(shape).joints
    return Bike.of(shape).joints() if has_rider(shape) else wheel_joints(shape)


def part_names(shape: Mapping[str, float]) -> tuple[str, ...]:
    """Return the names of an actor's parts in the order of the Trace, the base part first."""
    joints = joints_of(shape)
    return (joints[0].parent, *(joint.part for joint in joints))
