"""Routes of sensors: constant speed, arcs at corners, and loops. The oracle is numpy with libm."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.plan import Pose
from recipe_compiler.lowering.sensors.path import Path
from recipe_compiler.lowering.sensors.poses import poses
from recipe_compiler.schema.camera import Sensor

from tests.compiler.kitchen import only, small

Floats = NDArray[np.float64]

coordinates = st.floats(-50, 50, allow_subnormal=False)
points = st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=2, max_size=6)
START = {"x": -8.0, "y": 2.0, "z": 1.6, "yaw": 10.0, "pitch": 5.0}


def sensor(route: dict[str, Any], **motion: Any) -> Sensor:
    return Sensor.model_validate({"mount": START, "capture": ["rgb"], "motion": {"route": route, **motion}})


def travelled(route: dict[str, Any], frames: int, fps: int = 10) -> tuple[Pose, ...]:
    return poses("drone", sensor(route), seed=1, fps=fps, frames=frames)


def polyline(corners: list[tuple[float, float, float]], distance: NDArray[Any]) -> Floats:
    """Return the points [N, 3] at the given distances, in metres, along a line through corners [C, 3]."""
    line = np.array(corners)
    ends = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.stack([np.interp(distance, ends, line[:, axis]) for axis in range(3)], axis=1)


@settings(max_examples=30, deadline=None)
@given(points, st.booleans())
def test_a_path_is_the_line_through_its_points(corners: list[tuple[float, float, float]], closed: bool) -> None:
    assume(np.linalg.norm(np.diff(np.array(corners), axis=0), axis=1).min() > 1e-3)
    assume(math.dist(corners[0], corners[-1]) > 1e-3)
    path = Path(corners, closed=closed)
    whole = [*corners, corners[0]] if closed else corners
    assert path.length == pytest.approx(np.linalg.norm(np.diff(np.array(whole), axis=0), axis=1).sum(), rel=1e-12)
    distance = np.linspace(0.0, 2.5 * path.length, 40)
    along = np.mod(distance, path.length) if closed else distance
    found = np.array([path.at(float(d))[:3] for d in distance])
    assert np.abs(found - polyline(whole, along)).max() < 1e-9 * max(1.0, path.length)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(points, st.floats(0.1, 20), st.booleans())
def test_rounded_corners_have_constant_speed_and_continuous_direction(
    corners: list[tuple[float, float, float]], radius: float, closed: bool
) -> None:
    steps = np.diff(np.array([*corners, corners[0]] if closed else corners), axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    assume(lengths.min() > 1.0)
    legs: NDArray[Any] = np.concatenate([steps, steps[:1]]) if closed else steps
    units: NDArray[Any] = legs / np.linalg.norm(legs, axis=1)[:, None]
    cosines = (units[:-1] * units[1:]).sum(axis=1)
    assume(len(cosines) == 0 or cosines.min() > -0.9)
    path = Path(corners, radius, closed=closed)
    step = 1e-3
    every = np.arange(0.0, path.length, step)
    samples = every[:: max(1, len(every) // 100)]
    here, there = (np.array([path.at(float(d + shift))[:3] for d in samples]) for shift in (0.0, step))
    moved = np.linalg.norm(there - here, axis=1)
    inside = samples + step < path.length
    assert np.abs(moved[inside] / step - 1.0).max() < 0.02  # never faster, and hardly shorter at the smallest arcs
    flat = np.hypot(*(there - here)[:, :2].T) > 0.2 * step
    yaws = np.degrees(np.arctan2(*(there - here)[:, 1::-1].T))
    reported = np.array([path.at(float(d + step / 2)).yaw for d in samples])
    off = np.abs((yaws - reported + 180.0) % 360.0 - 180.0)[flat & inside]
    assert off.size == 0 or np.percentile(off, 90) < 0.5


def test_an_arc_is_the_circle_that_touches_both_legs() -> None:
    path = Path([(0, 0, 0), (10, 0, 0), (10, 10, 0)], 2.0)
    assert path.length == pytest.approx(16 + math.pi, abs=1e-12)
    for distance in np.linspace(8.0, 8.0 + math.pi, 20):
        x, y, z, yaw = path.at(float(distance))
        assert math.hypot(x - 8.0, y - 2.0) == pytest.approx(2.0, abs=1e-12) and z == 0.0
        assert yaw == pytest.approx(math.degrees((distance - 8.0) / 2.0), abs=1e-9)
    assert path.at(18.0)[:3] == pytest.approx((10.0, 2.0 + 18.0 - 8.0 - math.pi, 0.0), abs=1e-12)


def test_a_rounded_loop_starts_in_the_middle_of_its_first_arc_and_ends_there() -> None:
    square = [(0.0, 0.0, 3.0), (10.0, 0.0, 3.0), (10.0, 10.0, 3.0), (0.0, 10.0, 3.0)]
    path = Path(square, 2.0, closed=True)
    assert path.length == pytest.approx(24 + 4 * math.pi, abs=1e-9)
    corner = 2.0 - math.sqrt(2.0)
    assert path.at(0.0) == pytest.approx((corner, corner, 3.0, -45.0), abs=1e-9)
    assert path.at(path.length * (1 - 1e-12))[:3] == pytest.approx((corner, corner, 3.0), abs=1e-6)


def test_a_reversal_has_no_arc_and_a_vertical_leg_keeps_the_heading() -> None:
    back = Path([(0, 0, 0), (5, 0, 0), (0, 0, 0)], 1.0)
    assert (back.length, back.at(4.0).yaw, back.at(6.0).yaw) == (10.0, 0.0, 180.0)
    lift = Path([(0, 0, 0), (0, 3, 0), (0, 3, 9)])
    assert lift.at(8.0) == (0.0, 3.0, 5.0, 90.0)


def test_a_route_starts_at_the_mount_has_its_speed_and_stops_at_its_end() -> None:
    route = {"points": [{"x": 2.0}, {"y": 7.0, "z": 6.6}], "speed": 4.0, "heading": "fixed"}
    stood = travelled(route, 61)
    corners = [(-8.0, 2.0, 1.6), (2.0, 2.0, 1.6), (2.0, 7.0, 6.6)]
    wanted = polyline(corners, 0.4 * np.arange(61))
    assert np.abs(np.array([(p.x, p.y, p.z) for p in stood]) - wanted).max() < 1e-6  # plans have six decimals
    assert {(p.yaw, p.pitch) for p in stood} == {(10.0, 5.0)}
    assert stood[::2] == travelled(route, 31, fps=5)[:31]


def test_a_route_without_speed_takes_the_whole_clip() -> None:
    once = travelled({"points": [{"x": 2.0}]}, 11)
    assert [p.x for p in once] == pytest.approx(np.linspace(-8.0, 2.0, 11), abs=1e-6)
    ring = {"points": [{"x": 2.0}, {"y": 12.0}, {"x": -8.0}], "loop": True}
    rounds = travelled(ring, 40)
    assert (rounds[0].x, rounds[10].x, rounds[20].y) == (-8.0, 2.0, 12.0)
    assert rounds[39].y == pytest.approx(3.0)  # frame 40 would equal the first


def test_a_sensor_looks_along_its_route_plus_the_angle_of_its_mount() -> None:
    seen = travelled({"points": [{"x": 2.0}, {"y": 12.0}, {"x": -8.0}], "speed": 10.0}, 31)
    assert [seen[k].yaw for k in (5, 15, 25)] == [10.0, 100.0, 190.0]


def test_a_route_along_the_road_stays_on_its_lanes_and_a_longer_clip_extends_it() -> None:
    drone = {
        "mount": {"x": 1.5, "y": -20, "z": 12, "yaw": 90, "pitch": 30},
        "capture": ["rgb"],
        "motion": {"route": {"road": True, "speed": 8}},
    }
    recipe = small(clock={"fps": 10, "frames": 200})
    recipe["base"]["sensors"]["drone"] = drone
    plan = only(recipe)
    flown = plan.rig.sensors[1].poses
    steps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in itertools.pairwise(flown)]
    assert max(steps) == pytest.approx(0.8, abs=1e-5) and min(steps) > 0.7  # chords of the arcs at junctions
    assert {p.z for p in flown} == {12.0}
    roads = [e for e in plan.scene.town.elements if e.kind in ("road", "junction")]
    assert all(any(_on(e, p) for e in roads) for p in flown)
    longer = small(clock={"fps": 10, "frames": 300})
    longer["base"]["sensors"]["drone"] = drone
    assert only(longer).rig.sensors[1].poses[:200] == flown


def _on(element: Any, pose: Pose) -> bool:
    turn = math.radians(element.pose.yaw)
    dx, dy = pose.x - element.pose.x, pose.y - element.pose.y
    along, aside = math.cos(turn) * dx + math.sin(turn) * dy, math.cos(turn) * dy - math.sin(turn) * dx
    return bool(abs(along) <= element.size[0] / 2 + 1e-3 and abs(aside) <= element.size[1] / 2 + 1e-3)
