"""CARLA's poses, by its rotation matrix and mirrored in y, equal the imported poses."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.carla.handedness import Pose, board_pose

angles = st.floats(-720, 720)
metres = st.floats(-1000, 1000)
poses = st.builds(Pose, metres, metres, metres, angles, angles, angles)
MIRROR = np.diag([1.0, -1.0, 1.0])


def carla_rotation(pose: Pose) -> NDArray[np.float64]:
    """Return the rotation of `carla.Transform.get_matrix`, with CARLA's left-handed numbers."""
    cy, sy = math.cos(math.radians(pose.yaw)), math.sin(math.radians(pose.yaw))
    cp, sp = math.cos(math.radians(pose.pitch)), math.sin(math.radians(pose.pitch))
    cr, sr = math.cos(math.radians(pose.roll)), math.sin(math.radians(pose.roll))
    return np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
            [sp, -cp * sr, cp * cr],
        ]
    )


def position(pose: Pose) -> NDArray[np.float64]:
    return np.array([pose.x, pose.y, pose.z])


@given(poses)
def test_a_pose_is_carlas_mirrored_in_y(pose: Pose) -> None:
    ours = pose.to_right_handed()
    assert np.allclose(MIRROR @ carla_rotation(pose) @ MIRROR, np.array(ours.rows), atol=1e-9)
    assert np.array_equal(MIRROR @ position(pose), position(ours))
    assert all(-180.0 < angle <= 180.0 for angle in (ours.yaw, ours.pitch, ours.roll))


@given(poses, poses)
def test_poses_compose_as_matrices_do(parent: Pose, child: Pose) -> None:
    composed = parent.to_right_handed().compose(child.to_right_handed())
    rotation = carla_rotation(parent) @ carla_rotation(child)
    place = position(parent) + carla_rotation(parent) @ position(child)
    assert np.allclose(np.array(composed.rows), MIRROR @ rotation @ MIRROR, atol=1e-6)
    assert np.allclose(position(composed), MIRROR @ place, atol=1e-6)


@given(poses, st.floats(0.1, 50))
def test_a_board_has_the_corners_of_oscars_patch(pose: Pose, height: float) -> None:
    width = 3.0
    found = board_pose(pose.to_right_handed(), height)
    rotation = np.array(found.rows)
    for right, down in ((-1, -1), (1, -1), (1, 1), (-1, 1)):  # OSCAR's order, from the upper left, clockwise
        theirs = position(pose) + carla_rotation(pose) @ np.array([right * width / 2, down * height / 2, 0.0])
        ours = position(found) + rotation @ np.array([0.0, right * width / 2, height / 2 - down * height / 2])
        assert np.allclose(MIRROR @ theirs, ours, atol=1e-6)
    face = MIRROR @ carla_rotation(pose) @ np.array([0.0, 0.0, 1.0])
    assert np.allclose(rotation @ np.array([1.0, 0.0, 0.0]), face, atol=1e-6)
