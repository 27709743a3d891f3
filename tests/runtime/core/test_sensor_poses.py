"""A sensor has the closed-form pose in every frame: in the world, on an actor, on an arm, behind an actor.

The oracle is numpy with libm: rotations as matrix products, smoothing as a sum of weights, a wall as a plane.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.plan import ArmPlan, CameraPlan, Pose, SensorPlan
from recipe_compiler.ir.rig.arm import CLEARANCE, PIVOT
from recipe_compiler.ir.rig.plan import BoxPlan
from recipe_runtime.core.trace import METRE, UNIT, Trace
from recipe_runtime.core.transforms import sensor_transform

Floats = NDArray[np.float64]
NEAR = 1e-9
RAISED = np.array([0.0, 0.0, PIVOT])
FRAMES = 20
quick = settings(max_examples=10, deadline=None)
angles = st.floats(-180, 180)
metres = st.floats(-20, 20)


def rotation(yaw: float, pitch: float, roll: float) -> Floats:
    (sy, sp, sr), (cy, cp, cr) = (f(np.radians([yaw, pitch, roll])) for f in (np.sin, np.cos))
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    turned: Floats = about_z @ about_y @ about_x
    return turned


def trace(seed: int, frames: int = FRAMES, turn: float = 8.0) -> Trace:
    """Return an actor that drives, turns by up to `turn` degrees per frame, and leans."""
    random = np.random.default_rng(seed)
    yaw = np.cumsum(random.uniform(-turn, turn, frames)) + random.uniform(-180, 180)
    lean = random.uniform(-4, 4, (2, frames))
    place = np.cumsum(random.uniform(-0.5, 0.5, (frames, 3)), axis=0)
    half = np.radians([yaw, lean[0], lean[1]]) / 2
    (sy, sp, sr), (cy, cp, cr) = np.sin(half), np.cos(half)
    quaternions = np.stack(
        [
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
            cy * cp * cr + sy * sp * sr,
        ],
        axis=1,
    )
    still = np.zeros((frames, 1, 3), np.int64)
    rotations = np.round(quaternions * UNIT).astype(np.int32)[:, None]
    return Trace(("car",), ("car/base",), np.round(place * METRE).astype(np.int64)[:, None], rotations, still, still)


def base(of: Trace, frame: int) -> tuple[Floats, Floats]:
    """Return the actor's origin [3] and rotation [3, 3]."""
    x, y, z, w = of.rotations[frame, 0] / np.linalg.norm(of.rotations[frame, 0].astype(float))
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return of.positions[frame, 0] / METRE, turned


def heading(of: Trace, frame: int, decay: float) -> float:
    """Return the smoothed yaw in degrees: the weighted sum of all headings so far."""
    ahead = np.array([base(of, k)[1][:2, 0] for k in range(frame + 1)])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    weights = (1.0 - decay) * decay ** np.arange(frame, -1, -1.0)
    weights[0] = decay**frame
    x, y = (weights[:, None] * ahead).sum(axis=0)
    return float(np.degrees(np.arctan2(y, x)))


def looking(at: Floats, place: Floats, pose: Pose) -> Floats:
    """Return the rotation of a sensor that looks at a point, with the angles of its pose added."""
    x, y, z = at - place
    yaw, pitch = np.degrees(np.arctan2(y, x)), np.degrees(np.arctan2(-z, np.hypot(x, y)))
    return rotation(float(yaw), float(pitch), 0.0) @ rotation(pose.yaw, pose.pitch, pose.roll)


def sensor(poses: tuple[Pose, ...], on: str | None = None, arm: ArmPlan | None = None) -> SensorPlan:
    return SensorPlan(
        name="eye", on=on, camera=CameraPlan(width=64, height=48, fov=90), capture=("rgb",), poses=poses, arm=arm
    )


def assert_at(made: Floats, place: Floats, turned: Floats) -> None:
    assert made.shape == (3, 4)
    assert np.abs(made - np.column_stack([turned, place])).max() < NEAR


poses = st.builds(Pose, x=metres, y=metres, z=metres, yaw=angles, pitch=angles, roll=angles)


@quick
@given(st.integers(0, 1000), st.lists(poses, min_size=FRAMES, max_size=FRAMES))
def test_in_the_world_and_rigid_on_an_actor(seed: int, stands: list[Pose]) -> None:
    motion = trace(seed)
    world, carried = sensor(tuple(stands)), sensor(tuple(stands), "car")
    for frame, pose in enumerate(stands):
        local = rotation(pose.yaw, pose.pitch, pose.roll)
        place = np.array([pose.x, pose.y, pose.z])
        assert_at(sensor_transform(world, motion, frame), place, local)
        origin, turned = base(motion, frame)
        assert_at(sensor_transform(carried, motion, frame), origin + turned @ place, turned @ local)


arms = st.builds(
    Pose, x=st.floats(1, 20), y=metres, z=st.floats(-1, 20), yaw=st.floats(-30, 30), pitch=st.floats(-30, 30)
)


@quick
@given(st.integers(0, 1000), arms, st.sampled_from([0.0, 0.3, 0.7659, 0.99, 1.0]))
def test_at_the_end_of_an_arm(seed: int, pose: Pose, decay: float) -> None:
    """The arm stays level, turns with the actor's smoothed heading, and its sensor looks at a point above the actor."""
    motion, plan = trace(seed), sensor((pose,), "car", ArmPlan(decay=decay))
    for frame in range(FRAMES):
        origin, _ = base(motion, frame)
        place = origin + rotation(heading(motion, frame, decay), 0, 0) @ np.array([pose.x, pose.y, pose.z])
        turned = looking(origin + RAISED, place, pose)
        assert_at(sensor_transform(plan, motion, frame), place, turned)


def test_truncating_the_smoothing_changes_nothing() -> None:
    """Headings older than 40 time constants are omitted, which changes no digit."""
    motion, pose = trace(3, 1200, turn=1.0), Pose(x=-6.0, z=2.5)
    plan = sensor((pose,), "car", ArmPlan(decay=0.9))
    place = base(motion, 1199)[0] + rotation(heading(motion, 1199, 0.9), 0, 0) @ np.array([-6.0, 0.0, 2.5])
    assert np.abs(sensor_transform(plan, motion, 1199)[:, 3] - place).max() < NEAR


def test_a_longer_clip_extends_a_shorter_one() -> None:
    motion, plan = trace(3), sensor((Pose(x=-6.0, z=2.5),), "car", ArmPlan(decay=0.8))
    still = motion.linear[:20]
    first = Trace(motion.actors, motion.parts, motion.positions[:20], motion.rotations[:20], still, still)
    for frame in range(20):
        assert np.array_equal(sensor_transform(plan, first, frame), sensor_transform(plan, motion, frame))


@quick
@given(st.integers(0, 1000), st.floats(-180, 180), st.floats(2, 20), st.floats(0.5, 30), st.floats(1, 6))
def test_an_arm_ends_in_front_of_a_wall(seed: int, yaw: float, length: float, distance: float, height: float) -> None:
    """The wall is large, and the arm hits its front or is too short to reach it."""
    motion = trace(seed, 1)
    origin, _ = base(motion, 0)
    normal = rotation(yaw, 0, 0)[:, 0]
    middle = origin + (distance + 5.0) * normal
    box = BoxPlan(x=middle[0], y=middle[1], z=-100.0, yaw=yaw, size=(10.0, 400.0, 300.0))
    pose = Pose(x=-length, z=height)
    plan = sensor((pose,), "car", ArmPlan(decay=0.0, obstacles=(box,)))
    pivot = origin + RAISED
    full = origin + rotation(heading(motion, 0, 0.0), 0, 0) @ np.array([pose.x, 0.0, pose.z]) - pivot
    approach = full @ normal
    front = (np.array([box.x, box.y, 0.0]) - pivot) @ normal - 5.0  # the plan is rounded
    free = front / approach * np.linalg.norm(full) - CLEARANCE if approach > front else np.linalg.norm(full)
    part = min(max(free, 0.0) / np.linalg.norm(full), 1.0) if approach > front else 1.0
    made = sensor_transform(plan, motion, 0)
    assert np.abs(made[:, 3] - (pivot + part * full)).max() < 1e-6
    assert_at(made, made[:, 3], looking(pivot, pivot + full, Pose()))  # shorter, and with the same view


@pytest.mark.parametrize(
    ("x", "z", "size"), [(-3.0, -20.0, (2.0, 2.0, 10.0)), (-20.0, 0.0, (4.0, 4.0, 50.0)), (0.0, 0.0, (1.0, 1.0, 9.0))]
)
def test_a_box_below_beyond_or_around_the_start_does_not_shorten_an_arm(
    x: float, z: float, size: tuple[float, float, float]
) -> None:
    still = np.zeros((1, 1, 3), np.int64)
    motion = Trace(("car",), ("car/base",), still, np.array([[[0, 0, 0, UNIT]]], np.int32), still, still)
    box = BoxPlan(x=x, y=0.0, z=z, yaw=20.0, size=size)
    plan = sensor((Pose(x=-6.0, z=2.5),), "car", ArmPlan(decay=0.0, obstacles=(box,)))
    assert sensor_transform(plan, motion, 0)[:, 3] == pytest.approx([-6.0, 0.0, 2.5], abs=1e-12)


def test_a_sensor_straight_above_its_actor_looks_down() -> None:
    still = np.zeros((1, 1, 3), np.int64)
    motion = Trace(("car",), ("car/base",), still, np.array([[[0, 0, 0, UNIT]]], np.int32), still, still)
    made = sensor_transform(sensor((Pose(z=30.0),), "car", ArmPlan(decay=0.0)), motion, 0)
    assert made.tolist() == [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 30]]
    assert math.isclose(float(np.linalg.det(made[:, :3])), 1.0)
