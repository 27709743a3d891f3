"""Sensors on arms, on routes and with ticks: the content of their plans, and what changes it."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest
from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.library import towns
from recipe_compiler.lowering.traffic import built
from recipe_compiler.schema.tick import interval_of, nearest_ticks

from tests.compiler.kitchen import compiled, only, small

CAMERA = {"camera": {"width": 64, "height": 48}, "capture": ["rgb"]}
SENSORS: dict[str, dict[str, Any]] = {
    "arm": {"mount": {"on": "hero1", "x": -4, "z": 2, "attachment": "spring_arm"}, **CAMERA},
    "ghost": {"mount": {"on": "hero1", "x": -4, "z": 2, "attachment": "spring_arm_ghost"}, **CAMERA},
    "follower": {
        "mount": {"pitch": -3},
        "motion": {"follow": {"actor": "hero2", "distance": 5, "height": 2, "bearing": 90}},
        **CAMERA,
    },
    "turner": {
        "mount": {},
        "motion": {"follow": {"actor": "hero2", "distance": 5, "height": 2, "lag": 0.5, "collision": False}},
        **CAMERA,
    },
    "drone": {
        "mount": {"z": 20, "pitch": 40},
        "motion": {"route": {"points": [{"x": 10}, {"y": 10}], "speed": 3}, "jitter": {"z": 0.1}},
        "tick": 0.2,
        **CAMERA,
    },
}


def rig(**sensors: Any) -> dict[str, Any]:
    recipe = small()
    recipe["base"]["sensors"] |= copy.deepcopy(sensors)
    return recipe


def test_a_spring_arm_has_carlas_lag_and_is_shortened_by_buildings_and_walls() -> None:
    plan = only(rig(**SENSORS))
    arm, ghost = plan.rig.sensors[1:3]
    assert arm.on == ghost.on == "hero1" and arm.arm is not None and ghost.arm is not None
    assert arm.arm.decay == ghost.arm.decay == round(exact.exp(-0.8), 6)  # 1/8 s, at 10 frames per second
    solid = [e for e in plan.scene.town.elements if e.kind in ("building", "house", "tower", "wall")]
    assert len(arm.arm.obstacles) == len(solid) > 10 and ghost.arm.obstacles == ()
    building = next(e for e in solid if e.kind == "building")
    (box,) = (b for b in arm.arm.obstacles if math.dist(_front(b), (building.pose.x, building.pose.y)) < 1e-5)
    assert (box.size, box.yaw) == (building.size, building.pose.yaw)
    assert box.z == building.pose.z


def _front(box: Any) -> tuple[float, float]:
    sine, cosine = exact.sin_cos_deg(box.yaw)
    return box.x + cosine * box.size[0] / 2, box.y + sine * box.size[0] / 2


def test_a_follower_is_at_the_end_of_an_arm_with_or_without_lag() -> None:
    plan = only(rig(**SENSORS))
    follower, turner = plan.rig.sensors[3:5]
    assert follower.arm is not None and (follower.on, follower.arm.decay) == ("hero2", 1.0)
    (pose,) = follower.poses
    assert (pose.x, pose.y, pose.z, pose.pitch) == (0.0, 5.0, 2.0, -3.0)
    assert turner.arm is not None and turner.arm.decay == round(exact.exp(-0.2), 6)
    assert (turner.poses[0].x, turner.arm.obstacles) == (-5.0, ())


@pytest.mark.slow
def test_neither_weather_nor_another_sensor_changes_a_sensor() -> None:
    recipe = rig(**SENSORS) | {"deltas": {"weather": {"dry": {}, "wet": {"weather": "HardRainNoon"}}}}
    dry, wet = compiled(recipe).plan.variants
    assert dry.rig.digest == wet.rig.digest and dry.scene.digest == wet.scene.digest
    alone = {sensor.name: sensor for sensor in only(small()).rig.sensors}
    together = {sensor.name: sensor for sensor in dry.rig.sensors}
    assert together["street"] == alone["street"]
    for name, sensor in SENSORS.items():
        assert only(rig(**{name: sensor})).rig.sensors[1] == together[name]
    assert only(rig(**SENSORS)).scene.digest == only(small()).scene.digest


@pytest.mark.parametrize(
    ("tick", "fps", "interval"), [(0.0, 30, 1), (0.1, 30, 3), (0.033333, 30, 1), (0.066667, 30, 2), (2.0, 30, 60)]
)
def test_a_tick_is_a_number_of_frames(tick: float, fps: int, interval: int) -> None:
    assert (interval_of(tick, fps), nearest_ticks(tick, fps)) == (interval, [])


@pytest.mark.parametrize(
    ("tick", "fps", "near"), [(0.25, 30, [7 / 30, 8 / 30]), (0.01, 30, [1 / 30]), (0.0333, 30, [1 / 30])]
)
def test_the_error_for_an_invalid_tick_suggests_the_nearest(tick: float, fps: int, near: list[float]) -> None:
    assert nearest_ticks(tick, fps) == near
    assert all(nearest_ticks(round(value, 6), fps) == [] for value in near)


def test_a_slow_sensor_has_a_pose_for_every_frame_and_an_interval() -> None:
    drone = only(rig(**SENSORS)).rig.sensors[5]
    assert (drone.interval, len(drone.poses), list(drone.frames(4))) == (2, 4, [0, 2])


def test_a_tick_longer_than_the_clip_causes_a_warning() -> None:
    recipe = rig(drone={**SENSORS["drone"], "tick": 10})
    (warning,) = compiled(recipe).warnings
    assert warning.message == "sensors.drone.tick: the clip is over before a second picture"


@pytest.mark.parametrize("town", towns.NAMES)
def test_a_route_along_a_road_starts_on_one(town: str) -> None:
    recipe = small(town=town, traffic={}, actors={})
    motion = {"route": {"road": True, "speed": 9}}
    recipe["base"]["sensors"]["drone"] = {"mount": {"x": 9000, "z": 9, "yaw": 90}, "motion": motion, **CAMERA}
    with pytest.raises(InputError, match=r"sensors\.drone\.motion\.route: the mount is not on a road that leads on"):
        only(recipe)
    vehicle = next(point.pose for point in built(town, 0, "{}").spawn_points if point.category == "vehicle")
    recipe["base"]["sensors"]["drone"]["mount"] = {"x": vehicle.x, "y": vehicle.y, "z": 9, "yaw": vehicle.yaw}
    assert len(only(recipe).rig.sensors[1].poses) == 4


def test_a_value_that_plans_cannot_hold_is_a_mistake_of_the_recipe(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the recipe language allows beyond plans ends in an error with a place, not in an internal one."""
    monkeypatch.setattr("recipe_compiler.lowering.sensors.rig.interval_of", lambda tick, fps: 10**9)
    with pytest.raises(InputError) as caught:
        compiled(rig(drone=SENSORS["drone"]))
    (problem,) = caught.value.problems
    assert problem.message.startswith("the variant base exceeds a limit of plans: SensorPlan.interval: ")
    assert problem.place is not None and problem.help and problem.code is Code.INPUT_LIMIT
