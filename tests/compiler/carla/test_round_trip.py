"""An import preserves what both languages express: poses, weather and clock."""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.carla.handedness import WALKER_ORIGIN, Pose
from recipe_compiler.carla.weather import COLLECTOR
from recipe_compiler.ir.plan import ScenarioPlan, SensorPlan
from recipe_compiler.ir.weather import PARAMETERS

from tests.compiler.carla.importing import compiled, import_text
from tests.compiler.carla.test_handedness import MIRROR, carla_rotation

percent = st.floats(0, 100).map(lambda value: round(value, 4))
numbers = st.floats(-40, 40).map(lambda value: round(value, 3))
angles = st.floats(-360, 360).map(lambda value: round(value, 3))
sizes = st.sampled_from([16, 64, 100, 800])
weathers = st.fixed_dictionaries(
    {},
    optional={
        name: st.floats(p.low, p.high).map(lambda value: round(value, 3))
        for name, p in PARAMETERS.items()
        if p.in_carla
    },
)
transforms = st.fixed_dictionaries(
    {"location": st.fixed_dictionaries({"x": numbers, "y": numbers, "z": st.floats(1, 30).map(lambda v: round(v, 3))})},
    optional={"rotation": st.fixed_dictionaries({}, optional={"roll": angles, "pitch": angles, "yaw": angles})},
)
jitters = st.fixed_dictionaries({}, optional={axis: st.floats(0, 2).map(lambda v: round(v, 3)) for axis in "xyz"})
cameras = st.fixed_dictionaries(
    {"width": sizes, "height": sizes, "fov": st.sampled_from([30, 60.5, 90, 120])},
    optional={"gamma": st.sampled_from([1.8, 2.2]), "iso": st.sampled_from([100, 400])},
)
rigs = st.fixed_dictionaries(
    {
        "pose": transforms,
        "camera": cameras,
        "carried": st.sampled_from([None, "walker", "vehicle"]),
        "modalities": st.lists(st.sampled_from(["rgb", "depth", "instance_segmentation"]), min_size=1, unique=True),
    },
    optional={
        "goal": st.fixed_dictionaries({"x": numbers, "y": numbers, "z": st.floats(1, 30).map(lambda v: round(v, 3))}),
        "speed": st.floats(0.01, 3).map(lambda v: round(v, 3)),
        "jitter": jitters,
    },
)


def place_of(rig: Any) -> str:
    """Return what distinguishes rigs: those at the same pose could become one sensor."""
    return json.dumps(rig["pose"]["location"])


configurations = st.fixed_dictionaries(
    {
        "fps": st.sampled_from([1, 5, 10, 24, 25, 30]),
        "frames": st.integers(1, 12),
        "seed": st.integers(0, 2**32 - 1),
        "weather": weathers,
        "rigs": st.lists(rigs, min_size=1, max_size=3, unique_by=place_of),
    }
)
OURS = {"rgb": "rgb", "depth": "depth", "instance_segmentation": "instance"}


def written(given: dict[str, Any]) -> str:
    """Return the configuration as JSON, which is a subset of YAML."""
    entry: dict[str, Any]
    spawned: list[dict[str, Any]] = [
        {"blueprint": {"name": f"{kind}.*", "attr": {"role_name": kind}}} for kind in ("walker", "vehicle")
    ]
    for number, rig in enumerate(given["rigs"]):
        for modality in rig["modalities"]:
            attributes: dict[str, Any] = {"fov": str(rig["camera"]["fov"]), "role_name": f"rig{number}"}
            attributes |= {"image_size_x": str(rig["camera"]["width"]), "image_size_y": rig["camera"]["height"]}
            if modality == "rgb":
                attributes |= {key: str(rig["camera"][key]) for key in ("gamma", "iso") if key in rig["camera"]}
            entry = {"blueprint": {"name": f"sensor.camera.{modality}", "attr": attributes}, "transform": rig["pose"]}
            if "speed" in rig:
                entry["blueprint"]["speed"] = rig["speed"]
            if "goal" in rig:
                entry["destination_transform"] = {"location": rig["goal"]}
            if "jitter" in rig:
                entry["sensor_motion"] = {"jitter_magnitude": rig["jitter"]}
            if rig["carried"]:
                entry["attach_to"] = rig["carried"]
            spawned.append(entry)
    document = {
        "carla": {"seed": given["seed"], "townmap": "Town15", "sync": {"fps": given["fps"]}},
        "max_frames": given["frames"],
        "weather": given["weather"],
        "spawn_actors": spawned,
    }
    return json.dumps(document, indent=1)


def position(rig: dict[str, Any], frame: int, fps: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the position of the collector's sensor, left-handed, without jitter: `speed` metres per frame."""
    start: np.ndarray[Any, np.dtype[np.float64]] = np.array([rig["pose"]["location"][axis] for axis in "xyz"])
    if "goal" not in rig:
        return start
    delta = np.array([rig["goal"][axis] for axis in "xyz"]) - start
    length = float(np.linalg.norm(delta))
    part = min(1.0, frame * float(rig.get("speed", 0.5)) / length) if length > 0 else 1.0
    at: np.ndarray[Any, np.dtype[np.float64]] = start + delta * part
    return at


def check_sensor(sensor: SensorPlan, rig: dict[str, Any], plan: ScenarioPlan, shift: tuple[float, float]) -> None:
    given, lift = Pose(**rig["pose"].get("rotation", {})), (WALKER_ORIGIN if rig["carried"] == "walker" else 0.0)
    moved = np.array([0.0, 0.0, lift]) if rig["carried"] else np.array([*shift, 0.0])
    bounds = np.array([rig.get("jitter", {}).get(axis, 0.0) for axis in "xyz"])
    assert sensor.on == rig["carried"]
    assert set(sensor.capture) == {OURS[each] for each in rig["modalities"]}
    assert (sensor.camera.width, sensor.camera.height) == (rig["camera"]["width"], rig["camera"]["height"])
    assert sensor.camera.fov == rig["camera"]["fov"]
    response = plan.appearance.responses[sensor.name]
    if "rgb" in rig["modalities"]:
        assert response.gamma == rig["camera"].get("gamma", 2.2)
        assert response.iso == rig["camera"].get("iso", 100)
    for frame in range(plan.scene.clock.frames):
        pose = sensor.poses[frame if len(sensor.poses) > 1 else 0]
        wanted = MIRROR @ position(rig, frame, plan.scene.clock.fps) + moved
        apart = np.abs(np.array([pose.x, pose.y, pose.z]) - wanted)
        assert np.all(apart <= bounds + 1e-5), (apart, bounds)
        rotation = np.array(Pose(yaw=pose.yaw, pitch=pose.pitch, roll=pose.roll).rows)
        assert np.allclose(rotation, MIRROR @ carla_rotation(given) @ MIRROR, atol=1e-5)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(configurations)
def test_values_that_both_languages_express_are_preserved(given: dict[str, Any]) -> None:
    one = import_text(written(given))
    with tempfile.TemporaryDirectory() as folder:
        (plan,) = compiled(one, Path(folder)).plan.variants
    assert (plan.scene.clock.fps, plan.scene.clock.frames) == (given["fps"], given["frames"])
    assert plan.appearance.seed == given["seed"]
    for name, default in COLLECTOR.items():
        wanted = given["weather"].get(name, default)
        if name == "sun_azimuth_angle":
            assert math.isclose((plan.appearance.sun.azimuth + wanted) % 360.0 % 359.9999999, 0.0, abs_tol=1e-6)
        elif name == "sun_altitude_angle":
            assert plan.appearance.sun.altitude == wanted
        else:
            assert math.isclose(getattr(plan.appearance.weather, name), wanted, abs_tol=1e-6)
    rest = {sensor.name: sensor for sensor in plan.rig.sensors}
    assert len(rest) == len(given["rigs"])
    for number, rig in enumerate(given["rigs"]):
        check_sensor(rest[f"rig{number}"], rig, plan, _shift(one.text))


def _shift(text: str) -> tuple[float, float]:
    """Return the shift that the comment at the top of a recipe states."""
    head = " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))
    if "everything is moved by" not in head:
        return 0.0, 0.0
    x, y = head.partition("moved by x ")[2].partition(", which")[0].split(", y ")
    return float(x), float(y)
