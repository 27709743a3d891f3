"""Standing, walking and running: feet do not slide, on kerbs too, and limbs move like those of people."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.library import blueprints
from recipe_runtime.body import walk_cycle
from recipe_runtime.body.footsteps import Footsteps
from recipe_runtime.body.gait import Gait
from recipe_runtime.body.kinematics import forward_kinematics, rotate
from recipe_runtime.body.poses import SkeletonGroup
from recipe_runtime.body.skeleton import Figure
from recipe_runtime.meshes.mesh import Body

from tests.runtime.body.walking import (
    PEOPLE,
    TICK,
    Moment,
    above_ground,
    body_of,
    kerb,
    level,
    matrices,
    soles,
    vertices,
    walk,
)

ADULT, CHILD = PEOPLE[0], blueprints.match("walker.pedestrian.0013")[0]
SPEEDS: dict[str, Callable[[float], float]] = {
    "walk": lambda t: 1.4,
    "slow": lambda t: 0.5,
    "fast": lambda t: 2.1,
    "run": lambda t: 3.2,
    "start": lambda t: min(1.5, max(0.0, 1.5 * (t - 0.2))),
    "stop": lambda t: max(0.0, 1.4 - 1.8 * max(0.0, t - 0.5)),
    "stop running": lambda t: max(0.0, 3.0 - 2.5 * max(0.0, t - 0.5)),
    "accelerate": lambda t: 0.6 + 1.2 * t,
}


def slides(body: Body, moments: list[Moment]) -> float:
    """Return how far, at most, a point of a foot on the ground has moved since it touched the ground, in metres."""
    worst = 0.0
    for side in range(2):
        since: NDArray[np.float64] | None = None
        touched: NDArray[np.bool_] = np.zeros(0, bool)
        for moment in moments:
            points = soles(body, moment)[side]
            if since is None:
                since, touched = points.copy(), np.zeros(len(points), bool)
            now = (points[:, 2] < 0.001) & moment.feet.feet[side].planted
            kept = now & touched
            if kept.any():
                worst = max(worst, float(np.sqrt(((points - since)[kept, :2] ** 2).sum(1)).max()))
            since[now & ~touched] = points[now & ~touched]
            touched = now
    return worst


@pytest.mark.parametrize("blueprint", [ADULT, CHILD], ids=lambda b: b.id)
@pytest.mark.parametrize("name", SPEEDS)
def test_feet_on_the_ground_do_not_slide(name: str, blueprint: blueprints.Blueprint) -> None:
    """At any speed and while it changes: no sole below the ground, and only runners leave the ground."""
    body, moments = body_of(blueprint), walk(Figure.of(blueprint.shape), SPEEDS[name], 3.0)
    assert slides(body, moments) < 0.005
    lows = [min(float(points[:, 2].min()) for points in soles(body, moment)) for moment in moments]
    assert min(lows) > -0.001
    flying = [moment for moment, low in zip(moments, lows, strict=True) if low > 0.005]
    assert all(moment.feet.stride.running > 0.0 for moment in flying)
    assert any(moment.feet.stride.running > 0.9 for moment in moments) == bool(flying)


@pytest.mark.parametrize("name", SPEEDS)
def test_motion_has_no_jumps(name: str) -> None:
    """No part moves faster than 12 m/s relative to the body (a runner's swinging foot reaches 3 times its speed)."""
    parts = np.array([moment.parts[:, :, 3] for moment in walk(Figure.of(ADULT.shape), SPEEDS[name], 3.0)])
    steps = np.diff(parts - parts[:, :1] * [1.0, 1.0, 0.0], axis=0)
    assert np.sqrt((steps**2).sum(-1)).max() < 12.0 * TICK
    assert np.abs(np.diff(parts[:, 0, 2])).max() < 2.0 * TICK


def test_a_person_who_stops_stands_with_both_feet_together() -> None:
    body, moments = body_of(ADULT), walk(Figure.of(ADULT.shape), SPEEDS["stop"], 4.0)
    assert all(foot.planted for foot in moments[-1].feet.feet)
    left, right = (points[:, 0].mean() for points in soles(body, moments[-1]))
    assert abs(left - right) < 0.1
    assert np.array_equal(moments[-1].parts, moments[-15].parts)  # without further motion


def test_turning_on_the_spot_takes_steps() -> None:
    body = body_of(ADULT)
    moments = walk(Figure.of(ADULT.shape), lambda t: 0.0, 3.5, turning=lambda t: 1.2 if t < 2.0 else 0.0)
    assert slides(body, moments) < 0.005
    ahead = np.array([(foot.hx, foot.hy) for foot in moments[-1].feet.feet]).sum(0)
    turned = np.degrees(np.arctan2(ahead[1], ahead[0]))
    assert turned == pytest.approx(np.degrees(2.4), abs=20.0)
    assert len({foot.hx for moment in moments for foot in moment.feet.feet if foot.planted}) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.8, 1.4, 3.0])
@pytest.mark.parametrize("blueprint", [ADULT, CHILD], ids=lambda b: b.id)
@pytest.mark.parametrize("at", [1.0, 1.3])
def test_feet_step_over_kerbs(at: float, blueprint: blueprints.Blueprint, speed: float) -> None:
    """Up and down a kerb: soles do not enter it, a foot supports the body, and the body rises within a stride."""
    figure, body, ground = Figure.of(blueprint.shape), body_of(blueprint), kerb(at, at + 3.0)
    moments = walk(figure, lambda t: speed, 6.0 / speed, ground=ground)
    for moment in moments:
        for points, foot in zip(soles(body, moment), moment.feet.feet, strict=True):
            assert above_ground(points, ground).min() > -0.02
            if foot.planted and foot.z == foot.az:
                assert points[:, 2].min() == pytest.approx(foot.z, abs=0.003)
    base = np.array([moment.parts[0, 2, 3] for moment in moments])
    assert np.abs(np.diff(base)).max() < 2.5 * TICK
    x = np.array([moment.x for moment in moments])
    stride = Gait(figure).stride(speed).length
    assert (base[(x > at + stride) & (x < at + 3.0 - stride)] > 0.04).all()
    assert (base[(x < at - stride) | (x > at + 3.0 + stride)] < 0.01).all()


@pytest.mark.parametrize("blueprint", PEOPLE, ids=lambda b: b.id)
def test_stride_lengths_are_plausible(blueprint: blueprints.Blueprint) -> None:
    """They grow continuously with speed; walking has phases with both feet on the ground, running phases with none."""
    gait = Gait(Figure.of(blueprint.shape))
    speeds = np.arange(0.1, 5.0, 0.02)
    strides = [gait.stride(float(v)) for v in speeds]
    assert np.abs(np.diff([s.length for s in strides])).max() < 0.1
    cadence = speeds / [s.length for s in strides]
    assert (np.diff(cadence) > -1e-9).all()
    assert all(s.duty > 0.58 for v, s in zip(speeds, strides, strict=True) if v < 0.7 * gait.unit_speed)
    assert all(s.duty < 0.45 for v, s in zip(speeds, strides, strict=True) if v > 0.81 * gait.unit_speed)


def test_cadences_match_measurements() -> None:
    """Reference: steps per minute of adults at walking and running speeds."""
    gait = Gait(Figure.of(ADULT.shape))
    measured = {0.8: (80, 100), 1.4: (105, 120), 2.0: (128, 145), 3.0: (155, 175), 4.0: (160, 185)}
    for speed, (least, most) in measured.items():
        assert least < 120.0 * speed / gait.stride(speed).length < most
    assert gait.stride(2.2).running < 0.3 < 0.9 < gait.stride(2.45).running


def test_children_take_quicker_steps_and_run_at_lower_speeds() -> None:
    adult, child = (Gait(Figure.of(b.shape)) for b in (ADULT, CHILD))
    assert adult.stride(1.2).length > 1.25 * child.stride(1.2).length
    assert adult.stride(2.1).running == 0.0 < child.stride(2.1).running


def _posed(blueprint: blueprints.Blueprint, phase: float, speed: float) -> dict[str, NDArray[np.float64]]:
    figure = Figure.of(blueprint.shape)
    names = ["pelvis", *(joint.part for joint in figure.joints)]
    poses = walk_cycle.steady_pose(figure, phase, speed)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return {n: np.array([rotate(q, axis) for axis in axes]) for n, (_, q) in zip(names, poses, strict=True)}


def test_arms_swing_against_the_legs() -> None:
    axes = _posed(ADULT, 0.0, 1.4)  # the left foot touches down
    assert -axes["thigh_left"][2][0] > 0.2  # the left leg is in front, the left arm behind
    assert -axes["upper_arm_left"][2][0] < -0.2


@pytest.mark.parametrize("blueprint", [ADULT, CHILD], ids=lambda b: b.id)
def test_runners_bend_their_arms_and_lean_forward(blueprint: blueprints.Blueprint) -> None:
    for phase in (0.0, 0.3, 0.6):
        axes = _posed(blueprint, phase, 3.2)
        assert 60.0 < np.degrees(np.arccos(axes["upper_arm_left"][2] @ axes["forearm_left"][2])) < 115.0
        assert 5.0 < np.degrees(np.arcsin(axes["torso"][2][0])) < 15.0
        assert np.degrees(np.arcsin(_posed(blueprint, phase, 1.0)["torso"][2][0])) < 5.0


def test_heads_turn_within_the_limit_of_the_neck() -> None:
    yaw, found = 0.0, []
    for _ in range(60):
        yaw = walk_cycle.turn_head(yaw, 120.0, TICK)
        found.append(yaw)
    assert found[-1] == walk_cycle.HEAD_TURN
    assert max(np.diff(found)) < 200.0 * TICK
    figure = Figure.of(ADULT.shape)
    feet = Footsteps.steady(Gait(figure), 0.0, 0.0, (0.0, 0.0), (1.0, 0.0), level)
    poses = walk_cycle.Walkers([figure]).pose([walk_cycle.row(feet, (0.0, 0.0), (1.0, 0.0), 50.0)], level)
    head = [joint.part for joint in figure.joints].index("head") + 1
    x, y, z, w = poses.rotations[:, head, 0].tolist()
    assert np.degrees(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))) == pytest.approx(50.0, abs=1.0)


def test_poses_of_people_do_not_depend_on_the_batch() -> None:
    """The poses of a group equal, bit for bit, those of each person alone."""
    figures = [Figure.of(b.shape) for b in PEOPLE]
    place, heading = (3.0, -2.0), (0.6, 0.8)
    rows = [
        walk_cycle.row(Footsteps.steady(Gait(f), k / 7.0, 0.3 * k, place, heading, level), place, heading, 5.0 * k)
        for k, f in enumerate(figures)
    ]
    together = walk_cycle.Walkers(figures).pose(rows, level)
    for k, figure in enumerate(figures):
        alone = walk_cycle.Walkers([figure]).pose([rows[k]], level)
        assert np.array_equal(alone.positions[:, :, 0], together.positions[:, :, k])
        assert np.array_equal(alone.rotations[:, :, 0], together.rotations[:, :, k])


@pytest.mark.parametrize("heading", [(1.0, 0.0), (-1.0, 0.0), (-1.0, 1e-17), (0.0, -1.0), (-0.8, -0.6)])
def test_a_pose_does_not_depend_on_the_heading(heading: tuple[float, float]) -> None:
    """The pose is the same in the frame of the body."""
    figure, (hx, hy) = Figure.of(ADULT.shape), heading
    found = []
    for x, y in ((1.0, 0.0), (hx, hy)):
        feet = Footsteps.steady(Gait(figure), 0.4, 1.3, (0.0, 0.0), (x, y), level)
        parts = matrices(walk_cycle.Walkers([figure]).pose([walk_cycle.row(feet, (0.0, 0.0), (x, y))], level))
        turned = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
        found.append(np.einsum("ij,pjk->pik", turned, parts))
    assert np.abs(found[0] - found[1]).max() < 1e-7


def test_batched_forward_kinematics_equals_that_of_one_person() -> None:
    figures = [Figure.of(b.shape) for b in PEOPLE]
    generator = np.random.default_rng(0)
    count, joints = len(figures), len(figures[0].joints)
    rotations = generator.normal(size=(4, joints + 1, count))
    rotations /= np.sqrt((rotations**2).sum(0))
    base = generator.normal(size=(3, count))
    x, y, z = base
    a, b, c, w = rotations[:, 0]
    group = SkeletonGroup([figure.joints for figure in figures])
    together = group.forward_kinematics((x, y, z), (a, b, c, w), rotations[:, 1:])
    for k, figure in enumerate(figures):
        turns = [(a, b, c, w) for a, b, c, w in rotations[:, :, k].T.tolist()]
        px, py, pz = base[:, k].tolist()
        parts = forward_kinematics(((px, py, pz), turns[0]), figure.joints, turns[1:])
        assert [list(p) for p, _ in parts] == together.positions[:, :, k].T.tolist()
        assert [list(q) for _, q in parts] == together.rotations[:, :, k].T.tolist()


@pytest.mark.parametrize("blueprint", PEOPLE, ids=lambda b: b.id)
def test_limbs_are_connected_at_the_joints(blueprint: blueprints.Blueprint) -> None:
    """The foot and the shin have the same ankle position within the reach of the leg."""
    moments = walk(Figure.of(blueprint.shape), lambda t: blueprint.default_speed, 1.2)
    body = body_of(blueprint)
    for moment in moments[::2]:
        assert min(float(vertices(body, moment, f"foot_{s}")[:, 2].min()) for s in ("left", "right")) < 0.005 or (
            moment.feet.stride.running > 0.0
        )
