"""Warnings for valid values that are probably mistakes; common values cause none."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.ir.ground import path_planner
from recipe_compiler.library import towns
from recipe_compiler.lowering import enclosures

from tests.compiler.kitchen import compiled, small


def warned(actors: dict[str, Any] | None = None, **mount: Any) -> list[str]:
    """Return the warnings of a recipe with the given actors or mount of the street camera."""
    recipe = small(**({"actors": actors} if actors else {}))
    recipe["base"]["sensors"]["street"]["mount"] |= mount
    warnings = compiled(recipe).warnings
    assert all(warning.place is not None for warning in warnings)
    return [str(warning).partition(": ")[2] for warning in warnings]


def at(x: float, y: float, yaw: float = 0.0, blueprint: str = "walker.pedestrian.0001") -> dict[str, Any]:
    return {"blueprint": blueprint, "start": {"x": x, "y": y, "yaw": yaw}}


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (at(-4, 3), at(-4, 3)),
        (at(-4, 3), at(-4.3, 3.2)),
        (at(0, 0, 90, "vehicle.sedan.a"), at(0, 4, 90, "vehicle.sedan.a")),  # a bumper in a boot
        (at(0, 0, 90, "vehicle.bus.city"), at(0.9, 4.0)),  # beside the driver's seat
    ],
)
def test_a_start_in_another_body_causes_a_warning(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert warned({"one": one, "other": other}) == [
        "actors.other.start: its body overlaps the body of one; move one of them"
    ]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (at(-4, 3), at(-4, 3.6)),  # side by side
        (at(-1.5, 0, 270, "vehicle.sedan.a"), at(1.5, 0, 90, "vehicle.bus.city")),  # in the two lanes
        (at(0, 0, 90, "vehicle.sedan.a"), at(0, 5.2, 90, "vehicle.sedan.a")),  # in a queue
        (at(0, 0, 90, "vehicle.bus.city"), at(2.0, 4.5)),
    ],
)
def test_bodies_side_by_side_cause_no_warning(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert warned({"one": one, "other": other}) == []


@pytest.mark.parametrize("way", [{"goal": {"x": 900, "y": 0}}, {"route": [{"x": 0, "y": 9}, {"x": 0, "y": 900}]}])
def test_a_goal_far_outside_the_town_causes_a_warning(way: dict[str, Any]) -> None:
    (message,) = warned({"car": {**at(1.5, 0, 90, "vehicle.sedan.a"), **way}})
    assert message.startswith(f"actors.car.{next(iter(way))}: leads far out of the town, whose bounds are x ")


def test_a_start_far_outside_the_town_causes_a_warning() -> None:
    (message,) = warned({"lost": at(900, 0)})
    assert message.startswith("actors.lost.start: is far outside the town, whose bounds are x ")
    assert warned({"near": at(100, 0)}) == []


def test_a_camera_in_the_ground_causes_a_warning() -> None:
    assert warned(z=-1) == ["sensors.street: z is -1, not above the ground, which is at 0.15; raise the mount"]
    assert warned(z=0.1, x=-5)[0].startswith("sensors.street: z is 0.1, not above the ground")  # below the kerb's top
    assert warned(z=0.1, x=0) == []
    assert warned(on="hero1", z=0)[0].endswith("not above hero1's feet, which is at 0; raise the mount")
    assert warned(on="hero1", z=0.1) == []


def test_a_camera_that_is_too_far_from_the_town_to_see_it_causes_a_warning() -> None:
    (message,) = warned(x=-7800)
    assert message.startswith("sensors.street: it is more than 1000 m, its `far`, outside the town's bounds, x ")
    assert message.endswith("; move the mount")
    assert warned(x=-900) == []
    recipe = small(clock={"fps": 10, "frames": 30})
    approach = {"mount": {"x": -1150, "z": 40}, "motion": {"linear": {"to": {"x": -900}, "speed": 60}}}
    recipe["base"]["sensors"]["street"] |= approach
    assert compiled(recipe).warnings == ()


@pytest.mark.parametrize(("x", "wrong", "right"), [(-1.6, 90, -90), (1.6, -90, 90)])
def test_a_random_route_against_the_traffic_causes_a_warning(x: float, wrong: float, right: float) -> None:
    (message,) = warned({"car": at(x, 0, wrong, "vehicle.sedan.a")})
    assert message.startswith(
        f"actors.car.start.yaw: with {wrong}, it sets out against the traffic on this side of the"
    )
    assert message.endswith(f"street, whose yaw is {right}; write yaw: {right}, or leave it out")
    assert warned({"car": at(x, 0, right, "vehicle.sedan.a")}) == []
    assert warned({"car": at(x, 0, wrong, "vehicle.sedan.a") | {"goal": {"x": x, "y": 0.3 * wrong}}}) == []


@pytest.mark.parametrize(("yaw", "count"), [(0, 1), (90, 1), (-90, 0)])
def test_a_camera_along_a_road_against_the_traffic_causes_a_warning(yaw: float, count: int) -> None:
    """The yaw of a mount is 0 if it is absent, which is across this street."""
    recipe = small(clock={"fps": 10, "frames": 10}, actors={})
    mount = {"x": -1.6, "y": 0, "z": 1.5, "yaw": yaw}
    recipe["base"]["sensors"]["street"] |= {"mount": mount, "motion": {"route": {"road": True, "speed": 8}}}
    messages = [str(warning) for warning in compiled(recipe).warnings]
    assert len(messages) == count and all("it sets out against the traffic" in message for message in messages)


def test_a_camera_in_a_house_causes_a_warning() -> None:
    (message,) = warned(x=-14, y=-19, z=6)
    assert message.startswith("sensors.street: it is inside building.")
    assert message.endswith(", which has no interior; move the mount")
    assert warned(x=-14, y=-19, z=60) == []  # above the roofs
    assert warned(x=-8, y=-19, z=6) == []  # in front of the facade
    recipe = small(clock={"fps": 10, "frames": 30})
    recipe["base"]["sensors"]["street"] |= {
        "mount": {"x": -6, "y": -19, "z": 3, "yaw": 180},
        "motion": {"linear": {"to": {"x": -14}, "speed": 4}},
    }
    (warning,) = compiled(recipe).warnings
    assert " at frame 8, which has no interior" in warning.message


def test_a_start_in_a_closed_yard_causes_a_warning() -> None:
    yard = "actors.lost.start: it is in a yard enclosed by buildings and walls, which the actor cannot leave; "
    (message,) = warned({"lost": at(36, 0)})
    assert message.startswith(yard)
    assert warned({"home": {**at(36, 0), "goal": {"x": 34, "y": 3}}}) == []  # its route stays inside


@pytest.mark.parametrize("name", towns.NAMES)
def test_spawn_points_are_free_and_not_enclosed(name: str) -> None:
    town = towns.build(name, 0, {})
    yards = enclosures.Yards(town)
    poses = [*(point.pose for point in town.spawn_points[::5]), *town.parking[::5]]
    assert all(town.obstacles.at(pose.x, pose.y, path_planner.BODY) is None for pose in poses)
    assert not any(yards.around(pose.x, pose.y) for pose in poses)


def driven(actor: dict[str, Any], frames: int = 80, **props: Any) -> list[str]:
    """Return the warnings of a clip of 8 s with a vehicle."""
    recipe = small(actors={"it": actor}, clock={"fps": 10, "frames": frames}, props=props)
    return [str(warning).partition(": ")[2] for warning in compiled(recipe).warnings]


def test_a_straight_route_of_a_vehicle_through_a_building_causes_a_warning() -> None:
    """A vehicle drives straight to its goal; at a building, it would stand for the rest of the clip."""
    car = {**at(1.5, 0, 90, "vehicle.sedan.a"), "speed": 8}
    (message,) = driven({**car, "goal": {"x": 61.5, "y": 1}})
    assert message.startswith("actors.it.goal: the straight line to it meets ") and " at x: " in message
    assert message.endswith("; lead it round, with waypoints as `route`")
    (message,) = driven({**car, "route": [{"x": 1.5, "y": 9}, {"x": 61.5, "y": 9}]})
    assert message.startswith("actors.it.route[1]: the straight line to it meets building.")
    assert driven({**car, "goal": {"x": 61.5, "y": 1}}, frames=2) == []  # the clip ends earlier


@pytest.mark.slow
def test_the_width_of_a_vehicle_counts() -> None:
    """A bus touches a board beside its straight route, a bicycle passes."""
    board = {"size": {"width": 0.4, "height": 1.5}, "at": {"x": 1.1, "y": 0, "yaw": 0}}
    way = {"speed": 5, "goal": {"x": 0, "y": 10}}
    (message,) = driven({**at(0, -8, 90, "vehicle.bus.city"), **way}, board=board)
    assert message.startswith("actors.it.goal: the straight line to it meets prop.board at x: 0.0, y: -1.")
    assert driven({**at(0, -8, 90, "vehicle.bicycle.*"), **way}, board=board) == []


def test_a_route_along_a_lane_and_a_standing_vehicle_cause_no_warning() -> None:
    car = at(1.5, 0, 90, "vehicle.sedan.a")
    assert driven({**car, "speed": 8, "goal": {"x": 1.5, "y": 40}}) == []
    assert driven({**car, "speed": 0, "goal": {"x": 61.5, "y": 1}}) == []
    assert driven({**car, "speed": 8}) == []  # a route of the town
