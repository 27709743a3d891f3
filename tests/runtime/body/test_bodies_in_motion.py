"""Moving bodies: wheels roll and steer with the motion, feet do not slide, riders sit, lean and pedal."""

from __future__ import annotations

from functools import cache
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Clock, Pose, ScenePlan
from recipe_compiler.library import blueprints, towns
from recipe_compiler.library.towns.streets import StreetGrid
from recipe_runtime.body import riding
from recipe_runtime.body.kinematics import IDENTITY, PartPose, Quaternion, axis_rotation, compose, inverse, rotate
from recipe_runtime.body.limbs import two_bone_ik
from recipe_runtime.body.poses import Components4
from recipe_runtime.body.skeleton import Bike
from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.core.transforms import invert, part_transforms
from recipe_runtime.frames.portrait import matrices
from recipe_runtime.meshes import actor_body
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.meshes.skin import split_parts
from recipe_runtime.simulation.terrain import Ground

from tests.runtime.actors import actor
from tests.runtime.simulation.in_process import simulate

TOWN = towns.build("downtown", 0, {"blocks": [2, 2]})
GROUND = Ground(TOWN.plan)
STREETS = cast(StreetGrid, TOWN.streets)
BIKES = [b for b in blueprints.LIBRARY if b.attributes.get("number_of_wheels") == "2"]


def turning(blueprint: str, way: str) -> ActorPlan:
    """Return a vehicle that comes from the south to the central junction and turns there."""
    found = blueprints.match(blueprint)[0]
    junction = (len(STREETS.xs) // 2, len(STREETS.ys) // 2)
    new = {"right": (1, 0), "left": (-1, 0)}[way]
    through = STREETS._through(junction, (0, 1), new)
    end = (through[-1][0] + 18.0 * new[0], through[-1][1] + 18.0 * new[1])
    start = Pose(x=through[0][0], y=through[0][1] - 12.0, yaw=90)
    return actor("it", found, start, *through, end, obeys=False)  # no waiting at a red light


@cache
def turn(blueprint: str, way: str) -> tuple[ActorPlan, Trace]:
    it = turning(blueprint, way)
    return it, simulate(ScenePlan(clock=Clock(fps=20, frames=320, physics=240), town=TOWN.plan, actors=(it,)))


def row(trace: Trace, part: str) -> int:
    return trace.parts.index(f"it/{part}")


def lowest(body: Body, poses: NDArray[np.float64]) -> float:
    return min(
        float((mesh.vertices.astype(np.float64) @ t[2, :3] + t[2, 3]).min())
        for (_, mesh), t in zip(split_parts(body.parts), poses, strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize("way", ["right", "left"])
@pytest.mark.parametrize("blueprint", ["vehicle.bus.city", "vehicle.truck.box", "vehicle.van.cargo"])
def test_long_vehicles_do_not_touch_the_kerb(blueprint: str, way: str) -> None:
    it, trace = turn(blueprint, way)
    reach = 0.15  # from a hub to the outer side of its tyre
    for frame in range(0, trace.frames, 2):
        for part in (p for p in trace.parts if "wheel" in p):
            pose = part_transforms(trace, frame)[trace.parts.index(part)]
            for side in (-1.0, 1.0):
                x, y = pose[:2, 3] + side * reach * pose[:2, 1]
                assert GROUND.height(x, y) == 0.0, f"{part} at frame {frame}"
    base = trace.positions[:, 0] / METRE
    assert np.abs(base[:, 2]).max() < 0.005
    goal = it.route[-1]
    assert np.hypot(base[-1, 0] - goal.x, base[-1, 1] - goal.y) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "blueprint", ["vehicle.sedan.a", "vehicle.bus.city", "vehicle.motorcycle.a", "vehicle.bicycle.a"]
)
def test_the_steer_angle_follows_from_the_curvature(blueprint: str) -> None:
    """Steer angle = atan(wheelbase * curvature), with the curvature taken from the Trace's own path."""
    actor, trace = turn(blueprint, "right")
    base, part = trace.base_part("it"), "fork" if "rider" in actor.shape else "wheel_front_left"
    half = 0.0 if "rider" in actor.shape else actor.shape["width"] / 2 - 0.13
    judged = 0
    for frame in range(20, 300, 4):
        speed, turning = trace.linear[frame, 0, :2] / METRE, trace.angular[frame, 0, 2] / METRE
        poses = part_transforms(trace, frame)
        forward = poses[base][:2, 0] / np.hypot(*poses[base][:2, 0])
        along = float(speed @ forward)
        if along < 1.0:
            continue
        curvature = turning / along
        axle = poses[row(trace, part)][:2, 1]  # rolling does not turn a wheel's y axis
        ahead = np.array([axle[1], -axle[0]]) / np.hypot(*axle)
        steer = np.degrees(np.arcsin(forward[0] * ahead[1] - forward[1] * ahead[0]))
        expected = np.degrees(np.arctan2(actor.shape["wheelbase"] * curvature, 1.0 - half * curvature))
        assert steer == pytest.approx(expected, abs=1.5)
        judged += abs(expected) > 10
    assert judged >= 3


@pytest.mark.slow
@pytest.mark.parametrize("blueprint", ["vehicle.hatchback.b", "vehicle.bicycle.child", "vehicle.motorcycle.b"])
def test_wheels_turn_at_speed_over_radius(blueprint: str) -> None:
    actor, trace = turn(blueprint, "left")
    base, wheel = trace.base_part("it"), row(trace, "wheel_rear" + ("" if "rider" in actor.shape else "_left"))
    for frame in range(10, 40, 3):
        angles = []
        for k in (frame, frame + 1):
            poses = part_transforms(trace, k)
            local = invert(poses[base])[:, :3] @ poses[wheel][:, :3]
            angles.append(np.degrees(np.arctan2(local[0, 2], local[2, 2])))
        step = np.hypot(*(trace.positions[frame + 1, 0, :2] - trace.positions[frame, 0, :2])) / METRE
        rolled = np.radians((angles[1] - angles[0]) % 360.0) * actor.shape["wheel"]
        assert rolled == pytest.approx(step % (2 * np.pi * actor.shape["wheel"]), rel=0.02, abs=0.003)


@pytest.mark.slow
@pytest.mark.parametrize("blueprint", BIKES, ids=lambda b: b.id)
def test_two_wheelers_stay_upright_and_on_the_ground(blueprint: blueprints.Blueprint) -> None:
    actor, trace = turn(blueprint.id, "right")
    body, leans = actor_body(actor), []
    for frame in range(0, trace.frames, 5):
        poses = part_transforms(trace, frame)
        assert abs(lowest(body, poses)) < 0.01
        leans.append(-np.degrees(np.arcsin(poses[0][2, 1])))
    assert -35.0 < min(leans) < -3.0  # to the right, into the bend
    rest = riding.resting_lean(Bike.of(blueprint.shape), 1.0)
    assert (
        max(leans) == leans[0] == pytest.approx(rest, abs=0.01)
    )  # slightly to the left, where a foot is on the ground


@pytest.mark.slow
def test_a_lean_balances_weight_and_centrifugal_force() -> None:
    _, trace = turn("vehicle.motorcycle.a", "left")
    judged = 0
    for frame in range(40, 300, 2):
        speed, turning = float(np.hypot(*trace.linear[frame, 0, :2])) / METRE, trace.angular[frame, 0, 2] / METRE
        lean = -np.degrees(np.arcsin(part_transforms(trace, frame)[0][2, 1]))
        force = np.degrees(np.arctan(speed * turning / 9.81))
        if abs(force) > 5.0:
            assert lean == pytest.approx(force, abs=6.0)  # leaning takes time
            judged += 1
    assert judged > 3


def ride(
    bike: Bike, *, steer: float = 0.0, distance: float = 0.0, foot_weight: float = 0.0, turn: Quaternion = IDENTITY
) -> dict[str, PartPose]:
    """Return the poses of all parts of a two-wheeler and its rider, its base at the origin; steering in degrees."""
    tangent = exact.sin_deg(steer) / exact.cos_deg(steer)
    poses = riding.Riders([bike]).pose([[(0.0, 0.0, 0.0, *turn, tangent, distance, foot_weight)]])
    return dict(zip(["chassis", *(joint.part for joint in bike.joints())], poses.of_first(), strict=True))


@pytest.mark.parametrize("blueprint", BIKES, ids=lambda b: b.id)
@pytest.mark.parametrize("gone", [0.0, 0.6, 1.3, 2.9])
def test_riders_hold_the_grips_and_the_pedals(blueprint: blueprints.Blueprint, gone: float) -> None:
    bike = Bike.of(blueprint.shape)
    steer = 8.0
    parts = ride(bike, steer=steer, distance=gone)
    pedals, _ = riding.Riders([bike]).pedal_positions(np.array([[360.0 * gone / 4.2]]))
    for row, (side, s) in enumerate((("left", 1.0), ("right", -1.0))):
        at, turn_ = parts[f"forearm_{side}"]
        palm = np.array(at) + rotate(turn_, (0.0, 0.0, -0.19 * bike.figure.height))
        x, y, z = bike.grips
        grip = np.array(bike.steering) + rotate(axis_rotation("z", steer), (x, s * y, z + 0.02))
        assert np.abs(palm - grip).max() < 0.025
        at, turn_ = parts[f"foot_{side}"]
        sole = np.array(at) + rotate(turn_, (0.085 * bike.figure.height, 0.0, -bike.figure.ankle))
        assert np.abs(sole - [axis[row, 0, 0] for axis in pedals]).max() < 0.03


@pytest.mark.parametrize("blueprint", BIKES, ids=lambda b: b.id)
def test_a_rider_who_stops_puts_a_foot_down(blueprint: blueprints.Blueprint) -> None:
    bike = Bike.of(blueprint.shape)
    lean = axis_rotation("x", -riding.resting_lean(bike, 1.0))
    poses = matrices(list(ride(bike, distance=0.4, foot_weight=1.0, turn=lean).values()))
    actor = turning(blueprint.id, "left")
    names = [name for name, _ in actor_body(actor).parts]
    foot = names.index("foot_left")
    mesh = split_parts(actor_body(actor).parts)[foot][1].vertices.astype(np.float64)
    assert abs((mesh @ poses[foot][2, :3] + poses[foot][2, 3]).min()) < 0.02
    assert abs(lowest(actor_body(actor), poses)) < 0.02


def test_limbs_reach_their_targets_and_keep_their_length() -> None:
    targets = np.array([(0.2, 0.1, -0.6), (-0.3, 0.2, -0.5), (0.5, -0.1, 0.3), (0.1, 0.6, 0.1), (0.0, -0.5, -0.4)])
    upper, lower = np.array([0.4, 0.45, 0.4, 0.5, 0.35]), np.array([0.4, 0.4, 0.42, 0.45, 0.5])
    pole = (np.array(1.0), np.array(0.2), np.array(0.1))
    tx, ty, tz = targets.T
    thighs, shins = two_bone_ik((tx, ty, tz), upper, lower, pole, knee=True)
    for k, target in enumerate(targets.tolist()):
        thigh, shin = _number(thighs, k), _number(shins, k)
        knee = rotate(thigh, (0.0, 0.0, -float(upper[k])))
        foot = np.add(knee, rotate(compose(thigh, shin), (0.0, 0.0, -float(lower[k]))))
        assert np.abs(foot - target).max() < 1e-12
        along = sum(a * b for a, b in zip(knee, target, strict=True)) / sum(a * a for a in target)
        bent = [a - along * b for a, b in zip(knee, target, strict=True)]
        assert bent[0] + 0.2 * bent[1] + 0.1 * bent[2] > 0.0  # towards the pole vector
        _, hinge, _, _ = compose(inverse(thigh), compose(thigh, shin))
        assert hinge > 0.0  # the lower bone folds backwards


def _number(rotations: Components4, number: int) -> Quaternion:
    x, y, z, w = (float(axis[number]) for axis in rotations)
    return x, y, z, w


def test_poses_of_riders_do_not_depend_on_the_batch() -> None:
    """The poses of many frames at once equal, bit for bit, those of one rider in one frame."""
    bikes = [bike for bike in map(Bike.of, (b.shape for b in BIKES)) if not bike.motor]
    moments = [
        [(*(1.0, 2.0, 0.1), *IDENTITY, 0.1 * t, 0.7 * t + n, 0.3 * n) for n in range(len(bikes))] for t in (0, 1, 2)
    ]
    together = riding.Riders(bikes).pose(moments)
    for n, bike in enumerate(bikes):
        for t, rows in enumerate(moments):
            alone = riding.Riders([bike]).pose([[rows[n]]])
            assert np.array_equal(alone.positions[:, :, 0, 0], together.positions[:, :, t, n])
            assert np.array_equal(alone.rotations[:, :, 0, 0], together.rotations[:, :, t, n])


@cache
def stroll() -> tuple[tuple[ActorPlan, ...], Trace]:
    """Return a scene in which an adult and two children start, walk along a sidewalk and stop."""
    actors = []
    for n, number in enumerate(("0009", "0013", "0012")):
        found, x = blueprints.match(f"walker.pedestrian.{number}")[0], -4.2 - 1.1 * n
        actors.append(actor(found.id, found, Pose(x=x, y=3.0, z=0.15, yaw=-90), (x, -3.0), instance=n + 1))
    clock = Clock(fps=30, frames=240, physics=240)
    return tuple(actors), simulate(ScenePlan(clock=clock, town=TOWN.plan, actors=tuple(actors)))


@pytest.mark.slow
@pytest.mark.parametrize("n", range(3))
def test_feet_touch_the_ground_and_do_not_slide(n: int) -> None:
    actors, trace = stroll()
    actor = actors[n]
    assert GROUND.height(actor.start.x, 0.0) == 0.15
    rows, body = trace.actor_parts(actor.name), actor_body(actor)
    poses = [part_transforms(trace, frame)[rows] for frame in range(trace.frames)]
    for pose in poses[::4]:
        assert abs(lowest(body, pose) - 0.15) < 0.005
    for side in ("left", "right"):
        foot = [pose[[name for name, _ in body.parts].index(f"foot_{side}")] for pose in poses]
        pace = np.hypot(*(trace.linear[:, n, :2] / METRE).T)  # strides vary in length while starting and stopping
        flat = [abs(t[2, 0]) < 0.01 and v > 0.98 * actor.speed for t, v in zip(foot, pace, strict=True)]
        slides = [
            float(np.hypot(*(after[:2, 3] - before[:2, 3])))
            for before, after, a, b in zip(foot, foot[1:], flat, flat[1:], strict=False)
            if a and b
        ]
        assert len(slides) > 10
        assert max(slides) < 0.003  # per frame; the body moves at least 33 mm
