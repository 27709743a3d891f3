"""Rig motion: the pose of a sensor at each frame."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.ir import exact
from recipe_compiler.lowering.sensors.poses import poses
from recipe_compiler.schema.camera import Sensor

JITTER = {
    "x": 0.02,
    "y": 0.05,
    "z": 0.01,
    "yaw": 0.4,
    "pitch": 0.1,
    "roll": 0.25,
}  # all different, so that mixed-up values are detected


def sensor(**motion: Any) -> Sensor:
    mount = {"x": -8.0, "z": 1.6, "yaw": 10.0}
    return Sensor.model_validate({"mount": mount, "capture": ["rgb"], "motion": motion})


def test_a_rig_without_motion_has_one_pose() -> None:
    assert len(poses("street", sensor(), seed=1, fps=30, frames=300)) == 1
    assert len(poses("street", sensor(jitter={}), seed=1, fps=30, frames=300)) == 1
    assert len(poses("street", sensor(jitter={"x": 0.0, "yaw": 0.0}), seed=1, fps=30, frames=300)) == 1
    assert len(poses("street", sensor(linear={"to": {}, "speed": 1.0}), seed=1, fps=30, frames=300)) == 1


def test_linear_motion_has_its_speed_at_any_frame_rate_and_stops_at_its_end() -> None:
    moving = sensor(linear={"to": {"x": -8.0, "y": 3.0, "z": 5.6}, "speed": 2.5})  # 5 m away
    at_10, at_30 = (poses("street", moving, seed=1, fps=fps, frames=4 * fps) for fps in (10, 30))
    assert [p.y for p in at_10[:3]] == [0.0, 0.15, 0.3]
    assert at_10 == at_30[::3]
    assert {(p.y, p.z) for p in at_10[20:]} == {(3.0, 5.6)}


def test_rotation_is_a_sine_between_its_limits() -> None:
    turning = poses("street", sensor(rotation={"yaw": [-15.0, 25.0], "period": 4.0}), seed=1, fps=10, frames=81)
    yaws = [p.yaw for p in turning]
    assert (yaws[0], yaws[10], yaws[20], yaws[30]) == (15.0, 35.0, 15.0, -5.0)  # the mount's 10 degrees are added
    assert yaws[:41] == yaws[40:]
    assert yaws[3] == round(15.0 + 20.0 * exact.sin_deg(27.0), 6)


@pytest.mark.slow
def test_jitter_does_not_accumulate_and_has_zero_mean() -> None:
    shaken = poses("street", sensor(jitter=JITTER), seed=1, fps=30, frames=2000)
    for axis, limit in JITTER.items():
        offsets = [getattr(p, axis) - getattr(sensor().mount, axis) for p in shaken]
        assert max(map(abs, offsets)) <= limit
        assert max(offsets) > 0.95 * limit and min(offsets) < -0.95 * limit
        assert abs(sum(offsets) / len(offsets)) < 4 * limit / 3**0.5 / 2000**0.5  # four standard errors
        half = [offsets[i] * offsets[i + 1] for i in range(1999)]
        assert abs(sum(half) / 1999) < 4 * limit**2 / 3 / 1999**0.5  # frames are independent


def test_more_frames_change_no_earlier_pose() -> None:
    whole = poses("street", sensor(jitter=JITTER), seed=1, fps=30, frames=90)
    assert poses("street", sensor(jitter=JITTER), seed=1, fps=30, frames=30) == whole[:30]


@pytest.mark.parametrize(("name", "seed"), [("street", 2), ("lane", 1)])
def test_jitter_is_keyed_by_seed_and_sensor(name: str, seed: int) -> None:
    one, two = (poses(n, sensor(jitter=JITTER), seed=s, fps=30, frames=9) for n, s in (("street", 1), (name, seed)))
    assert all(a.x != b.x and a.yaw != b.yaw for a, b in zip(one, two, strict=True))


def test_the_three_motions_add_up() -> None:
    linear, rotation = {"to": {"y": 9.0}, "speed": 1.0}, {"yaw": [-10.0, 10.0], "period": 2.0}
    parts = [
        poses("street", sensor(**motion), seed=1, fps=10, frames=20)
        for motion in (
            {"linear": linear},
            {"rotation": rotation},
            {"jitter": JITTER},
            {"linear": linear, "rotation": rotation, "jitter": JITTER},
        )
    ]
    for along, turned, shaken, all_three in zip(*parts, strict=True):
        assert all_three.y == pytest.approx(along.y + shaken.y, abs=2e-6)
        assert all_three.yaw == pytest.approx(turned.yaw + shaken.yaw - 10.0, abs=2e-6)
