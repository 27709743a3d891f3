"""Lowers the sensors of a variant to its `RigPlan`."""

from __future__ import annotations

from recipe_compiler.expand import Variant
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.ir.plan import CameraPlan, RigPlan, SensorPlan
from recipe_compiler.ir.rig.plan import BoxPlan
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering.sensors import arms, poses
from recipe_compiler.schema.camera import Sensor
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.tick import interval_of


def lower(variant: Variant, base: Base, town: Town) -> tuple[RigPlan | None, list[Problem]]:
    """Return the plan of the sensors of a variant.

    Args:
        variant: the variant.
        base: its checked base.
        town: its town.

    Returns:
        The plan, or None if a sensor cannot be lowered, and the problems.
    """
    sensors, problems = [], []
    boxes = arms.boxes(town.plan) if any(map(arms.is_shortened, base.sensors.values())) else ()
    for name, sensor in base.sensors.items():
        try:
            sensors.append(_sensor(name, sensor, variant, base, town, boxes))
        except poses.NoRoadError:
            message = f"sensors.{name}.motion.route: the mount is not on a road that leads on"
            place = variant.base.place_of("sensors", name, "motion", "route")
            problems.append(Problem(message, place, "mount it on a lane, facing along it", Code.PLACEMENT))
    return (None if problems else RigPlan(sensors=tuple(sensors))), problems


def _sensor(
    name: str, sensor: Sensor, variant: Variant, base: Base, town: Town, boxes: tuple[BoxPlan, ...]
) -> SensorPlan:
    clock = base.clock
    return SensorPlan(
        name=name,
        on=sensor.carrier,
        camera=CameraPlan(**{field: getattr(sensor.camera, field) for field in CameraPlan.model_fields}),
        capture=tuple(m for m in MODALITIES if m in sensor.capture),
        poses=poses.poses(name, sensor, seed=variant.seed, fps=clock.fps, frames=clock.frames, town=town),
        arm=arms.arm_of(sensor, clock.fps, boxes),
        interval=interval_of(sensor.tick, clock.fps),
    )
