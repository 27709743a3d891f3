"""Warnings for valid but improbable values; mounts that the blueprints recommend cause none."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.ir.plan import CameraPlan, Pose, RigPlan, SensorPlan
from recipe_compiler.library.blueprints import LIBRARY, specimen
from recipe_compiler.lowering import plausibility
from recipe_compiler.schema.camera import Camera
from recipe_compiler.source.yaml_reader import Value
from recipe_runtime.meshes.dashcam import dashcam_mount

from tests.compiler.kitchen import compiled, small

CARRIED = [blueprint for blueprint in LIBRARY if dashcam_mount(blueprint.shape) is not None]


def warnings(**base: Any) -> list[Problem]:
    return list(compiled(small(**base)).warnings)


def camera(fov: float = 90.0, **mount: Any) -> dict[str, Any]:
    lens = {"width": 64, "height": 48, "fov": fov}
    return {"front": {"mount": mount, "camera": lens, "capture": ["rgb"]}}


def test_a_pedestrian_faster_than_any_runner_is_reported() -> None:
    actors: dict[str, dict[str, Any]] = {
        "hero": {
            "blueprint": "walker.pedestrian.*",
            "speed": 40,
            "start": {"x": -4, "y": 10},
            "goal": {"x": -4, "y": 0},
        }
    }
    (warning,) = warnings(actors=actors)
    assert warning.message == "actors.hero.speed: no pedestrian runs at 40 m/s"
    assert warning.help == "walking is 1 to 2 m/s, running is 3 to 10 m/s"
    actors["hero"] |= {"speed": 9.5}
    assert warnings(actors=actors) == []


def test_a_field_of_view_in_radians_is_reported() -> None:
    (warning,) = warnings(sensors=camera(fov=1.4, x=-8, z=1.6))
    assert warning.message == "sensors.front.camera.fov: 1.4 degrees is a very small field of view"
    assert warning.help == "write 80.2 if it is in radians"
    assert warnings(sensors=camera(fov=10, x=-8, z=1.6)) == []


def test_a_camera_inside_its_carrier_is_reported_with_a_remedy() -> None:
    actors: dict[str, dict[str, Any]] = {
        "car": {"blueprint": "vehicle.sedan.a", "start": {"x": 20, "y": -1.75, "yaw": 0}}
    }
    (warning,) = [w for w in warnings(actors=actors, sensors=camera(on="car", z=0.8)) if "sensors" in w.message]
    assert warning.message == "sensors.front: it is inside car, the actor that it is mounted on"
    assert warning.help == "`recipe blueprints vehicle.sedan.a` prints a mount that sees the road, as dashcam"


@pytest.mark.parametrize("blueprint", CARRIED, ids=lambda blueprint: blueprint.id)
def test_a_recommended_mount_is_outside_and_the_centre_is_inside_a_vehicle(blueprint: Any) -> None:
    carrier, _ = specimen(blueprint)
    mount = dashcam_mount(blueprint.shape)
    assert mount is not None
    base = Value({}, Place("f", 1, 1))
    for pose, inside in ((Pose(x=mount[0], y=mount[1], z=mount[2]), False), (Pose(z=1.0), True), (Pose(z=5.0), False)):
        sensor = SensorPlan(
            name="a",
            on=carrier.name,
            camera=CameraPlan(**{f: getattr(Camera(), f) for f in CameraPlan.model_fields}),
            capture=("rgb",),
            poses=(pose,),
        )
        found = list(plausibility.of_views(base, RigPlan(sensors=(sensor,)), [carrier], 10))
        assert [problem.message for problem in found] == [
            f"sensors.a: it is inside {carrier.name}, the actor that it is mounted on"
        ] * inside


def test_weather_as_a_fraction_of_one_is_reported_with_its_place() -> None:
    """The warning for each value states it in percent. Zero, presets, draws and other scales cause none."""
    recipe = small(weather={"preset": "ClearNoon", "precipitation": 0.6, "cloudiness": 0, "fog_falloff": 0.2})
    recipe["deltas"] = {"weather": {"foggy": {"weather": {"fog_density": 0.25}}, "rainy": {"weather": "HardRainNoon"}}}
    recipe["sweep"] = {
        "axes": ["weather"],
        "draw": {"count": 2, "values": {"weather.wetness": {"uniform": [0.1, 0.9]}}},
    }
    found = [problem for problem in compiled(recipe).warnings if problem.code == Code.IMPLAUSIBLE]
    assert [(problem.message, problem.help) for problem in found] == [
        ("weather.precipitation: 0.6 is very little: CARLA's scale is 0 to 100", "write 60 if it is a fraction of 1"),
        ("weather.fog_density: 0.25 is very little: CARLA's scale is 0 to 100", "write 25 if it is a fraction of 1"),
    ]
