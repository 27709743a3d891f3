"""Lowers spring arms and followers to plans of arms. `recipe_compiler.ir.rig.arm` defines the poses at their ends."""

from __future__ import annotations

from recipe_compiler.ir import exact
from recipe_compiler.ir.ground.obstacles import BUILDINGS, FRONTED
from recipe_compiler.ir.plan import ArmPlan, Element, TownPlan
from recipe_compiler.ir.rig.plan import BoxPlan
from recipe_compiler.schema.camera import Mount, Sensor

_SOLID = BUILDINGS | {"wall"}  # what shortens an arm
LAG = 0.125  # time constant of a spring arm's yaw, seconds: CARLA's CameraRotationLagSpeed of 8 per second


def needs_town(sensor: Sensor) -> bool:
    """Whether the town is needed to lower a sensor: its buildings or its roads."""
    route, follow = sensor.motion.route, sensor.motion.follow
    return (
        sensor.mount.attachment == "spring_arm"
        or (route is not None and route.road)
        or (follow is not None and follow.collision)
    )


def mount_of(sensor: Sensor) -> Mount:
    """Return a sensor's mount, with the position of a follower: in its actor's level frame, at the end of the arm."""
    follow = sensor.motion.follow
    if follow is None:
        return sensor.mount
    sine, cosine = exact.sin_cos_deg(follow.bearing)
    place = {"x": follow.distance * cosine, "y": follow.distance * sine, "z": follow.height}
    return sensor.mount.model_copy(update=place)


def yaw_of(sensor: Sensor) -> float:
    """Return the direction in which a sensor looks at first, in degrees: in its actor's frame, or in the world."""
    mount = mount_of(sensor)
    if sensor.motion.follow is None and mount.attachment == "rigid":
        return mount.yaw
    return exact.atan2_deg(-mount.y, -mount.x) + mount.yaw


def is_shortened(sensor: Sensor) -> bool:
    """Whether buildings and walls shorten the arm of a sensor."""
    follow = sensor.motion.follow
    return follow.collision if follow is not None else sensor.mount.attachment == "spring_arm"


def arm_of(sensor: Sensor, fps: int, boxes: tuple[BoxPlan, ...]) -> ArmPlan | None:
    """Return the arm between a sensor and its actor; None if it is rigid, or in the world.

    Args:
        sensor: the sensor.
        fps: frames per second.
        boxes: what shortens arms, if `is_shortened`.
    """
    follow, attachment = sensor.motion.follow, sensor.mount.attachment
    if follow is not None:
        decay = 1.0 if follow.lag is None else _decay(follow.lag, fps)
    elif attachment != "rigid":
        decay = _decay(LAG, fps)
    else:
        return None
    return ArmPlan(decay=decay, obstacles=boxes if is_shortened(sensor) else ())


def _decay(lag: float, fps: int) -> float:
    """Return the factor of a heading's weight after one frame; below 1, which would keep the first heading."""
    rate = lag * fps
    return 0.0 if rate * 100.0 < 1.0 else min(exact.exp(-1.0 / rate), 0.9999)


def boxes(town: TownPlan) -> tuple[BoxPlan, ...]:
    """Return the buildings and walls of a town, which shorten arms."""
    return tuple(_box(element) for element in town.elements if element.kind in _SOLID)


def _box(element: Element) -> BoxPlan:
    sine, cosine = exact.sin_cos_deg(element.pose.yaw)
    back = element.size[0] / 2 if element.kind in FRONTED else 0.0  # the origin is the middle of its front
    return BoxPlan(
        x=element.pose.x - cosine * back,
        y=element.pose.y - sine * back,
        z=element.pose.z,
        yaw=element.pose.yaw,
        size=element.size,
    )
