"""Rigid transforms: the conventions of plans, and exact results where possible."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir.plan import Pose
from recipe_runtime.core.transforms import compose, from_pose, invert, part_transforms

from tests.runtime.core.test_trace import make_trace

POSES = st.builds(
    Pose,
    **{k: st.floats(-100, 100) for k in ("x", "y", "z")},
    **{k: st.floats(-360, 360) for k in ("yaw", "pitch", "roll")},
)


@given(POSES, POSES)
def test_a_transform_times_its_inverse_is_the_identity(one: Pose, other: Pose) -> None:
    a, b = from_pose(one), from_pose(other)
    np.testing.assert_allclose(compose(invert(a), compose(a, b)), b, atol=1e-9)


@given(POSES)
def test_rotations_are_proper(pose: Pose) -> None:
    rotation = from_pose(pose)[:, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) > 0.99


def test_yaw_turns_left_and_positive_pitch_looks_down() -> None:
    forward = np.array([1.0, 0.0, 0.0])
    np.testing.assert_array_equal(from_pose(Pose(yaw=90))[:, :3] @ forward, [0, 1, 0])
    np.testing.assert_array_equal(from_pose(Pose(pitch=90))[:, :3] @ forward, [0, 0, -1])
    np.testing.assert_array_equal(from_pose(Pose(roll=90))[:, :3] @ np.array([0, 1, 0]), [0, 0, 1])


def test_parts_have_the_poses_of_the_trace() -> None:
    transforms = part_transforms(make_trace(), 2)
    assert transforms.shape == (3, 3, 4)
    np.testing.assert_array_equal(transforms[:, :, 3], make_trace().positions[2] / 2**20)
    np.testing.assert_array_equal(transforms[0, :, :3], np.eye(3))
