"""Simulation: bits do not depend on the environment, and people walk, pass each other and arrive."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.plan import ActorPlan, Clock, Point, Pose, ScenePlan
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints, towns
from recipe_runtime.core.trace import METRE, UNIT, Trace, TraceWriter
from recipe_runtime.core.transforms import part_transforms
from recipe_runtime.simulation import process
from recipe_runtime.simulation.recording import snap

from tests.runtime import actors
from tests.runtime.simulation.in_process import simulate

TOWN = towns.build("downtown", 0, {"blocks": [1, 1]})


def actor(name: str, glob: str, x: float, y: float, yaw: float, goal: tuple[float, float], speed: float) -> ActorPlan:
    return actors.actor(name, glob, Pose(x=x, y=y, z=TOWN.ground(x, y), yaw=yaw), goal, speed=speed)


HERO1 = actor("hero1", "walker.pedestrian.0001", -4, 5, -90, (-4, -5), 1.4)
HERO2 = actor("hero2", "walker.pedestrian.0002", -4, -5, 90, (-4, 5), 2.0)
CAR = actor("car", "vehicle.sedan.a", 1.5, -24, 90, (1.5, 20), 8.0)
FAR = actor("far", "walker.pedestrian.0003", 66, 10, -90, (66, -10), 1.4)


def scene(*cast: ActorPlan, frames: int) -> ScenePlan:
    return ScenePlan(clock=Clock(fps=30, frames=frames, physics=240), town=TOWN.plan, actors=cast)


@cache
def meeting() -> Trace:
    return simulate(scene(HERO1, HERO2, CAR, frames=460))


def base(trace: Trace, name: str) -> NDArray[np.float64]:
    return trace.positions[:, trace.base_part(name)] / METRE


@pytest.mark.slow
@pytest.mark.parametrize("tunables", [None, "glibc.malloc.check=0", process.PINNED["GLIBC_TUNABLES"]])
def test_bits_do_not_depend_on_the_parents_environment(tunables: str | None) -> None:
    code = (
        "import sys; from recipe_compiler.ir.plan import ScenePlan;"
        "from recipe_runtime.simulation.process import simulate;"
        "print(simulate(ScenePlan.model_validate_json(sys.stdin.read())).digest)"
    )
    environment = {k: v for k, v in os.environ.items() if k != "GLIBC_TUNABLES"}
    if tunables is not None:
        environment["GLIBC_TUNABLES"] = tunables
    environment["PYTHONHASHSEED"] = "77"
    done = subprocess.run(
        [sys.executable, "-c", code],
        input=scene(HERO1, HERO2, CAR, frames=12).model_dump_json(),
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    assert done.stdout == _twelve().digest + "\n"  # and the line that PyBullet prints on import is suppressed
    assert done.stderr == ""


@cache
def _twelve() -> Trace:
    return process.simulate(scene(HERO1, HERO2, CAR, frames=12))


@pytest.mark.slow
def test_a_distant_actor_changes_no_bit_of_the_others() -> None:
    alone = simulate(scene(HERO1, CAR, frames=40)).prefix_digests([40])
    more = simulate(scene(FAR, HERO1, CAR, frames=40)).prefix_digests([40])
    assert alone.keys() == {"hero1", "car"}
    assert {name: more[name] for name in alone} == alone


@pytest.mark.slow
@given(frames=st.integers(1, 20))
@settings(max_examples=4, deadline=None)
def test_a_shorter_clip_is_a_prefix(frames: int) -> None:
    """`recipe shot` relies on this: it simulates only up to its frame."""
    whole = scene(HERO1, HERO2, CAR, frames=20)
    short, long = simulate(whole.first(frames)), _twenty()
    assert short.prefix_digests([frames]) == long.prefix_digests([frames])


@cache
def _twenty() -> Trace:
    return simulate(scene(HERO1, HERO2, CAR, frames=20))


@pytest.mark.slow
def test_frame_0_is_the_start() -> None:
    for plan in (HERO1, CAR):
        x, y, _ = base(meeting(), plan.name)[0]
        aside = 0.022 * plan.shape["height"] if plan.category == "pedestrian" else 0.0  # the hips, over one leg
        assert np.hypot(x - plan.start.x, y - plan.start.y) <= aside
    assert not meeting().linear[0].any()


@pytest.mark.parametrize("plan", [HERO1, HERO2])
def test_pedestrians_reach_their_speed(plan: ActorPlan) -> None:
    velocity = meeting().linear[45, meeting().actors.index(plan.name)] / METRE
    assert np.hypot(velocity[0], velocity[1]) == pytest.approx(plan.speed, abs=0.06)


@pytest.mark.slow
def test_a_vehicle_reaches_its_speed_on_a_long_road() -> None:
    """The speed is 8 m/s at any frame rate."""
    town = towns.build("highway", 0, {}).plan
    car = actor("car", "vehicle.sedan.a", -100, -5.4, 0, (150, -5.4), 8.0)
    for fps in (5, 24, 30):
        trace = simulate(ScenePlan(clock=Clock(fps=fps, frames=12 * fps, physics=240), town=town, actors=(car,)))
        speeds = trace.linear[10 * fps :, 0, 0] / METRE
        assert speeds == pytest.approx(np.full(len(speeds), 8.0), abs=0.1)
        moved = np.diff(base(trace, "car")[10 * fps :, 0]) * fps
        assert moved == pytest.approx(speeds[1:], abs=0.05)


@pytest.mark.parametrize(("plan", "tolerance"), [(HERO1, 0.05), (HERO2, 0.05), (CAR, 0.7)])
def test_actors_reach_their_goal_and_stop(plan: ActorPlan, tolerance: float) -> None:
    goal = plan.route[-1]
    x, y, _ = base(meeting(), plan.name)[-1]
    assert np.hypot(x - goal.x, y - goal.y) < tolerance
    assert np.abs(meeting().linear[-1, meeting().actors.index(plan.name), :2]).max() / METRE < 0.05


def test_pedestrians_on_one_line_pass_each_other() -> None:
    apart = base(meeting(), "hero1")[:, :2] - base(meeting(), "hero2")[:, :2]
    assert np.hypot(apart[:, 0], apart[:, 1]).min() > 0.5
    assert apart[0, 1] > 0 > apart[-1, 1]


def test_feet_stay_on_the_sidewalk_and_people_upright() -> None:
    trace = meeting()
    for name, height in (("hero1", 1.78), ("hero2", 1.66)):
        feet = [trace.parts.index(f"{name}/foot_{side}") for side in ("left", "right")]
        ankles = trace.positions[:, feet, 2].min(axis=1) / METRE - 0.15 - 0.045 * height
        assert ankles.min() > -0.005
        assert ankles.max() < 0.05  # while one heel lands, the other is raised
    for frame in range(0, trace.frames, 30):
        ups = part_transforms(trace, frame)[[trace.base_part("hero1"), trace.base_part("hero2")], 2, 2]
        assert ups.min() > 0.999


def test_a_planted_foot_does_not_slide() -> None:
    trace = meeting()
    foot = trace.positions[40:80, trace.parts.index("hero1/foot_left")] / METRE
    flat = foot[1:, 2] < 0.15 + 0.045 * 1.78 + 0.002
    moved = np.abs(np.diff(foot[:, 1]))
    both = flat & (np.abs(np.diff(foot[:, 2])) < 1e-3)
    assert both.sum() >= 4
    assert moved[both].max() < 0.012  # the body moves 0.047 m per frame


def test_wheels_roll_without_slipping_and_stand_on_the_road() -> None:
    trace = meeting()
    assert np.abs(base(trace, "car")[:, 2]).max() < 0.005
    hubs = trace.positions[:, trace.parts.index("car/wheel_rear_left"), 2] / METRE
    assert np.abs(hubs - CAR.shape["wheel"]).max() < 0.005


@pytest.mark.slow
def test_a_vehicle_stops_behind_another() -> None:
    parked = actor("parked", "vehicle.van.a", 1.5, 4, 90, (1.5, 4), 0.0)
    trace = simulate(scene(CAR, parked, frames=300))
    gap = base(trace, "parked")[:, 1] - base(trace, "car")[:, 1]
    reach = (CAR.shape["length"] + parked.shape["length"]) / 2
    assert reach + 0.5 < gap.min() < reach + 15  # with room to pass it
    assert np.abs(trace.linear[:, 0]).max(axis=1)[200:].min() / METRE < 0.05


@pytest.mark.slow
def test_vehicles_follow_drawn_routes_along_their_lanes() -> None:
    point = next(p for p in TOWN.spawn_points if p.category == "vehicle")
    blueprint = blueprints.match("vehicle.hatchback.a")[0]
    route = TOWN.route("vehicle", point.pose, 90.0, Stream(0, "route"))
    car = CAR.model_copy(update={"start": point.pose, "route": route, "shape": blueprint.shape})
    track = base(simulate(scene(car, frames=450)), "car")
    corners = np.array([(point.pose.x, point.pose.y), *((p.x, p.y) for p in route)])
    for x, y, _ in track[::10]:
        a, d = corners[:-1], np.diff(corners, axis=0)
        t = np.clip((((x, y) - a) * d).sum(1) / (d * d).sum(1), 0, 1)
        assert np.hypot(*(a + t[:, None] * d - (x, y)).T).min() < 0.75


def test_rotations_are_unit_quaternions_with_a_fixed_sign() -> None:
    q = meeting().rotations.astype(np.float64) / UNIT
    assert np.abs((q * q).sum(-1) - 1).max() < 1e-6
    assert (meeting().rotations[..., 3] >= 0).all()


@pytest.mark.slow
def test_progress_is_reported() -> None:
    heard: list[tuple[int, int]] = []
    process.simulate(scene(HERO1, frames=3), lambda done, steps: heard.append((done, steps)))
    assert heard == [(0, 16), (8, 16), (16, 16)]


@pytest.mark.slow
def test_an_error_of_the_simulation_is_reported() -> None:
    shapeless = HERO1.model_copy(update={"shape": {}})
    with pytest.raises(RunError, match=r"^the simulation ended with exit code 1: KeyError: 'height'$"):
        process.simulate(scene(shapeless, frames=2))


@pytest.mark.slow
def test_the_error_names_a_full_temporary_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(writer: TraceWriter, frame: int, data: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(TraceWriter, "write", full)
    with pytest.raises(RunError, match=r"cannot write .* temporary folder .*: No space left on device; .* TMPDIR"):
        process.simulate(scene(frames=2))


@pytest.mark.slow
def test_vehicles_take_turns_at_a_junction() -> None:
    """Two vehicles with crossing paths in a junction never touch, and both pass."""
    north = actor("north", "vehicle.sedan.a", 1.5, 8, 90, (1.5, 66), 8.0)
    west = actor("west", "vehicle.suv.a", 28, 37.5, 180, (-28, 37.5), 8.0)
    two = ScenePlan(
        clock=Clock(fps=10, frames=241, physics=240),
        town=towns.build("downtown", 0, {"blocks": [2, 2]}).plan,
        actors=(north, west),
    )
    trace = simulate(two)
    apart = base(trace, "north")[:, :2] - base(trace, "west")[:, :2]
    assert np.hypot(apart[:, 0], apart[:, 1]).min() > 3.5
    assert base(trace, "north")[-1, 1] > 50
    assert base(trace, "west")[-1, 0] < -15


@pytest.mark.slow
def test_a_pedestrian_waits_for_a_car() -> None:
    walker = actor("walker", "walker.pedestrian.0001", -4, 0, 0, (6, 0), 1.4)
    car = actor("car", "vehicle.sedan.a", -1.5, 22, -90, (-1.5, -30), 8.0)
    trace = simulate(scene(walker, car, frames=330))
    near = np.abs(base(trace, "walker") - base(trace, "car"))[:, :2]
    assert ((near[:, 0] > 1.0) | (near[:, 1] > 2.4)).all()
    assert base(trace, "walker")[-1, 0] > 5.5


@pytest.mark.slow
def test_an_actor_without_a_route_stands_still() -> None:
    standing = [plan.model_copy(update={"route": ()}) for plan in (HERO1, CAR)]
    trace = simulate(scene(*standing, frames=30))
    assert not (trace.positions != trace.positions[0]).any()
    bodies = [k for k, part in enumerate(trace.parts) if not part.endswith("/head")]  # standing people turn their heads
    assert not (trace.rotations[:, bodies] != trace.rotations[0, bodies]).any()


@pytest.mark.slow
def test_an_empty_scene_has_an_empty_trace() -> None:
    assert process.simulate(scene(frames=3)).positions.shape == (3, 0, 3)


@pytest.mark.slow
def test_a_pedestrian_steps_onto_and_off_a_kerb() -> None:
    walker = actor("walker", "walker.pedestrian.0003", -4, 0, 0, (4.5, 0), 1.4)
    height = base(simulate(scene(walker, frames=260)), "walker")[:, 2]
    assert height.max() == pytest.approx(0.15, abs=0.002)
    assert -0.09 < height.min() < 0.0  # the pelvis moves up and down with each stride
    assert height[-1] == pytest.approx(0.15, abs=0.004)  # the weight is on one leg


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_non_finite_motion_is_an_error(value: float) -> None:
    with pytest.raises(RunError, match="the simulation diverged"):
        snap(np.array([0.0, value]), METRE)


@pytest.mark.slow
def test_a_parked_car_never_moves_and_traffic_passes_it() -> None:
    """Two cars are parked on either side of a lane; a third passes between them and the centre line."""
    street = next(e for e in TOWN.plan.elements if e.kind == "road" and e.shape["bays"] > 0 and e.pose.yaw == 0)
    bays = sorted((p for p in TOWN.parking if abs(p.y - street.pose.y) < 6), key=lambda p: (p.y, p.x))
    van = blueprints.match("vehicle.van.cargo")[0]
    parked = [
        CAR.model_copy(
            update={
                "name": f"parked{n}",
                "blueprint": van.id,
                "shape": van.shape,
                "start": pose,
                "route": (),
                "speed": 0.0,
            }
        )
        for n, pose in enumerate((bays[0], bays[1], bays[-1]))
    ]
    y, x = street.pose.y - 1.5, street.pose.x
    bus = blueprints.match("vehicle.bus.city")[0]
    driver = CAR.model_copy(
        update={
            "blueprint": bus.id,
            "shape": bus.shape,
            "start": Pose(x=x - 20, y=y, yaw=0),
            "route": (Point(x=x + 20, y=y),),
        }
    )
    trace = simulate(scene(driver, *parked, frames=450))
    for n, car in enumerate(parked):
        track = base(trace, f"parked{n}")
        assert (track == track[0]).all()
        assert track[0].tolist() == pytest.approx([car.start.x, car.start.y, 0.0], abs=1e-5)
    assert base(trace, "car")[-1, 0] == pytest.approx(x + 20, abs=0.7)
    assert np.abs(base(trace, "car")[:, 1] - y).max() < 0.1
